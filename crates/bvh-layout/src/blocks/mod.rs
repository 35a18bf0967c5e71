//! The tree once more, with eight children a node and eight triangles a block.

mod collapse;
mod costs;

use std::ops::Range;

/// Nodes or blocks that one task handles.
const RUN: usize = 2048;

/// Children of a node, and triangles of a block.
pub const LANES: usize = 8;

/// Which of two subtrees a search asks first that any hit ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum First {
    /// That of the larger area, where boxes are known: it is the likelier to end a ray. A leaf comes after.
    Larger,
    /// The left one, as of trees that face the rays' end.
    Left,
}

/// The binary tree collapsed, for machines that test eight boxes or triangles at once (Wald, Benthin, Boulos 2008).
///
/// A subtree of at most eight triangles is a *block*; above, a node holds up to eight subtrees, chosen so that a ray
/// comes to few. There is always a root, and it is a node.
///
/// # What it costs
///
/// 56 bytes a node and 160 a block: about 23 bytes a triangle.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BlockTree {
    /// Level by level, the root first.
    pub nodes: Vec<WideNode>,
    /// In the order of their nodes and lanes.
    pub blocks: Vec<Block>,
    /// Nodes of each level, root first.
    pub levels: Vec<Range<usize>>,
    /// For each node, the first of its blocks; one more entry ends them.
    pub first_blocks: Vec<u32>,
    /// For each node, the first inner child of it or of those after it; one more entry ends them.
    pub first_children: Vec<u32>,
}

/// Where a node's lanes lead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WideNode {
    /// [`Link::ROOT`] in lanes without a child, which come last. Of the others the last one is to be asked first.
    pub links: [Link; LANES],
    /// The binary nodes that it stands for.
    pub ranges: Ranges,
}

impl WideNode {
    /// No children.
    pub const EMPTY: Self = Self {
        links: [Link::ROOT; LANES],
        ranges: Ranges::NONE,
    };
}

/// Up to eight triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// Vertices of each lane's triangle, for each corner.
    pub vertices: [[u32; LANES]; 3],
    /// Index in the scene; `u32::MAX` in lanes without a triangle, which come last.
    pub triangles: [u32; LANES],
    /// The binary nodes that it stands for.
    pub ranges: Ranges,
    /// Lanes with a triangle.
    pub count: u8,
}

impl Block {
    /// No triangles.
    pub const EMPTY: Self = Self {
        vertices: [[0; LANES]; 3],
        triangles: [u32::MAX; LANES],
        ranges: Ranges::NONE,
        count: 0,
    };
}

/// A node or (flagged) a block, which in a binary tree is a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Link(u32);

impl Link {
    const BLOCK: u32 = 1 << 31;
    /// The first node.
    pub const ROOT: Self = Self(0);

    /// A node by its number.
    #[must_use]
    pub const fn node(index: usize) -> Self {
        Self(index as u32)
    }

    /// A block by its number.
    #[must_use]
    pub const fn block(index: usize) -> Self {
        Self(index as u32 | Self::BLOCK)
    }

    /// It as a number.
    #[inline(always)]
    pub const fn bits(self) -> u32 {
        self.0
    }

    /// The reverse of [`Link::bits`].
    #[inline(always)]
    pub const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// Whether it leads to a block.
    #[inline(always)]
    pub const fn is_block(self) -> bool {
        self.0 & Self::BLOCK != 0
    }

    /// Whether it leads to a node below the root.
    #[inline(always)]
    pub fn is_inner(self) -> bool {
        !self.is_block() && self != Self::ROOT
    }

    /// Of the node or of the block.
    #[inline(always)]
    pub const fn index(self) -> usize {
        (self.0 & !Self::BLOCK) as usize
    }
}

/// The binary nodes that a node or block stands for, each a range of at least two neighbouring lanes.
///
/// The box of a range is the union of two that may overlap, of two or of four lanes:
/// as in a sparse table for range minima (Bender, Farach-Colton 2000).
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

    /// How many there are.
    #[inline(always)]
    pub const fn count(&self) -> usize {
        self.count as usize
    }

    /// The first lanes of both parts of each range. What comes after the last range means nothing.
    #[inline(always)]
    pub const fn places(&self) -> &[[u8; LANES]; 2] {
        &self.places
    }

    /// For each range a bit: whether its parts are of four lanes, not of two.
    #[inline(always)]
    pub const fn fours(&self) -> u8 {
        self.fours
    }

    /// Takes a range of at least two lanes.
    fn push(&mut self, first: u8, end: u8) {
        let is_long = end - first >= 4;
        let at = self.count();
        self.places[0][at] = first;
        self.places[1][at] = end - if is_long { 4 } else { 2 };
        self.fours |= u8::from(is_long) << at;
        self.count += 1;
    }
}
