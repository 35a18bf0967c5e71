//! What a host must know of a tree's record to run kernels over it.

use crate::{MovingShape, common};
use bvh_layout::Topology;
use std::ops::Range;

/// A tree's parts and levels.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Shape {
    /// Where the bits that tell leaves begin, in words of the record.
    pub leaf_bits_at: u32,
    /// Where the counts of leaves before each word of bits begin.
    pub leaf_ranks_at: u32,
    /// Where the leaves' triangles begin.
    pub leaf_triangles_at: u32,
    /// Leaves.
    pub leaf_count: u32,
    /// Nodes, leaves included.
    pub node_count: u32,
    /// Inner nodes of each level that has any, as numbers among the inner nodes, root first.
    pub levels: Vec<Range<u32>>,
    /// What moves, where the tree came with lists of it.
    pub moving: Option<MovingShape>,
}

impl Shape {
    /// Of a record.
    #[must_use]
    pub fn of(tree: &Topology) -> Self {
        let bits = Topology::HEADER_WORDS + tree.level_count();
        let words = tree.leaf_bits().len();
        let levels = tree.levels().map(|level| level.inner);
        Self {
            leaf_bits_at: bits as u32,
            leaf_ranks_at: (bits + words) as u32,
            leaf_triangles_at: (bits + 2 * words) as u32,
            leaf_count: tree.leaf_count() as u32,
            node_count: tree.node_count() as u32,
            levels: levels.filter(|inner| !inner.is_empty()).collect(),
            moving: tree.moving().map(|m| MovingShape::of(tree, m)),
        }
    }

    /// Of a tree of so many leaves that the device makes: the leaves' triangles
    /// are the buffer `sorted`, from its start. It has no levels, as it needs no refit.
    #[must_use]
    pub fn made_on_device(leaves: u32) -> Self {
        Self {
            leaf_count: leaves,
            node_count: (2 * leaves).saturating_sub(1),
            ..Self::default()
        }
    }

    /// Bytes of the buffer `costs` that suffice for every tree of so many
    /// leaves: one f32 for each workgroup of each level, in whole rows of 16 bytes.
    #[must_use]
    pub fn cost_bytes(leaves: u64) -> u64 {
        let group = u64::from(common("refit").workgroup[0]);
        let groups = leaves.div_ceil(group) + u64::from(bvh_build::MAX_DEPTH) + 1;
        (groups * 4).next_multiple_of(16)
    }
}
