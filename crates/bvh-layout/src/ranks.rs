//! Nodes by their ranks: places among leaves, or among inner nodes.

use crate::Topology;

/// A node by its rank among its kind: leaves by their place in [`Topology::leaf_triangles`], or inner nodes in node order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeRank(u32);

impl NodeRank {
    const LEAF: u32 = 1 << 31;

    /// A leaf's rank; `None` for an inner node.
    #[must_use]
    #[inline]
    pub fn leaf(self) -> Option<u32> {
        (self.0 & Self::LEAF != 0).then_some(self.0 & !Self::LEAF)
    }

    /// The rank, of whichever kind.
    #[must_use]
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
    #[must_use]
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
    #[must_use]
    #[inline]
    pub fn children(self, inner: NodeRank) -> [NodeRank; 2] {
        Topology::children_of_inner(inner.0).map(|node| self.of(node))
    }
}
