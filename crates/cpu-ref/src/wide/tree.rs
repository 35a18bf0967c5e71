//! How the tree of layout `fast` lies in memory.

use super::collapse::Memory;
use super::fold::Ranges;
use super::moving::Moving;
use crate::simd::Level;
use crate::triangle_test::Record;
use bvh_layout::Topology;
use geom::Aabb;
use std::ops::Range;

/// Children of a node, and triangles of a block.
pub(crate) const LANES: usize = 8;

/// Up to eight boxes and where they lead: four cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// For each axis: lower planes of all lanes, then upper planes. Lanes without a child are empty.
    pub(crate) planes: Planes,
    /// Where each lane leads.
    pub(crate) links: [Link; LANES],
    /// The binary nodes that it stands for.
    pub(crate) ranges: Ranges,
}

/// For each axis: eight lower planes, then eight upper planes.
pub(crate) type Planes = [[f32; 2 * LANES]; 3];

/// Planes of eight empty boxes.
pub(crate) const EMPTY: Planes = {
    let (no, on) = (f32::INFINITY, f32::NEG_INFINITY);
    [[
        no, no, no, no, no, no, no, no, on, on, on, on, on, on, on, on,
    ]; 3]
};

/// A node or (flagged) a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Link(u32);

impl Link {
    const BLOCK: u32 = 1 << 31;
    /// The first node.
    pub(crate) const ROOT: Self = Self(0);

    pub(crate) fn node(index: usize) -> Self {
        Self(index as u32)
    }

    pub(crate) fn block(index: usize) -> Self {
        Self(index as u32 | Self::BLOCK)
    }

    #[inline(always)]
    pub(crate) fn is_block(self) -> bool {
        self.0 & Self::BLOCK != 0
    }

    /// Of the node or of the block.
    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        (self.0 & !Self::BLOCK) as usize
    }
}

/// Up to eight triangles in scaled units. Whatever cannot be hit now has corners that are not numbers.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Block {
    /// For each axis, for each corner: the coordinate in all lanes.
    pub(crate) corners: [[[f32; LANES]; 3]; 3],
    /// Index in the scene; `u32::MAX` in lanes without a triangle.
    pub(crate) triangles: [u32; LANES],
}

impl Node {
    pub(crate) const UNUSED: Self = Self {
        planes: EMPTY,
        links: [Link::ROOT; LANES],
        ranges: Ranges::NONE,
    };
}

impl Block {
    pub(crate) const UNUSED: Self = Self {
        corners: [[[f32::NAN; LANES]; 3]; 3],
        triangles: [u32::MAX; LANES],
    };
}

/// Where a block's triangles come from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Source {
    /// Vertices of each lane's triangle, for each corner.
    pub(crate) vertices: [[u32; LANES]; 3],
    /// The binary nodes that the block stands for.
    pub(crate) ranges: Ranges,
    /// Lanes with a triangle come first.
    pub(crate) count: u32,
}

impl Source {
    pub(crate) const UNUSED: Self = Self {
        vertices: [[0; LANES]; 3],
        ranges: Ranges::NONE,
        count: 0,
    };
}

/// A tree with the boxes and triangles of one moment.
#[derive(Debug)]
pub(crate) struct Wide {
    /// Level by level; there is always a root.
    pub(crate) nodes: Vec<Node>,
    /// In the order of their nodes and lanes.
    pub(crate) blocks: Vec<Block>,
    /// One a block.
    pub(crate) sources: Vec<Source>,
    /// Nodes of each level, root first.
    pub(crate) levels: Vec<Range<usize>>,
    /// For each node, the first of its blocks; the next entry ends them.
    pub(crate) first_blocks: Vec<u32>,
    /// One a lane of a block, for tests other than the watertight one; else empty.
    pub(crate) records: Vec<Record>,
    /// The box of the whole tree, in scaled units.
    pub(crate) root: Aabb,
    /// Areas of all boxes within blocks, as of the last preprocess.
    pub(crate) block_areas: f64,
    /// The instructions to trace with.
    pub(crate) level: Level,
    /// The binary tree, for whoever asks for its boxes.
    pub(crate) binary: Topology,
    pub(crate) memory: Memory,
    /// What moves, if the binary tree came with lists of it.
    pub(crate) moving: Option<Moving>,
}

impl Wide {
    /// An empty tree, to be traced with `level`.
    pub(crate) fn new(level: Level) -> Self {
        Self {
            nodes: vec![Node::UNUSED],
            blocks: Vec::new(),
            sources: Vec::new(),
            levels: Vec::new(),
            first_blocks: vec![0, 0],
            records: Vec::new(),
            root: Aabb::EMPTY,
            block_areas: 0.0,
            level,
            binary: Topology::default(),
            memory: Memory::default(),
            moving: None,
        }
    }
}
