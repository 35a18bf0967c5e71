//! The tree divided into treelets. A workgroup can refit one treelet in its own memory.

mod cut;
mod fill;
mod wide;

use crate::{Converter, Moving};
use bvh_build::{BinaryTree, MAX_DEPTH};
use bytemuck::{Pod, Zeroable};
use cut::Cut;
use geom::StaticParts;
use std::ops::Range;
use std::sync::atomic::AtomicU32;

/// A tree in depth-first leaf order, divided into treelets.
///
/// Two triangles under one parent share a leaf of the encoded tree. Names such as `leaf_count` and [`Treelets::LEAVES`]
/// still count each triangle as a leaf.
///
/// A *treelet* is a run of at most 256 neighbouring triangles that consists of whole subtrees. In large trees it has
/// several small subtrees, so that treelets are full. In other trees, subtrees are as few and as large as possible. The
/// subtrees are the leaves of the tree above, which is divided in the same way, until one root is left. A million
/// triangles take about three levels.
///
/// All roots of a treelet are leaves of one treelet of the next level, its *parent*. So a device can refit one level of
/// treelets per dispatch, each in the memory of one workgroup. Or one dispatch refits all levels: the last workgroup to
/// finish a child continues with the parent.
///
/// # Layout
///
/// Little-endian `u32` words: `T` treelets, `R` roots, `n` triangles, `I` inner nodes.
///
/// | words | content |
/// |---|---|
/// | `12 T` | treelets, level by level from the triangles up; see [`Treelet`] |
/// | `R` | roots, treelet by treelet: a reference each |
/// | `n` | triangles, depth first; bit 31 is 1 if the next one shares the leaf |
/// | `I` | inner nodes, treelet by treelet, by height |
///
/// A *reference* has 9 bits and selects a node of the same treelet. If bit 8 is 0, the low bits are the number of an
/// inner node. If bit 8 is 1, they are the number of a leaf, counted within the treelet. On the lowest level, this is
/// the number of the leaf's first triangle. On higher levels, it is the number of a root of the level below. Inner
/// nodes are numbered in preorder, subtree by subtree.
///
/// An inner node's *height* is the number of inner nodes on the longest path down from it, including itself. Its word
/// holds the left child's reference, the right child's from bit 9, its own number from bit 18, and its height less one
/// from bit 26. Words are sorted by height, so that a workgroup processes one height at a time.
///
/// # Node memory on a device
///
/// Rows of 16 bytes. Inner nodes are counted from 0, treelet by treelet in the order of their numbers. Inner node `i`
/// has four rows from row `4 (i + 1)`, two for the box of each child. Roots have two rows each, after the last inner
/// node, level by level. The last root, which is that of the whole tree, has rows 0 and 1.
///
/// # Size
///
/// `4 n` bytes for triangles, 4 for each inner node (about `0.6 n`, as most leaves are shared) and 48 for each treelet:
/// about 6.6 bytes per triangle.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Treelets {
    pub(crate) words: Vec<u32>,
    /// Range of treelets of each level, the level of the triangles first.
    pub levels: Vec<Range<u32>>,
    /// Number of triangles.
    pub leaf_count: u32,
    /// Number of inner nodes.
    pub inner_count: u32,
    /// Number of roots of all treelets.
    pub root_count: u32,
    /// Treelets to refit when the scene moves; `None` for all.
    pub moving: Option<Moving>,
    /// The same tree with up to 32 children per node, if it has that form.
    pub wide: Option<WideTree>,
}

/// The same tree with up to 32 children per node, over blocks of up to 32 neighbouring triangles. It serves traversals
/// in which each invocation of a subgroup tests one child. It has no boxes, only references to those of the binary
/// nodes.
///
/// # Layout
///
/// Little-endian `u32` words. The children of all nodes, level by level, are its *lanes*, those of the root first. The
/// first half of the words holds the row of each lane's box, the second half each lane's target. If bit 31 of a target
/// is 1, it is a block's range of triangles in depth-first order, otherwise a node's range of lanes. The low 6 bits are
/// the length of the range, and the bits from bit 6 its first element.
///
/// # Size
///
/// 8 bytes per lane: about half a byte per triangle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WideTree {
    /// Words to upload.
    pub words: Vec<u32>,
    /// Number of lanes of all nodes.
    pub lanes: usize,
    /// The root, in the format of a lane's target.
    pub root: u32,
}

impl WideTree {
    /// Maximum number of children of a node, and of triangles of a block.
    pub const LANES: usize = 32;
    /// Maximum number of levels of nodes.
    pub const MOST_LEVELS: usize = 16;
    /// Maximum number of triangles. Larger trees have no wide form, because it does not make their traversal faster.
    pub const MOST_TRIANGLES: usize = 1 << 20;
    const BLOCK: u32 = 1 << 31;
    const FIRST_AT: u32 = 6;
}

/// A treelet's entry in the table: twelve words, in field order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Treelet {
    /// First triangle in depth-first order. On higher levels, row of the first root that is a leaf of this treelet.
    pub first_leaf: u32,
    /// Number of triangles. On higher levels, number of roots that are leaves of this treelet.
    pub leaf_count: u32,
    /// Word index of the first inner node.
    pub inner_at: u32,
    /// Number of inner nodes.
    pub inner_count: u32,
    /// Row of the first inner node.
    pub inner_row: u32,
    /// Word index of the first root.
    pub roots_at: u32,
    /// Number of roots.
    pub root_count: u32,
    /// Row of the first root.
    pub root_row: u32,
    /// Maximum height of the inner nodes; 0 without inner nodes.
    pub height: u32,
    /// Treelet of the next level whose leaves include this treelet's roots; [`Treelet::NONE`] for the last treelet.
    pub parent: u32,
    /// Number of treelets whose parent is this one.
    pub children: u32,
    /// Number of `children` that are listed as moving.
    pub moving_children: u32,
}

