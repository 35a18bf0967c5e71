//! The reference backend: every stage on the host's cores, by rayon.
//!
//! Plain, and exact to the letter of what a hit is (`docs/design/hits.md`): other backends are held against it bit for
//! bit. Stages are in `interpolate`, `bvh2` (preprocess and refit) and `trace`; each triangle test has a file in
//! `intersect`. Every layout is traced as the binary tree of `bvh2`, unless the caller brings an [`Accelerator`] of its
//! own, as `cpu-simd` does for `fast`.

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

use ::backend::{BackendError, Intersector, Result};
use bvh_layout::Topology;
use geom::{Aabb, Animation, Point, Range, Ray, Triangle};
use scale::Scale;
use std::ops::Add;
use tiles::{Counts, Output};
use trace::TraceTask;

/// Leaves that are never hit, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unhittable {
    /// A corner is not finite.
    pub inactive: u64,
    /// Active, but of zero area.
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

/// Where triangles are.
#[derive(Clone, Copy, Debug)]
pub struct Geometry<'a> {
    /// One a vertex, in the scene's units.
    pub positions: &'a [Point],
    /// Three vertices a triangle.
    pub triangles: &'a [[u32; 3]],
    /// To scaled units.
    pub scale: Scale,
    /// How far coordinates reach at this moment.
    pub range: Range,
}

impl Geometry<'_> {
    /// A triangle's corners in the scene's units.
    #[inline]
    pub fn corners(&self, triangle: u32) -> Triangle {
        self.triangles[triangle as usize].map(|v| self.positions[v as usize])
    }

    /// Whether the ray is beyond what rounded tests can tell.
    #[inline]
    pub fn is_extreme(&self, ray: &Ray) -> bool {
        self.range.is_extreme(self.scale.apply(ray.origin))
    }

    /// A triangle's corners in scaled units.
    #[inline]
    pub fn scaled_corners(&self, triangle: u32) -> Triangle {
        self.corners(triangle).map(|p| self.scale.apply(p))
    }
}

/// A tree in some layout, with the boxes and triangles of one moment. Boxes are in scaled units.
pub trait Accelerator: Send + Sync {
    /// Takes over a record of this scene. Boxes are left stale.
    ///
    /// # Errors
    /// Memory does not suffice; the old tree is then still current.
    fn adopt(&mut self, tree: &Topology, animation: &Animation) -> Result<()>;

    /// Whether it reads a record's eight-wide form.
    fn wants_blocks(&self) -> bool {
        false
    }

    /// Positions to records and boxes of leaves, and of inner nodes where one pass does both; counts the leaves that cannot
    /// be hit now.
    fn preprocess(&mut self, geometry: &Geometry<'_>, intersector: Intersector) -> Unhittable;

    /// Boxes of leaves to those boxes of inner nodes that are left. Returns the sum of all nodes' half areas, with the same
    /// bits for every number of threads, and the box of the whole tree.
    fn refit(&mut self) -> (f64, Aabb);

    /// Answers all rays of a task.
    fn trace(&self, task: TraceTask<'_>, out: Output<'_>) -> Counts;

    /// Boxes in the node order of the record.
    ///
    /// # Errors
    /// Memory does not suffice.
    fn boxes(&self, geometry: &Geometry<'_>) -> Result<Vec<Aabb>>;
}

/// Makes room for `count` entries in all.
///
/// # Errors
/// [`BackendError::OutOfMemory`], naming `what` they are.
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
