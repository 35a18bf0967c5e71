//! The next tree from the last one: small groups of triangles that still lie together stay, all above is built anew.
//!
//! What moves, moves as a whole where one looks closely: after some frames most small subtrees are nearly as good as new,
//! and it is the levels above that have to change. So small subtrees of the last tree are the primitives of a much
//! smaller build and keep their insides; those that came apart are taken to pieces first. (Building in two levels, from
//! scratch: Ganestam, Barringer, Doggett, Akenine-Möller, *Bonsai*, 2015. Taking down only what motion spoiled: Yoon,
//! Curtis, Manocha, *Ray Tracing Dynamic Scenes using Selective Restructuring*, 2007.)

mod groups;

use crate::tree::SubtreeSlot;
use crate::{BinaryTree, Boxes, BuildError, Builder, Cancel, Subtree, join_if, sah_cost};
use groups::{Groups, LEVELS};
use rayon::prelude::*;

/// Nodes over more groups than this are written in parallel.
const PARALLEL: u32 = 1024;

/// Makes trees from trees; keeps its memory.
#[derive(Debug, Default)]
pub struct SubtreeRebuilder {
    /// Subtrees of the last tree.
    groups: Groups,
    /// The tree of groups.
    above: BinaryTree,
    /// For each leaf of `above`, how many triangles lie to the left of its group; then that of all.
    starts: Vec<u32>,
}

/// Costs of both trees as of [`sah_cost`], but for rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// Of the last tree with the new boxes.
    pub last: f64,
    /// Of the new one.
    pub new: f64,
}

impl SubtreeRebuilder {
    /// No memory yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Builds over `boxes` into `tree`, from groups of `last`. The tree depends on these two and the point that the builder
    /// faces; the builder lends its memory.
    ///
    /// # Errors
    /// [`BuildError::Cancelled`]; `tree` is then empty.
    ///
    /// # Panics
    /// If `last` holds a triangle whose box is not usable now. One that it does not hold has no part in the new tree.
    pub fn build<B: Boxes + ?Sized>(
        &mut self,
        builder: &mut Builder,
        (last, boxes): (&BinaryTree, &B),
        cancel: &Cancel,
        tree: &mut BinaryTree,
    ) -> Result<Costs, BuildError> {
        tree.fill(|tree| {
            let areas = self.groups.find(last, boxes);
            assert_eq!(
                areas.lost, 0,
                "a triangle of the last tree has no usable box"
            );
            builder.build_below(LEVELS, &self.groups.boxes[..], cancel, &mut self.above)?;
            self.count();
            let slot = tree.slot(last.leaf_count());
            if let Some(root) = self.above.root() {
                self.unfold(last, root, slot);
            }
            let over_root = |sum: f64| {
                if areas.root > 0.0 {
                    sum / areas.root
                } else {
                    0.0
                }
            };
            Ok(Costs {
                last: over_root(areas.all),
                new: over_root(areas.within_groups) + sah_cost(&self.above, &self.groups.boxes[..]),
            })
        })
    }

    fn count(&mut self) {
        let leaves = |&group: &u32| self.groups.nodes[group as usize].leaves;
        let order = self.above.order.par_iter();
        order.map(leaves).collect_into_vec(&mut self.starts);
        let mut sum = 0;
        for start in &mut self.starts {
            sum += std::mem::replace(start, sum);
        }
        self.starts.push(sum);
    }

    /// Triangles below a node of `above`.
    fn leaves(&self, node: Subtree) -> usize {
        let start = |leaf: u32| self.starts[leaf as usize] as usize;
        start(node.first_leaf + node.leaves) - start(node.first_leaf)
    }

    /// Writes the subtree below a node of `above`.
    fn unfold(&self, last: &BinaryTree, node: Subtree, slot: SubtreeSlot<'_>) {
        if node.leaves == 1 {
            let group = self.groups.nodes[self.above.order[node.first_leaf as usize] as usize];
            let (order, inner) = (group.first_leaf as usize, group.inner as usize);
            (slot.order).copy_from_slice(&last.order[order..][..slot.order.len()]);
            (slot.left_leaves)
                .copy_from_slice(&last.left_leaves[inner..][..slot.left_leaves.len()]);
            return;
        }
        let [a, b] = self.above.children(node);
        let [slot_a, slot_b] = slot.split(self.leaves(a));
        join_if(
            node.leaves > PARALLEL,
            || self.unfold(last, a, slot_a),
            || self.unfold(last, b, slot_b),
        );
    }
}

#[cfg(test)]
mod tests;
