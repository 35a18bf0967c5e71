//! The tree in its eight-wide form: eight children per node and eight triangles per block.

mod collapse;
mod costs;

use geom::Aabb;
use std::ops::Range;

/// Number of leaves above which a binary subtree is processed in parallel. Other passes use a multiple or a fraction as
/// the minimum size of a task: a fraction if elements are costly.
const TASK_SIZE: usize = 2048;

/// Maximum number of children of a node, and of triangles of a block.
pub const LANES: usize = 8;

/// How a binary tree is collapsed.
#[derive(Clone, Copy, Debug, Default)]
pub struct CollapseOptions<'a> {
    /// A box for each triangle, or an empty slice. Collapsing minimizes the total area of all nodes and blocks. Without
    /// boxes, the number of triangles below a node or block takes the place of its area.
    pub boxes: &'a [Aabb],
    /// The child that an any-hit traversal visits first.
    pub first_visited: FirstVisited,
}

/// The child that an any-hit traversal visits first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FirstVisited {
    /// The child of larger area, which is more likely to end the ray. A child that is a single triangle comes second.
    /// Without boxes, same as `Left`.
    Larger,
    /// The left child, for trees that are built with the likely occluder on the left.
    #[default]
    Left,
}

/// The collapsed binary tree, for processors that test eight boxes or triangles at once (Wald, Benthin, Boulos 2008).
///
/// A subtree of at most eight triangles is a *block*. Above blocks, a node holds up to eight subtrees, chosen so that
/// rays visit few nodes. [`BlockTree::of`] always creates a root, and it is a node.
///
/// # Size
///
/// 60 bytes per node and 148 per block: about 22 bytes per triangle if blocks have seven triangles.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BlockTree {
    /// Nodes level by level, root first.
    pub nodes: Vec<BlockTreeNode>,
    /// Blocks in the order of their nodes and lanes.
    pub blocks: Vec<Block>,
    /// Range of nodes of each level, root first.
    pub levels: Vec<Range<usize>>,
    /// Start of each node's blocks, and a final end: node `i` has blocks `first_blocks[i]..first_blocks[i + 1]`.
    pub first_blocks: Vec<u32>,
    /// Start of each node's inner children, and a final end, in the same form as `first_blocks`.
    pub first_children: Vec<u32>,
}

/// A node of a [`BlockTree`]: the child of each lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockTreeNode {
    /// Children. Lanes without a child come last and hold [`Link::NONE`]. The any-hit traversal of a single ray
    /// visits later children first.
    pub links: [Link; LANES],
    /// The binary nodes that this node replaces.
    pub ranges: Ranges,
}

impl BlockTreeNode {
    /// Node without children.
    pub const EMPTY: Self = Self {
        links: [Link::NONE; LANES],
        ranges: Ranges::NONE,
    };
}

/// A leaf of up to eight triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// Vertex index of each corner of each lane's triangle.
    pub vertices: [[u32; LANES]; 3],
    /// Triangle index in the scene. Lanes without a triangle come last and hold `u32::MAX`.
    pub triangles: [u32; LANES],
    /// The binary nodes that this block replaces.
    pub ranges: Ranges,
    /// Number of lanes with a triangle.
    pub count: u8,
}

impl Block {
    /// Block without triangles.
    pub const EMPTY: Self = Self {
        vertices: [[0; LANES]; 3],
        triangles: [u32::MAX; LANES],
        ranges: Ranges::NONE,
        count: 0,
    };
}

/// Reference to a node or to a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Link(u32);

impl Link {
    const BLOCK: u32 = 1 << 31;
    /// The root node.
    pub const ROOT: Self = Self(0);
    /// No child. Has the value of [`Self::ROOT`], which is no node's child.
    pub const NONE: Self = Self(0);

    /// Returns the link to node `index`.
    #[must_use]
    pub const fn node(index: usize) -> Self {
        Self(index as u32)
    }

    /// Returns the link to block `index`.
    #[must_use]
    pub const fn block(index: usize) -> Self {
        Self(index as u32 | Self::BLOCK)
    }

    /// Returns the link as a number.
    #[inline(always)]
    pub const fn bits(self) -> u32 {
        self.0
    }

    /// Returns the link that [`Link::bits`] encoded.
    #[inline(always)]
    pub const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// Returns whether this links to a block.
    #[inline(always)]
    pub const fn is_block(self) -> bool {
        self.0 & Self::BLOCK != 0
    }

    /// Returns the index of the node or of the block.
    #[inline(always)]
    pub const fn index(self) -> usize {
        (self.0 & !Self::BLOCK) as usize
    }
}

/// The binary nodes that a node or block replaces. Each covers a range of at least two neighbouring lanes.
///
/// Every range is the union of two parts of equal length, two or four lanes, which may overlap. So its box is the union
/// of the boxes of two parts, as in a sparse table for range minima (Bender, Farach-Colton 2000).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ranges {
    count: u8,
    fours: u8,
    places: [[u8; LANES]; 2],
}

impl Ranges {
    /// No binary node.
    pub const NONE: Self = Self {
        count: 0,
        fours: 0,
        places: [[0; LANES]; 2],
    };

    /// Returns the number of ranges.
    #[inline(always)]
    pub const fn count(&self) -> usize {
        self.count as usize
    }

    /// Returns the first lane of both parts of each range. Entries from [`Ranges::count`] on are unused.
    #[inline(always)]
    pub const fn places(&self) -> &[[u8; LANES]; 2] {
        &self.places
    }

    /// Returns one bit per range: 1 if its parts have four lanes, 0 if they have two.
    #[inline(always)]
    pub const fn fours(&self) -> u8 {
        self.fours
    }

    /// Appends a range of at least two lanes.
    fn push(&mut self, first: u8, end: u8) {
        let is_long = end - first >= 4;
        let at = self.count();
        self.places[0][at] = first;
        self.places[1][at] = end - if is_long { 4 } else { 2 };
        self.fours |= u8::from(is_long) << at;
        self.count += 1;
    }
}
