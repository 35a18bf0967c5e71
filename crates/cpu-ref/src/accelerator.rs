//! The part of the backend that `cpu-simd` replaces.

use crate::geometry::{Geometry, Unhittable};
use crate::output::{HitCounts, TraceOutput};
use crate::trace::QueryTracer;
use crate::traversal::TreeTraversal;
use backend::{BackendError, Intersector, Result};
use bvh_layout::Topology;
use geom::{Aabb, Animation};

/// A tree that a backend adopts, refits to the triangles of a moment, and traces.
pub trait Accelerator: Send + Sync {
    /// Returns the tree, to search for hits of single rays.
    fn tree(&self) -> &dyn TreeTraversal;

    /// Copies or shares the topology of a tree. Boxes and triangle data are stale afterwards.
    ///
    /// # Errors
    /// If memory does not suffice. The old tree is then still current.
    fn adopt(&mut self, tree: &Topology, animation: &Animation) -> Result<()>;

    /// Computes the triangle data and the box of each leaf. May also compute boxes of inner nodes in the same pass.
    /// Returns the counts of leaves that cannot be hit at this moment.
    fn preprocess(&mut self, geometry: &Geometry<'_>, intersector: Intersector) -> Unhittable;

    /// Computes the remaining boxes of inner nodes. Returns the sum of all nodes' half areas, with the same bits for
    /// every number of threads.
    fn refit(&mut self) -> f64;

    /// Traces all rays of a query. `tracer.tree` is [`Self::tree`].
    fn trace(&self, tracer: &QueryTracer<'_>, out: TraceOutput<'_>) -> HitCounts;

    /// Returns the boxes of the binary tree that was adopted, in scaled units and breadth-first order.
    ///
    /// # Errors
    /// If memory does not suffice.
    fn boxes(&self, geometry: &Geometry<'_>) -> Result<Vec<Aabb>>;
}

/// Grows the capacity of `memory` to at least `count` entries.
///
/// # Errors
/// [`BackendError::OutOfMemory`]. `what` names the entries in its message.
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
