//! The builder: a reusable workspace and the entry point of the recursion.

use crate::cancel::{BuildError, Cancel};
use crate::gather::{Gathered, gather};
use crate::node::{self, BuildNode};
use crate::prim::Prim;
use crate::task::BuildTask;
use crate::{BinaryTree, BlockSize, Boxes};
use geom::Point;

/// Builds trees. Keeps its memory, so that a second build of the same size makes no large allocation.
///
/// The workspace takes 64 bytes per triangle.
#[derive(Debug, Default)]
pub struct SahBuilder {
    prims: Vec<Prim>,
    scratch: Vec<Prim>,
    /// Point that children are ordered toward, if any. Rays to the point then find an occluder sooner.
    ///
    /// In large nodes, the child whose box extends less far from the point comes first. In nodes of at most 32
    /// triangles, the child on the point's side of the split comes first. Nodes of at most four triangles are not
    /// ordered, nor are large nodes without a usable plane. The tree is otherwise the same.
    pub toward: Option<Point>,
    /// Number of triangles per block in the heuristic. Leaves have one triangle for every block size.
    pub block_size: BlockSize,
}

impl SahBuilder {
    /// Builds a tree over all boxes that are finite and not empty. Reuses the memory of `tree`.
    ///
    /// # Errors
    /// [`BuildError::Cancelled`]; `tree` is then empty.
    ///
    /// # Panics
    /// If the number of boxes does not fit a `u32`.
    pub fn build<B: Boxes + ?Sized>(
        &mut self,
        boxes: &B,
        cancel: &Cancel,
        tree: &mut BinaryTree,
    ) -> Result<(), BuildError> {
        self.build_below(0, self.block_size, boxes, cancel, tree)
    }

    /// Builds a tree whose root has depth `depth`. The depth of its leaves is still at most [`crate::MAX_DEPTH`].
    pub(crate) fn build_below<B: Boxes + ?Sized>(
        &mut self,
        depth: u32,
        block_size: BlockSize,
        boxes: &B,
        cancel: &Cancel,
        tree: &mut BinaryTree,
    ) -> Result<(), BuildError> {
        tree.fill(cancel, |tree| {
            let n = boxes.triangle_count();
            assert!(u32::try_from(n).is_ok(), "{n} triangles cannot be numbered");
            if self.prims.len() < n {
                self.prims.resize(n, Prim::default());
                self.scratch.resize(n, Prim::default());
            }
            let Gathered {
                count: leaves,
                extents,
                factor,
            } = gather(boxes, &mut self.prims[..n]);
            let slot = tree.slot(leaves);
            if leaves == 0 {
                return Ok(());
            }
            let node = BuildNode {
                prims: &mut self.prims[..leaves],
                scratch: &mut self.scratch[..leaves],
                slot,
                extents,
                depth,
            };
            let toward = self.toward.map(|point| point.map(|x| x * factor));
            let task = BuildTask {
                cancel,
                toward,
                block_size,
            };
            node::build(node, task)
        })
    }
}

impl BinaryTree {
    /// Builds a tree over all boxes that are finite and not empty, with a temporary [`SahBuilder`].
    #[must_use]
    pub fn over<B: Boxes + ?Sized>(boxes: &B) -> Self {
        let mut tree = Self::default();
        let built = SahBuilder::default().build(boxes, &Cancel::new(), &mut tree);
        built.expect("the build is not cancelled");
        tree
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use geom::Aabb;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// Creates a box from its lower corner and its edges.
    pub(crate) fn sized(min: Point, edges: Point) -> Aabb {
        let max = std::array::from_fn(|i| min[i] + edges[i]);
        Aabb { min, max }
    }

    /// Returns `n` cubes in a row.
    pub(crate) fn row(n: u32, edge: f32) -> Vec<Aabb> {
        let at = |i: u32| [i, i % 7, i % 31].map(|x| x as f32 * edge);
        (0..n).map(|i| sized(at(i), [edge; 3])).collect()
    }

    #[test]
    fn later_builds_reuse_memory() {
        let (mut builder, mut tree) = (SahBuilder::default(), BinaryTree::default());
        let (large, cancel) = (row(50_000, 1.0), Cancel::new());
        builder.build(&large[..], &cancel, &mut tree).unwrap();
        let memory = |builder: &SahBuilder, tree: &BinaryTree| {
            let work = [&builder.prims, &builder.scratch].map(|v| (v.as_ptr(), v.capacity()));
            let out = [&tree.order, &tree.left_leaves].map(|v| (v.as_ptr(), v.capacity()));
            (work, out)
        };
        let before = memory(&builder, &tree);
        assert_eq!(before.0[0].1 * size_of::<Prim>(), 50_000 * 32);
        for boxes in [&large[..], &large[..40_000], &large[..3], &large[..]] {
            builder.build(boxes, &cancel, &mut tree).unwrap();
            assert_eq!(memory(&builder, &tree), before);
            assert_eq!(tree.leaf_count(), boxes.len());
        }
    }

    /// Boxes that cancel the build when the last box is read.
    struct CancelledAfter<'a>(Vec<Aabb>, &'a Cancel, AtomicU32);

    impl Boxes for CancelledAfter<'_> {
        fn triangle_count(&self) -> usize {
            self.0.len()
        }
        fn get(&self, triangle: u32) -> Aabb {
            let seen = self.2.fetch_add(1, Ordering::Relaxed) + 1;
            if seen as usize == self.0.len() {
                self.1.cancel();
            }
            self.0[triangle as usize]
        }
    }

    #[test]
    fn cancelled_build_leaves_builder_usable() {
        let (mut builder, mut tree) = (SahBuilder::default(), BinaryTree::default());
        let (before, during, few) = (Cancel::new(), Cancel::new(), row(9, 1.0));
        builder.build(&few[..], &before, &mut tree).unwrap();
        before.cancel();
        let early = builder.build(&few[..], &before, &mut tree);
        assert_eq!((early, tree.leaf_count()), (Err(BuildError::Cancelled), 0));
        let boxes = CancelledAfter(row(20_000, 1.0), &during, AtomicU32::new(0));
        let late = builder.build(&boxes, &during, &mut tree);
        assert_eq!((late, tree.root()), (Err(BuildError::Cancelled), None));
        assert!(tree.left_leaves().is_empty());
        let again = builder.build(&few[..], &Cancel::new(), &mut tree);
        assert_eq!((again, tree.leaf_count()), (Ok(()), 9));
    }
}
