//! The topology record and its accessors.

use crate::validate::{Header, validate};
use crate::{BlockTree, CollapseOptions, Spare, TopologyError, Treelets};
use geom::StaticParts;
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

/// Minimum number of inner nodes per task.
const RUN: usize = 2048;

/// A tree's shape in breadth-first order: which nodes are leaves, and the triangle of each leaf.
///
/// # Layout, version 1
///
/// One array of little-endian `u32` words, which a device can read unchanged.
/// `n` leaves make `2n - 1` nodes (0 if `n` is 0); let `B = ceil((2n - 1) / 32)`.
///
/// | words | content |
/// |---|---|
/// | 0 | `0x4856_4241` ("ABVH") |
/// | 1 | layout version, 1 |
/// | 2 | number of triangles in the scene; the triangle indices of leaves are smaller |
/// | 3 | `n`, number of leaves |
/// | 4 | `L`, number of levels; level 0 is the root |
/// | 5..8 | zero |
/// | `L` words | number of inner nodes on each level; level `d + 1` has two nodes for each inner node of level `d` |
/// | `B` words | bit `i % 32` of word `i / 32` is 1 if node `i` is a leaf; bits past the last node are 0 |
/// | `B` words | for each word of bits, the number of leaves before it |
/// | `n` words | the triangle index of each leaf, in node order |
///
/// The `k`-th inner node (from 0, in node order) has children `2k + 1` and `2k + 2`.
///
/// # Size
///
/// `8 + L + 2 * ceil((2n - 1) / 32) + n` words. `n` triangles take about `4.5 n + 4 L + 36` bytes: 4.5 bytes per
/// triangle in the limit, and at most 8 from 100 triangles on. Two nodes of 32 bytes per triangle (a box and two
/// indices each) take 64. The record of Kim and others (2014) takes 8 bytes and saves 87.5 %. This record saves 93 %.
///
/// # Optional parts
///
/// The same tree as [`Treelets`] or as a [`BlockTree`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topology {
    pub(crate) words: Vec<u32>,
    /// The same tree as treelets, if requested.
    pub(crate) treelets: Option<Box<Treelets>>,
    /// The same tree as wide nodes and blocks, if requested. Shared with the backend that traces the tree.
    pub(crate) blocks: Option<Arc<BlockTree>>,
}

impl Topology {
    /// "ABVH" in little-endian order.
    pub const MAGIC: u32 = 0x4856_4241;
    /// Layout version that this crate writes and reads.
    pub const VERSION: u32 = 1;
    /// Number of words before the level table.
    pub const HEADER_WORDS: usize = 8;

    /// Validates the words of a record from another source. The error names an invalid word or property.
    pub fn from_words(words: Vec<u32>) -> Result<Self, TopologyError> {
        validate(&words)?;
        Ok(Self::of_words(words))
    }

    /// Creates a record without optional parts.
    pub(crate) fn of_words(words: Vec<u32>) -> Self {
        Self {
            words,
            treelets: None,
            blocks: None,
        }
    }

    /// Returns the words of the record.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Adds lists of the moving treelets ([`Treelets::moving`]), and the treelets if they are missing. Runs in parallel.
    /// Adds no lists if more than half would be listed.
    ///
    /// # Panics
    /// If `parts` does not belong to the tree's scene.
    #[must_use]
    pub fn with_moving(mut self, parts: &StaticParts) -> Self {
        assert_eq!(parts.triangles.len(), self.triangle_count());
        let treelets = match self.treelets.take() {
            Some(treelets) => *treelets,
            None => Treelets::of(&self),
        };
        self.treelets = Some(Box::new(treelets.with_moving(parts)));
        self
    }

    /// Returns the record's memory for reuse by [`crate::Converter`].
    pub fn into_spare(self) -> Spare {
        Spare {
            words: self.words,
            treelets: self.treelets.map_or_else(Vec::new, |t| t.words),
        }
    }

    /// Returns the tree's treelets, if it has them. They are not part of [`Topology::words`].
    pub fn treelets(&self) -> Option<&Treelets> {
        self.treelets.as_deref()
    }

