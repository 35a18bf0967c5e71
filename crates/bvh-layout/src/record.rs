//! The record that is handed over, and how to read it.

use crate::validate::{Header, validate};
use crate::{BlockTree, First, Moving, RecordError, Spare, Treelets};
use geom::{Aabb, StaticParts};
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

/// Inner nodes that one task handles.
const RUN: usize = 2048;
/// Words of bits that one task unpacks.
const TASK: usize = 1 << 9;

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
///
/// # What it costs
///
/// `8 + L + 2 * ceil((2n - 1) / 32) + n` words: `n` triangles take `4.5 n + 4 L + 36` bytes or a little more, which is
/// 4.5 bytes a triangle in the limit and at most 8 from 100 triangles on. Two nodes of 32 bytes a triangle (a box and
/// two indices each) take 64: the paper's cut of 87.5 % is 8 of 64, this record's is 93 %.
///
/// Beside the record may stand lists of what moves, for scenes with static parts; whoever adopts the tree may use them
/// or not. See [`Moving`]. So may the same tree as [`Treelets`] or as a [`BlockTree`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topology {
    pub(crate) words: Vec<u32>,
    pub(crate) moving: Option<Moving>,
    /// The same tree once more, if somebody asked for it.
    pub(crate) treelets: Option<Box<Treelets>>,
    /// Likewise; shared, since whoever adopts the tree goes on using them.
    pub(crate) blocks: Option<Arc<BlockTree>>,
}

impl Topology {
    /// "ABVH" in little-endian order.
    pub const MAGIC: u32 = 0x4856_4241;
    /// The layout that this crate writes and reads.
    pub const VERSION: u32 = 1;
    /// Words before the level table.
    pub const HEADER_WORDS: usize = 8;

    /// Takes a record from elsewhere, checking every property it must have. The error says what is wrong and where.
    pub fn from_words(words: Vec<u32>) -> Result<Self, RecordError> {
        validate(&words)?;
        Ok(Self::of_words(words))
    }

    /// A record alone.
    pub(crate) fn of_words(words: Vec<u32>) -> Self {
        Self {
            words,
            moving: None,
            treelets: None,
            blocks: None,
        }
    }

    /// The record, as it is handed over.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// The same tree with lists of what moves, where they pay; in parallel.
    /// If it comes with treelets, those are listed and not its nodes.
    ///
    /// # Panics
    /// If `parts` are not those of the tree's scene.
    #[must_use]
    pub fn with_moving(mut self, parts: &StaticParts) -> Self {
        match self.treelets.take() {
            Some(treelets) => {
                assert_eq!(parts.triangles.len(), self.triangle_count());
                self.treelets = Some(Box::new(treelets.with_moving(parts)));
            }
            None => self.moving = Moving::of(&self, parts),
        }
        self
    }

    /// Which nodes must be done again when the scene moves; `None` if all of them,
    /// or if treelets are listed: see [`Treelets::moving`].
    pub fn moving(&self) -> Option<&Moving> {
        self.moving.as_ref()
    }

    /// Gives the record's memory back, to be filled again by [`crate::Converter`].
    pub fn into_spare(self) -> Spare {
        Spare {
            words: self.words,
            treelets: self.treelets.map_or_else(Vec::new, |t| t.words),
        }
    }

    /// The same tree as treelets, if they were made; they do not travel with the words.
    pub fn treelets(&self) -> Option<&Treelets> {
        self.treelets.as_deref()
    }