impl Treelets {
    /// Maximum number of leaves of a treelet: triangles, or on higher levels roots of the level below.
    pub const LEAVES: usize = 256;
    /// Flag in a triangle's word: the next triangle shares its leaf.
    pub const SHARED: u32 = 1 << 31;
    /// Number of words of a treelet's entry.
    pub const ENTRY_WORDS: usize = size_of::<Treelet>() / 4;

    /// Creates the treelets of a binary tree, in the rayon pool that the caller installed.
    ///
    /// # Panics
    /// If the tree is deeper than [`MAX_DEPTH`].
    #[must_use]
    pub fn of(tree: &BinaryTree) -> Self {
        let is_deep = tree.depth(MAX_DEPTH) > MAX_DEPTH;
        assert!(!is_deep, "the tree is deeper than {MAX_DEPTH}");
        Self::of_in(tree, &mut Converter::default(), Vec::new())
    }

    /// Creates the treelets of a binary tree, reusing the memory of `scratch` and of `words`.
    pub(crate) fn of_in(tree: &BinaryTree, scratch: &mut Converter, words: Vec<u32>) -> Self {
        if tree.leaf_count() == 0 {
            return Self::default();
        }
        let cuts = Cut::all(tree);
        let is_wide = tree.leaf_count() <= WideTree::MOST_TRIANGLES;
        let nodes = if is_wide { tree.leaf_count() - 1 } else { 0 };
        scratch.places.resize_with(nodes, AtomicU32::default);
        let mut made = fill::fill(tree, &cuts, &mut scratch.inner, words, &scratch.places);
        if is_wide {
            made.wide = WideTree::of(tree, &made, &scratch.places);
        }
        made
    }

    /// Returns the words, without lists and wide form.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Adds lists of the moving treelets, unless more than half move. Runs in parallel.
    ///
    /// # Panics
    /// If `parts` lacks a triangle of the tree.
    #[must_use]
    pub fn with_moving(mut self, parts: &StaticParts) -> Self {
        self.moving = Moving::of(&self, parts);
        let listed = self.moving.iter().flat_map(|m| &m.words);
        let parents = listed.map(|&number| self.treelet(number as usize).parent);
        let parents: Vec<_> = parents.filter(|&p| p != Treelet::NONE).collect();
        for parent in parents {
            self.entry_mut(parent).moving_children += 1;
        }
        self
    }

    fn entry_mut(&mut self, number: u32) -> &mut Treelet {
        let at = number as usize * Self::ENTRY_WORDS;
        let entry = &mut self.words[at..][..Self::ENTRY_WORDS];
        &mut bytemuck::cast_slice_mut(entry)[0]
    }

    /// Returns everything to upload, in this order: the words, the lists of moving treelets, the wide form.
    pub fn parts(&self) -> [&[u32]; 3] {
        let lists = self.moving.as_ref().map_or(&[][..], |m| &m.words);
        let wide = self.wide.as_ref().map_or(&[][..], |w| &w.words);
        [&self.words, lists, wide]
    }

    /// Returns the size in bytes of all [`Treelets::parts`].
    pub fn bytes(&self) -> usize {
        self.parts().iter().map(|part| size_of_val(*part)).sum()
    }

    /// Returns the number of treelets of all levels.
    pub fn treelet_count(&self) -> usize {
        self.levels.last().map_or(0, |level| level.end as usize)
    }

    /// Returns the entry of treelet `number`. Panics if there is no such treelet.
    pub fn treelet(&self, number: usize) -> Treelet {
        assert!(number < self.treelet_count(), "no treelet {number}");
        let entry = &self.words[number * Self::ENTRY_WORDS..][..Self::ENTRY_WORDS];
        bytemuck::cast_slice(entry)[0]
    }

    /// Finds the lowest level that has at most `most` roots. Returns the row of its first root and its number of
    /// roots. Returns the root of the whole tree if there is no such level. The roots of a level cover every triangle.
    pub fn few_roots(&self, most: u32) -> (u32, u32) {
        let roots = self.levels.iter().map(|level| {
            let each = level.clone().map(|t| self.treelet(t as usize).root_count);
            let first = self.treelet(level.start as usize).root_row;
            (first, each.sum())
        });
        let mut few = roots.filter(|&(_, count)| count <= most);
        few.next().unwrap_or((0, 1))
    }

    /// Returns the triangles of a treelet of the lowest level, including the [`Treelets::SHARED`] flags.
    pub(crate) fn triangles(&self, number: usize) -> &[u32] {
        let entry = self.treelet(number);
        let at = self.triangles_at() + entry.first_leaf as usize;
        &self.words[at..][..entry.leaf_count as usize]
    }

    /// Returns the word index of the first triangle.
    pub fn triangles_at(&self) -> usize {
        self.words.len() - (self.inner_count + self.leaf_count) as usize
    }

    /// Returns the number of 16-byte rows that the nodes take on a device.
    pub fn rows(&self) -> usize {
        let other_roots = (self.root_count as usize).saturating_sub(1);
        4 * (1 + self.inner_count as usize) + 2 * other_roots
    }
}

impl Treelet {
    /// Marks the last treelet, which has no parent.
    pub const NONE: u32 = u32::MAX;
}