    /// Returns the tree's treelets, or creates them ([`Treelets::of`]).
    pub fn to_treelets(&self) -> Cow<'_, Treelets> {
        match self.treelets() {
            Some(treelets) => Cow::Borrowed(treelets),
            None => Cow::Owned(Treelets::of(self)),
        }
    }

    /// Adds the tree's eight-wide form, in parallel. See [`BlockTree::of`] for the parameters.
    ///
    /// # Panics
    /// If the record does not belong to a scene of these triangles.
    pub fn with_blocks(self, triangles: &[[u32; 3]], options: CollapseOptions<'_>) -> Self {
        let blocks = Some(Arc::new(BlockTree::of(&self, triangles, options)));
        Self { blocks, ..self }
    }

    /// Returns the tree's eight-wide form, if it has one. It is not part of [`Topology::words`].
    pub fn blocks(&self) -> Option<&Arc<BlockTree>> {
        self.blocks.as_ref()
    }

    /// Copies the words of `other`, without its optional parts, into this record's memory.
    pub fn copy_words_from(&mut self, other: &Self) {
        let mut words = std::mem::take(&mut self.words);
        words.clear();
        words.extend_from_slice(&other.words);
        *self = Self::of_words(words);
    }

    /// Returns the size in bytes of the record.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.words[..])
    }

    /// Returns the number of bytes to upload: those of the treelets if present, otherwise [`Topology::bytes`].
    pub fn upload_bytes(&self) -> usize {
        self.treelets().map_or(self.bytes(), Treelets::bytes)
    }

    /// Returns the number of triangles in the scene, including those that are not in the tree.
    pub fn triangle_count(&self) -> usize {
        self.words[2] as usize
    }

    /// Returns the number of leaves, which is the number of triangles in the tree.
    pub fn leaf_count(&self) -> usize {
        self.words[3] as usize
    }

    /// Returns the number of nodes: `2 * leaf_count() - 1`, or 0 for an empty tree.
    pub fn node_count(&self) -> usize {
        (2 * self.leaf_count()).saturating_sub(1)
    }

    /// Returns the number of levels, 0 if the tree is empty.
    pub fn level_count(&self) -> usize {
        self.words[4] as usize
    }

    /// Returns the ranks of the inner nodes of every level, root first. The last level has none.
    pub fn levels(&self) -> impl Iterator<Item = Range<u32>> + '_ {
        let table = &self.words[Self::HEADER_WORDS..][..self.level_count()];
        table.iter().scan(0, |end, &inner| {
            *end += inner;
            Some(*end - inner..*end)
        })
    }

    /// Returns the triangle index of each leaf, in node order.
    pub fn leaf_triangles(&self) -> &[u32] {
        &self.words[self.words.len() - self.leaf_count()..]
    }

    /// Returns both children of the `k`-th inner node.
    #[must_use]
    #[inline]
    pub fn children_of_inner(k: u32) -> [u32; 2] {
        [2 * k + 1, 2 * k + 2]
    }

    /// Returns the rank directory of the nodes.
    pub fn ranks(&self) -> NodeRanks<'_> {
        let count = self.node_count().div_ceil(32);
        let words = &self.words[Self::HEADER_WORDS + self.level_count()..];
        let (bits, ranks) = words[..2 * count].split_at(count);
        NodeRanks { bits, ranks }
    }

    /// Computes a value for every inner node from its children's values, level by level from the deepest, in parallel.
    /// `leaf` returns the value of a leaf by its rank. `none` is a placeholder that is overwritten.
    pub(crate) fn bottom_up<T: Copy + Send + Sync>(
        &self,
        none: T,
        leaf: impl Fn(u32) -> T + Sync,
        join: impl Fn(T, T) -> T + Sync,
    ) -> Vec<T> {
        let mut all = Vec::new();
        let inner = self.leaf_count().saturating_sub(1);
        let unset = rayon::iter::repeat_n(none, inner).with_min_len(32 * RUN);
        unset.collect_into_vec(&mut all);
        let ranks = self.ranks();
        let levels: Vec<_> = self.levels().collect();
        for level in levels.iter().rev() {
            let [start, end] = [level.start, level.end].map(|i| i as usize);
            let (upper, deeper) = all.split_at_mut(end);
            let value = |node: NodeRank| match node.leaf() {
                Some(rank) => leaf(rank),
                None => deeper[node.rank() as usize - end],
            };
            let nodes = upper[start..].par_iter_mut().enumerate();
            nodes.with_min_len(RUN).for_each(|(i, to)| {
                let [a, b] = Self::children_of_inner((start + i) as u32);
                *to = join(value(ranks.of(a)), value(ranks.of(b)));
            });
        }
        all
    }
}

/// A node by its rank among leaves or among inner nodes, in node order. A leaf's rank indexes
/// [`Topology::leaf_triangles`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeRank(u32);

impl NodeRank {
    const LEAF: u32 = 1 << 31;

    /// Returns the inner node of rank `rank`.
    #[inline]
    pub(crate) fn inner(rank: usize) -> Self {
        Self(rank as u32)
    }

    /// Returns a leaf's rank; `None` for an inner node.
    #[inline]
    pub fn leaf(self) -> Option<u32> {
        (self.0 & Self::LEAF != 0).then_some(self.0 & !Self::LEAF)
    }

    /// Returns the rank among leaves or among inner nodes.
    #[inline]
    pub fn rank(self) -> u32 {
        self.0 & !Self::LEAF
    }
}

/// Maps nodes to their ranks among leaves or inner nodes, by a rank directory (Jacobson 1989).
#[derive(Clone, Copy, Debug)]
pub struct NodeRanks<'a> {
    pub(crate) bits: &'a [u32],
    pub(crate) ranks: &'a [u32],
}

impl NodeRanks<'_> {
    /// Returns the rank of `node`, which must be below [`Topology::node_count`].
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

    /// Returns both children of an inner node.
    #[inline]
    pub fn children(self, inner: NodeRank) -> [NodeRank; 2] {
        Topology::children_of_inner(inner.0).map(|node| self.of(node))
    }
}

/// Creates the record of an empty scene.
impl Default for Topology {
    fn default() -> Self {
        Self::of_words(Header::default().words().to_vec())
    }
}

#[cfg(test)]
mod tests {
    use crate::tests::{chain, random_tree, record};

    #[test]
    fn topology_bytes_per_triangle_are_bounded() {
        for leaves in [100, 101, 1_000, 30_000] {
            let record = record(&random_tree(leaves, leaves as u64));
            assert!(record.bytes() <= 8 * leaves, "{leaves}: {}", record.bytes());
        }
        let deepest = record(&chain(100));
        assert_eq!(deepest.level_count(), 65);
        assert!(deepest.bytes() <= 800, "{}", deepest.bytes());
        let bytes = record(&random_tree(200_000, 1)).bytes() as f64 / 200_000.0;
        assert!((4.5..4.502).contains(&bytes), "{bytes}");
    }
}
