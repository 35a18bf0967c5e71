//! The reference backend, `cpu-ref`: runs every stage in scalar code on the host's cores with rayon.
//!
//! It is written for clarity, not for speed. It follows the definition of a hit (`docs/design/hits.md`) exactly, and
//! tests compare all other backends with it bit for bit (GPUs only with `watertight` and `exact`). Its tree is the
//! breadth-first binary tree of Kim and others (2014), with one triangle per leaf. Every frame processes all leaves and
//! all nodes.
//!
//! Each module uses only modules before it in this list:
//!
//! - `scale`, `geometry`, `box_test`: units, the triangles of a moment, the box test;
//! - `intersect`: the ray-triangle tests, one file each;
//! - `traversal`, `search`: the interface of a tree, and the search for hits in single precision;
//! - `exact`, `extreme`: searches that use exact integers;
//! - `shadow`, `output`, `trace`: all rays of a query, with their shadow rays;
//! - `accelerator`, `bvh2`: preprocess and refit, for the paper's tree;
//! - `interpolate`, `scene`, `submission`, `backend`: the stages of a frame.
//!
//! Backend `cpu` is the same code with the [`Accelerator`] of `cpu-simd`.

mod accelerator;
mod backend;
mod box_test;
mod bvh2;
mod exact;
mod extreme;
mod geometry;
mod interpolate;
pub mod intersect;
mod output;
pub mod scale;
mod scene;
mod search;
pub mod shadow;
mod submission;
mod trace;
mod traversal;

pub use crate::backend::CpuBackend;
pub use accelerator::{Accelerator, reserve};
pub use box_test::{
    BoxRay, BoxSpan, MAX_FINITE_PRODUCT_DISTANCE, MAX_PADDING_DISTANCE, MIN_DIRECTION,
    MIN_PADDING_DISTANCE, PAD,
};
pub use bvh2::Bvh2;
pub use exact::{FILTER_UNDERFLOW_ERROR, SHEAR_ERROR, T_ERROR};
pub use extreme::is_extreme;
pub use geometry::{Geometry, Unhittable};
pub use output::{HitCounts, RayResult, TraceOutput};
pub use search::RaySearch;
pub use trace::QueryTracer;
pub use traversal::{Child, TreeTraversal, TriangleVisitor, VisitedTriangle};
