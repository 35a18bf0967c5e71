//! Nodes by their ranks.

use crate::Topology;
use rayon::prelude::*;

/// Words of bits that one task unpacks.
const TASK: usize = 1 << 9;

impl Topology {
    /// Writes the node of each leaf, by rank, in parallel, reusing memory. The triangle of `nodes[i]` is
    /// `leaf_triangles()[i]`.
    pub fn leaf_nodes(&self, nodes: &mut Vec<u32>) {
        nodes.resize(self.leaf_count(), 0);
        let (mut rest, mut tasks) = (&mut nodes[..], Vec::new());
        for (first, bits) in (0_u32..)
            .step_by(32 * TASK)
            .zip(self.leaf_bits().chunks(TASK))
        {
            let ones = bits.iter().map(|w| w.count_ones() as usize).sum();
            let (part, after) = rest.split_at_mut(ones);
            tasks.push((first, bits, part));
            rest = after;
        }
        let tasks = tasks.into_par_iter();
        tasks.for_each(|(first, bits, part)| {
            let mut places = part.iter_mut();
            for (base, &word) in (first..).step_by(32).zip(bits) {
                let mut ones = word;
                for place in places.by_ref().take(word.count_ones() as usize) {
                    *place = base + ones.trailing_zeros();
                    ones &= ones.wrapping_sub(1);
                }
            }
        });
    }
}

/// A node by its rank among its kind: leaves by their place in [`Topology::leaf_triangles`], or inner nodes in node order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeRank(u32);

impl NodeRank {
    const LEAF: u32 = 1 << 31;

    /// A leaf's rank; `None` for an inner node.
    #[inline]
    pub fn leaf(self) -> Option<u32> {
        (self.0 & Self::LEAF != 0).then_some(self.0 & !Self::LEAF)
    }

    /// The rank, of whichever kind.
    #[inline]
    pub fn rank(self) -> u32 {
        self.0 & !Self::LEAF
    }
}

/// Finds the ranks of a record's nodes.
#[derive(Clone, Copy, Debug)]
pub struct NodeRanks<'a> {
    pub(crate) bits: &'a [u32],
    pub(crate) ranks: &'a [u32],
}

impl NodeRanks<'_> {
    /// The rank of a node.
    ///
    /// # Panics
    /// If there is no such node.
    #[inline]
    pub fn of(self, node: u32) -> NodeRank {
        let (word, bit) = (node as usize / 32, node % 32);
        let before = self.ranks[word] + (self.bits[word] & ((1 << bit) - 1)).count_ones();
        if self.bits[word] >> bit & 1 == 1 {
            NodeRank(before | NodeRank::LEAF)
        } else {
            NodeRank(node - before)
        }
    }

    /// Both children of an inner node.
    #[inline]
    pub fn children(self, inner: NodeRank) -> [NodeRank; 2] {
        Topology::children_of_inner(inner.0).map(|node| self.of(node))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{random_tree, record, shapes};

    #[test]
    fn every_leaf_has_its_node_in_order() {
        let mut found = Vec::new();
        for tree in shapes().iter().chain(&[random_tree(TASK * 40, 5)]) {
            let record = record(tree);
            record.leaf_nodes(&mut found);
            let nodes = 0..record.node_count() as u32;
            let leaves = nodes.filter(|&node| record.ranks().of(node).leaf().is_some());
            assert!(leaves.eq(found.iter().copied()));
        }
    }
}
