//! One tree for many moments: the surface area heuristic averaged over time.
//!
//! The cost is T-SAH (Bittner, Meister: *T-SAH: Animation Optimized Bounding Volume Hierarchies*, 2015): the mean over a few
//! moments of the tree's cost relative to its root then, weighed by the time that each stands for. They move subtrees of a
//! finished tree, thousands of steps one after the other. Here the tree is built top-down: each node is cut by the best of
//! the planes between centres along three axes at several moments. That needs one pass a level, runs in parallel, and
//! gives the same tree for every number of threads.

mod bins;
mod lanes;
mod node;
mod prims;

use crate::{BinaryTree, Boxes, BuildError, Cancel, sah_cost};
use node::TemporalNode;
use prims::Prims;

/// The most moments a tree may be built for.
pub const MAX_MOMENTS: usize = lanes::LANES;

/// Boxes at one moment, and how much it counts.
#[derive(Clone, Copy, Debug)]
pub struct Moment<B> {
    /// Where the triangles are.
    pub boxes: B,
    /// The time it stands for, in any unit; finite and not negative.
    pub weight: f64,
}

/// Builds trees for several moments at once; keeps its memory between builds.
///
/// The workspace is 200 bytes a triangle.
#[derive(Debug, Default)]
pub struct TemporalBuilder {
    prims: Prims,
    room: Vec<u32>,
}

impl TemporalBuilder {
    /// Builds over all triangles whose box is not empty at one moment at least, into `tree`, whose memory is reused.
    /// Where a triangle has no box, its first one stands for it.
    ///
    /// # Errors
    /// [`BuildError::Cancelled`]; `tree` is then empty.
    ///
    /// # Panics
    /// If there is no moment, if there are more than [`MAX_MOMENTS`], or if
    /// they differ in their number of triangles, or if that exceeds a `u32`.
    pub fn build<B: Boxes>(
        &mut self,
        moments: &[Moment<B>],
        cancel: &Cancel,
        tree: &mut BinaryTree,
    ) -> Result<(), BuildError> {
        tree.fill(cancel, |tree| {
            self.prims.gather(moments, &mut tree.order);
            let leaves = tree.order.len();
            self.room.resize(leaves, 0);
            let slot = tree.slot(leaves);
            if leaves == 0 {
                return Ok(());
            }
            let root = TemporalNode {
                slot,
                room: &mut self.room,
                depth: 0,
            };
            node::build(&self.prims, root, cancel)
        })
    }
}

/// The mean of [`sah_cost`] over moments, by weight; 0 where all weights are.
#[must_use]
pub fn temporal_cost<B: Boxes>(tree: &BinaryTree, moments: &[Moment<B>]) -> f64 {
    let weights: f64 = moments.iter().map(|m| m.weight).sum();
    let costs = moments.iter().map(|m| m.weight * sah_cost(tree, &m.boxes));
    if weights > 0.0 {
        costs.sum::<f64>() / weights
    } else {
        0.0
    }
}
