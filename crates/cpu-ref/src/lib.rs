//! The reference backend: every stage on the host's cores, by rayon.
//!
//! Plain, and exact to the letter of what a hit is (`docs/design/hits.md`): other
//! backends are held against it bit for bit. A file a stage, by the stage's
//! name: `interpolate`, `preprocess`, `refit`, `trace`; and a file a triangle
//! test in `intersect`. Every layout is traced as the binary tree of `bvh2`,
//! unless the caller brings an [`Accelerator`] of its own, as `cpu-simd` does for `fast`.

mod backend;
pub mod bvh2;
pub mod extreme;
pub mod geometry;
mod interpolate;
pub mod intersect;
pub mod pass;
mod preprocess;
pub mod ray;
pub mod scale;
mod scene;
pub mod shadow;
pub mod slab;
mod submission;
#[cfg(test)]
mod tests;
pub mod tiles;
pub mod trace;
pub mod traverse;

pub use crate::backend::CpuBackend;

use ::backend::{BackendError, Intersector, Result};
use bvh_layout::Topology;
use geom::{Aabb, Animation};
use geometry::{Geometry, Unhittable};
use tiles::{Counts, Output};
use trace::TraceTask;

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
