//! Nodes by their ranks, and as the two lists that refit kernels walk.

use crate::Topology;
use rayon::prelude::*;

/// Words of bits that one task unpacks.
const TASK: usize = 1 << 9;

/// The nodes of a record as two lists, each sorted by level (and so by node).
///
/// [`Topology::levels`] gives each level's range in both. The children of
/// `inner_nodes[k]` are nodes `2k + 1` and `2k + 2`; the triangle of
/// `leaf_nodes[i]` is `leaf_triangles()[i]`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lists {
    /// Node index of each leaf.
    pub leaf_nodes: Vec<u32>,
    /// Node index of each inner node.
    pub inner_nodes: Vec<u32>,
}

impl Lists {
    /// Fills both lists from a record, in parallel, reusing their memory.
    pub fn fill(&mut self, topology: &Topology) {
        let nodes = topology.node_count();
        self.leaf_nodes.resize(topology.leaf_count(), 0);
        self.inner_nodes.resize(nodes - topology.leaf_count(), 0);
        let (mut leaves, mut inner) = (&mut self.leaf_nodes[..], &mut self.inner_nodes[..]);
        let mut tasks = Vec::new();
        for (task, bits) in topology.leaf_bits().chunks(TASK).enumerate() {
            let first = task * TASK * 32;
            let count = (nodes - first).min(bits.len() * 32);
            let ones = bits.iter().map(|w| w.count_ones() as usize).sum::<usize>();
            let (leaf_part, leaf_rest) = leaves.split_at_mut(ones);
            let (inner_part, inner_rest) = inner.split_at_mut(count - ones);
            tasks.push((first as u32, bits, leaf_part, inner_part));
            (leaves, inner) = (leaf_rest, inner_rest);
        }
        tasks
            .into_par_iter()
            .for_each(|(first, bits, leaves, inner)| {
                unpack(first, bits.iter().copied(), leaves);
                unpack(first, bits.iter().map(|word| !word), inner);
            });
    }
}

/// Writes the places of ones, counted from `first`, until `places` is full.
fn unpack(first: u32, words: impl Iterator<Item = u32>, places: &mut [u32]) {
    let mut rest = places;
    for (base, word) in (first..).step_by(32).zip(words) {
        let count = rest.len().min(word.count_ones() as usize);
        let (part, after) = rest.split_at_mut(count);
        let mut ones = word;
        for place in part {
            *place = base + ones.trailing_zeros();
            ones &= ones.wrapping_sub(1);
        }
        rest = after;
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

    fn check(record: &Topology, lists: &Lists) {
        let is_leaf = |node: u32| record.leaf_bits()[node as usize / 32] >> (node % 32) & 1 == 1;
        let (leaves, inner): (Vec<u32>, Vec<u32>) =
            (0..record.node_count() as u32).partition(|&node| is_leaf(node));
        assert_eq!((&lists.leaf_nodes, &lists.inner_nodes), (&leaves, &inner));
    }

    #[test]
    fn every_node_stands_in_one_list_in_order() {
        let mut lists = Lists::default();
        for tree in shapes() {
            let record = record(&tree);
            lists.fill(&record);
            check(&record, &lists);
        }
        let tree = random_tree(TASK * 40, 5);
        let record = record(&tree);
        lists.fill(&record);
        check(&record, &lists);
        lists.fill(&Topology::default());
        assert_eq!(lists, Lists::default());
    }
}