    /// The treelets that the tree came with, or else made now ([`Treelets::of`]), with lists if the tree has lists.
    ///
    /// # Panics
    /// If `parts` are not those of the tree's scene.
    pub fn to_treelets(&self, parts: &StaticParts) -> Cow<'_, Treelets> {
        match (self.treelets(), &self.moving) {
            (Some(treelets), _) => Cow::Borrowed(treelets),
            (None, None) => Cow::Owned(Treelets::of(self)),
            (None, Some(_)) => Cow::Owned(Treelets::of(self).with_moving(parts)),
        }
    }

    /// The same tree with its eight-wide form, for a scene of these triangles; in parallel. See [`BlockTree::of`].
    ///
    /// # Panics
    /// If the record is not one of these triangles.
    pub fn with_blocks(self, triangles: &[[u32; 3]], by: (&[Aabb], First)) -> Self {
        let blocks = Some(Arc::new(BlockTree::of(&self, triangles, by)));
        Self { blocks, ..self }
    }

    /// The same tree in its eight-wide form, if it was made; it does not travel with the words.
    pub fn blocks(&self) -> Option<&Arc<BlockTree>> {
        self.blocks.as_ref()
    }

    /// Becomes `other` without what may stand beside the record, and keeps its own memory.
    pub fn copy_record(&mut self, other: &Self) {
        let mut words = std::mem::take(&mut self.words);
        words.clear();
        words.extend_from_slice(&other.words);
        *self = Self::of_words(words);
    }

    /// Bytes handed over: the record, and lists of what moves.
    pub fn bytes(&self) -> usize {
        let lists = self.moving.as_ref().map_or(0, |m| m.words.len());
        (self.words.len() + lists) * 4
    }

    /// Bytes that go to a device: the treelets', where there are some.
    pub fn upload_bytes(&self) -> usize {
        self.treelets().map_or(self.bytes(), Treelets::bytes)
    }

    /// Triangles in the scene, those left out of the tree included.
    pub fn triangle_count(&self) -> usize {
        self.words[2] as usize
    }

    /// Leaves: triangles in the tree.
    pub fn leaf_count(&self) -> usize {
        self.words[3] as usize
    }

    /// Nodes: twice the leaves less one, or none.
    pub fn node_count(&self) -> usize {
        (2 * self.leaf_count()).saturating_sub(1)
    }

    /// Levels, root first; none if the tree is empty.
    pub fn level_count(&self) -> usize {
        self.words[4] as usize
    }

    /// The inner nodes of every level by rank, root first; the last level has none.
    pub fn levels(&self) -> impl Iterator<Item = Range<u32>> + '_ {
        let table = &self.words[Self::HEADER_WORDS..][..self.level_count()];
        table.iter().scan(0, |end, &inner| {
            *end += inner;
            Some(*end - inner..*end)
        })
    }

    /// One bit a node: 1 for a leaf.
    pub fn leaf_bits(&self) -> &[u32] {
        self.ranks().bits
    }

    /// The triangle of each leaf, in node order.
    pub fn leaf_triangles(&self) -> &[u32] {
        &self.words[self.words.len() - self.leaf_count()..]
    }

    /// Both children of the `k`-th inner node.
    #[must_use]
    #[inline]
    pub fn children_of_inner(k: u32) -> [u32; 2] {
        [2 * k + 1, 2 * k + 2]
    }

    /// Finds the ranks of nodes.
    pub fn ranks(&self) -> NodeRanks<'_> {
        let count = self.node_count().div_ceil(32);
        let words = &self.words[Self::HEADER_WORDS + self.level_count()..];
        let (bits, ranks) = words[..2 * count].split_at(count);
        NodeRanks { bits, ranks }
    }

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
            let part = rest.split_off_mut(..ones);
            tasks.push((first, bits, part.expect("a node for each leaf")));
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

    /// A value for every inner node, made of its children's from the deepest level up, in parallel; `leaf` gives a
    /// leaf's by its rank, and `none` is overwritten.
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

/// A node by its rank among its kind: leaves by their place in [`Topology::leaf_triangles`], or inner nodes in node order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeRank(u32);

impl NodeRank {
    const LEAF: u32 = 1 << 31;

    /// The inner node of that rank.
    #[inline]
    pub(crate) fn inner(rank: usize) -> Self {
        Self(rank as u32)
    }

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
    /// The rank of a node, which must be there.
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

/// The record of no triangle.
impl Default for Topology {
    fn default() -> Self {
        Self::of_words(Header::default().words().to_vec())
    }
}

#[cfg(test)]
mod tests {
    use super::TASK;
    use crate::tests::{chain, random_tree, record, shapes};

    #[test]
    fn a_triangle_takes_at_most_8_bytes_and_about_4_and_a_half() {
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
