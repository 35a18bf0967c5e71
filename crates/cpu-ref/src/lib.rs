//! The reference backend, `cpu-ref`: runs every stage in scalar code on the host's cores with rayon.
//!
//! It is meant to be read, not to be fast. It follows the definition of a hit (`docs/design/hits.md`) exactly, and tests
//! compare all other backends with it bit for bit. Its tree is the breadth-first binary tree of Kim and others (2014), with
//! one triangle per leaf.
//!
//! Stages are in `interpolate`, `bvh2` (preprocess and refit) and `trace`; each triangle test has a file in `intersect`.
//! Backend `cpu` is the same code with the [`Accelerator`] of `cpu-simd`.

mod backend;
pub mod bvh2;
pub mod extreme;
mod interpolate;
pub mod intersect;
pub mod pass;
pub mod scale;
mod scene;
pub mod shadow;
pub mod slab;
mod submission;
pub mod tiles;
pub mod trace;
pub mod traverse;

pub use crate::backend::CpuBackend;

use ::backend::{BackendError, Intersector, Result, TreeFormat};
use bvh_layout::Topology;
use geom::{Aabb, Animation, Point, Range, Ray, Triangle};
use scale::Scale;
use std::ops::Add;
use tiles::{Counts, Output};
use trace::TraceTask;

/// Counts of leaves that no ray can hit, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unhittable {
    /// Leaves with a corner that is not finite.
    pub inactive: u64,
    /// Active leaves of zero area.
    pub degenerate: u64,
}

impl Add for Unhittable {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            inactive: self.inactive + other.inactive,
            degenerate: self.degenerate + other.degenerate,
        }
    }
}

/// The triangles of a scene at one moment.
#[derive(Clone, Copy, Debug)]
pub struct Geometry<'a> {
    /// Position of each vertex, in the scene's units.
    pub positions: &'a [Point],
    /// Three vertex indices per triangle.
    pub triangles: &'a [[u32; 3]],
    /// Conversion to scaled units.
    pub scale: Scale,
    /// Range of the coordinates at this moment.
    pub range: Range,
}

impl Geometry<'_> {
    /// Returns a triangle's corners in the scene's units.
    #[inline]
    pub fn corners(&self, triangle: u32) -> Triangle {
        self.triangles[triangle as usize].map(|v| self.positions[v as usize])
    }

    /// Returns whether the ray is outside the range that rounded tests support.
    #[inline]
    pub fn is_extreme(&self, ray: &Ray) -> bool {
        self.range.is_extreme(self.scale.apply(ray.origin))
    }

    /// Returns a triangle's corners in scaled units.
    #[inline]
    pub fn scaled_corners(&self, triangle: u32) -> Triangle {
        self.corners(triangle).map(|p| self.scale.apply(p))
    }
}

/// A tree in the form that it is traced in, with the boxes and triangles of one moment. Boxes are in scaled units.
pub trait Accelerator: Send + Sync {
    /// Copies the topology of a tree of this scene. Boxes are stale afterwards.
    ///
    /// # Errors
    /// If memory does not suffice. The old tree is then still current.
    fn adopt(&mut self, tree: &Topology, animation: &Animation) -> Result<()>;

    /// Returns the form of a tree that [`Self::adopt`] reads.
    fn format(&self) -> TreeFormat;

    /// Computes the record and the box of each leaf, and the boxes of inner nodes where one pass does both. Returns the
    /// counts of leaves that cannot be hit at this moment.
    fn preprocess(&mut self, geometry: &Geometry<'_>, intersector: Intersector) -> Unhittable;

    /// Computes the remaining boxes of inner nodes. Returns the sum of all nodes' half areas, with the same bits for
    /// every number of threads, and the root box.
    fn refit(&mut self) -> (f64, Aabb);

    /// Traces all rays of a task into `out`.
    fn trace(&self, task: TraceTask<'_>, out: Output<'_>) -> Counts;

    /// Returns the boxes in the node order of the tree that was adopted.
    ///
    /// # Errors
    /// If memory does not suffice.
    fn boxes(&self, geometry: &Geometry<'_>) -> Result<Vec<Aabb>>;
}

/// Grows the capacity of `memory` to at least `count` entries.
///
/// # Errors
/// [`BackendError::OutOfMemory`], which names `what` the entries are.
pub fn reserve<T>(memory: &mut Vec<T>, count: usize, what: &str) -> Result<()> {
    let more = count.saturating_sub(memory.len());
    let bytes = (count as u64).saturating_mul(size_of::<T>() as u64);
    memory
        .try_reserve_exact(more)
        .map_err(|_| BackendError::OutOfMemory {
            what: what.to_owned(),
            bytes,
        })
}
