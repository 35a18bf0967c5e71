//! The two lists that refit kernels walk.

use crate::Topology;

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
    pub fn fill(&mut self, _topology: &Topology) {
        unimplemented!()
    }
}
