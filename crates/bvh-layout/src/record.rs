//! The record that is handed over, and how to read it.

use crate::RecordError;
use std::ops::Range;

/// A tree's shape in breadth-first order: which nodes are leaves, and whose.
///
/// # Layout, version 1
///
/// One array of little-endian `u32` words, so that a device can read it as it is.
/// `n` leaves make `2n - 1` nodes (none if `n` is 0); let `B = ceil((2n - 1) / 32)`.
///
/// | words | holds |
/// |---|---|
/// | 0 | `0x4856_4241` ("ABVH") |
/// | 1 | layout version, 1 |
/// | 2 | triangles in the scene; leaves name triangles below it |
/// | 3 | `n`, leaves |
/// | 4 | `L`, levels; the root alone is level 0 |
/// | 5..8 | zero |
/// | `L` words | inner nodes on each level; level 0 has 1 node, level `d + 1` has twice the inner nodes of level `d` |
/// | `B` words | bit `i % 32` of word `i / 32` is 1 if node `i` is a leaf; bits past the last node are 0 |
/// | `B` words | for each word of bits, the leaves before it |
/// | `n` words | the triangle of each leaf, in node order |
///
/// The `k`-th inner node (from 0, in node order) has children `2k + 1` and `2k + 2`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Topology {
    pub(crate) words: Vec<u32>,
}

/// The nodes of one depth, as ranges into the node order and both lists.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Level {
    /// Nodes of this level.
    pub nodes: Range<u32>,
    /// Where this level's leaves lie in the leaf list.
    pub leaves: Range<u32>,
    /// Where this level's inner nodes lie in the inner list.
    pub inner: Range<u32>,
}

impl Topology {
    /// "ABVH" in little-endian order.
    pub const MAGIC: u32 = 0x4856_4241;
    /// The layout that this crate writes and reads.
    pub const VERSION: u32 = 1;
    /// Words before the level table.
    pub const HEADER_WORDS: usize = 8;

    /// Takes a record from elsewhere, checking every property it must have.
    ///
    /// # Errors
    /// See [`RecordError`]: each says what is wrong and where.
    pub fn from_words(words: Vec<u32>) -> Result<Self, RecordError> {
        crate::validate::validate(&words)?;
        Ok(Self { words })
    }

    /// The record, as it is handed over.
    #[must_use]
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Gives the record's memory back, to be filled again by [`crate::Converter`].
    #[must_use]
    pub fn into_words(self) -> Vec<u32> {
        self.words
    }

    /// Bytes handed over.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.words.len() * 4
    }

    /// Triangles in the scene, those left out of the tree included.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.words[2] as usize
    }

    /// Leaves: triangles in the tree.
    #[must_use]
    pub fn leaf_count(&self) -> usize {
        self.words[3] as usize
    }

    /// Nodes: twice the leaves less one, or none.
    #[must_use]
    pub fn node_count(&self) -> usize {
        (2 * self.leaf_count()).saturating_sub(1)
    }

    /// Levels, root first; none if the tree is empty.
    #[must_use]
    pub fn level_count(&self) -> usize {
        self.words[4] as usize
    }

    /// The ranges of every level, root first.
    pub fn levels(&self) -> impl Iterator<Item = Level> + '_ {
        let table = &self.words[Self::HEADER_WORDS..][..self.level_count()];
        let mut end = Level {
            nodes: 0..1,
            leaves: 0..0,
            inner: 0..0,
        };
        table.iter().map(move |&inner| {
            let nodes = end.nodes.clone();
            let level = Level {
                leaves: end.leaves.end..end.leaves.end + (nodes.len() as u32 - inner),
                inner: end.inner.end..end.inner.end + inner,
                nodes: nodes.clone(),
            };
            end = Level {
                nodes: nodes.end..nodes.end + 2 * inner,
                ..level.clone()
            };
            level
        })
    }

    /// One bit a node: 1 for a leaf.
    #[must_use]
    pub fn leaf_bits(&self) -> &[u32] {
        let start = Self::HEADER_WORDS + self.level_count();
        &self.words[start..][..self.bit_words()]
    }

    /// For each word of [`Topology::leaf_bits`], the leaves before it.
    #[must_use]
    pub fn leaf_ranks(&self) -> &[u32] {
        let start = Self::HEADER_WORDS + self.level_count() + self.bit_words();
        &self.words[start..][..self.bit_words()]
    }

    /// The triangle of each leaf, in node order.
    #[must_use]
    pub fn leaf_triangles(&self) -> &[u32] {
        &self.words[self.words.len() - self.leaf_count()..]
    }

    fn bit_words(&self) -> usize {
        self.node_count().div_ceil(32)
    }
}
