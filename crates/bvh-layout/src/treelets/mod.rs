//! The tree once more, cut into treelets that a workgroup can refit in its own memory.

mod cut;
mod fill;
mod wide;

use crate::{Moving, Topology};
use bvh_build::BinaryTree;
use bytemuck::{Pod, Zeroable};
use cut::Cut;
pub(crate) use cut::depth_first;
use geom::StaticParts;
use std::ops::Range;
use std::sync::atomic::AtomicU32;

/// A tree in depth-first leaf order, cut into treelets.
///
/// Two triangles under one parent share a leaf. A *treelet* is a run of at most 256 neighbouring triangles that holds
/// whole subtrees; of large trees several, so that treelets are full, of others as few and as large as may be. What
/// lies above those subtrees is a tree again, whose leaves they are, and is cut the same way, until one root is left:
/// some three levels for a million triangles. All roots of a treelet stand below one treelet of the next level, its
/// *parent*. So a device refits a level of treelets in one dispatch, each in the memory of one workgroup; or all of
/// them, where the workgroup that comes last to a parent goes on with it.
///
/// # Layout
///
/// Little-endian `u32` words: `T` treelets, `R` roots, `n` triangles, `I` inner nodes.
///
/// | words | holds |
/// |---|---|
/// | `12 T` | treelets, level by level from the triangles up; see [`Treelet`] |
/// | `R` | roots, treelet by treelet: a reference each |
/// | `n` | triangles, depth first; bit 31 is 1 if the next one shares the leaf |
/// | `I` | inner nodes, treelet by treelet, by height |
///
/// A *reference* has 9 bits and names a node of the same treelet: the inner node of that number, or with bit 8 the leaf
/// that begins with the triangle (on higher levels: with the root of the level below) of that number. Inner nodes are
/// numbered in preorder, subtree by subtree. An inner node's word is the left child's reference, the right one's from
/// bit 9, its own number from bit 18, and from bit 26 how many inner nodes lie at most below it, one below the other: 0
/// if both children are leaves. They stand in the order of their heights, so that a device's vectors make one height at
/// a time.
///
/// # Where a device keeps the nodes
///
/// In rows of 16 bytes: inner node `i` (of all by their numbers, treelet by treelet, from 0) has the rows `4 (i + 1) ..`, two
/// for the box of each child. Roots have two rows each, after the last inner node, level by
/// level; that of the whole tree, which is the last, has rows 0 and 1.
///
/// # What it costs
///
/// `4 n` bytes, 4 for each inner node (`0.6 n` or so, as most leaves are shared), 48 a treelet:
/// about 6.6 bytes a triangle.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Treelets {
    pub(crate) words: Vec<u32>,
    /// The numbers of each level's treelets, the level of the triangles first.
    pub levels: Vec<Range<u32>>,
    /// Triangles.
    pub leaf_count: u32,
    /// Inner nodes.
    pub inner_count: u32,
    /// Roots of all treelets.
    pub root_count: u32,
    /// What must be done again when the scene moves; `None` if all of it.
    pub moving: Option<Moving>,
    /// The same tree with 32 children a node, if it has that form.
    pub wide: Option<WideTree>,
}

/// The same tree with up to 32 children a node, over blocks of up to 32 neighbouring triangles, for searches in which
/// each invocation of a subgroup asks one child: names only, since the boxes are those of the binary nodes.
///
/// # Layout
///
/// Little-endian `u32` words. The children of all nodes, level by level, are its *lanes*: for each lane the row of the
/// child's box, then for each where it leads: to a node's lanes or, with bit 31, to a block's triangles in depth-first
/// order. The first of these begins at bit 6, below that stands how many there are. The root's lanes come first.
///
/// # What it costs
///
/// 8 bytes a lane: half a byte a triangle or so.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WideTree {
    /// What is handed over.
    pub words: Vec<u32>,
    /// Lanes of all nodes.
    pub lanes: usize,
    /// Where a lane would lead that leads to the root.
    pub root: u32,
}

impl WideTree {
    /// Children of a node, and triangles of a block, at most.
    pub const LANES: usize = 32;
    /// Levels of nodes, at most.
    pub const MOST_LEVELS: usize = 16;
    /// Trees of more triangles have no such form: what it serves does not pay there.
    pub const MOST_TRIANGLES: usize = 1 << 20;
    const BLOCK: u32 = 1 << 31;
    const FIRST_AT: u32 = 6;
}

/// Memory that treelets are made in: a word a triangle, and another where they are made wide.
#[derive(Debug, Default)]
pub(crate) struct Workspace {
    pub(crate) inner: Vec<u32>,
    pub(crate) places: Vec<AtomicU32>,
}

/// A treelet's entry in the table: twelve words, in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Treelet {
    /// Its first triangle in depth-first order; on higher levels the row of the first root that it stands on.
    pub first_leaf: u32,
    /// Its triangles, or the roots that it stands on.
    pub leaf_count: u32,
    /// The word of its first inner node.
    pub inner_at: u32,
    /// Its inner nodes.
    pub inner_count: u32,
    /// The row of its first inner node.
    pub inner_row: u32,
    /// The word of its first root.
    pub roots_at: u32,
    /// Its roots.
    pub root_count: u32,
    /// The row of its first root.
    pub root_row: u32,
    /// The greatest height among its inner nodes; 0 if there is none.
    pub height: u32,
    /// The treelet of the next level that stands on its roots; [`Treelet::NONE`] for the last.
    pub parent: u32,
    /// How many treelets have this one as their parent.
    pub children: u32,
    /// How many of them are listed as moving.
    pub moving_children: u32,
}

impl Treelets {
    /// Triangles that a treelet may hold, and roots of the level below that one on a higher level may stand on.
    pub const LEAVES: usize = 256;
    /// Set in a triangle's word if the next triangle shares its leaf.
    pub const SHARED: u32 = 1 << 31;
    /// Words of a treelet's entry.
    pub const ENTRY_WORDS: usize = size_of::<Treelet>() / 4;

    /// The same tree as a record's.
    ///
    /// One thread, about 40 ns a triangle: whoever has the binary tree asks for
    /// [`crate::Converter::convert_with_treelets`] instead.
    #[must_use]
    pub fn of(topology: &Topology) -> Self {
        Self::of_tree(&depth_first(topology))
    }

    /// Of a binary tree; in parallel, in the rayon pool that the caller installed.
    #[must_use]
    pub fn of_tree(tree: &BinaryTree) -> Self {
        Self::of_tree_in(tree, &mut Workspace::default(), Vec::new())
    }

    /// Likewise, in the memory of old ones' words; `room` is for whoever makes several.
    pub(crate) fn of_tree_in(tree: &BinaryTree, room: &mut Workspace, words: Vec<u32>) -> Self {
        if tree.leaf_count() == 0 {
            return Self::default();
        }
        let cuts = Cut::all(tree);
        let is_wide = tree.leaf_count() <= WideTree::MOST_TRIANGLES;
        let nodes = if is_wide { tree.leaf_count() - 1 } else { 0 };
        room.places.resize_with(nodes, AtomicU32::default);
        let mut made = fill::fill(tree, &cuts, &mut room.inner, words, &room.places);
        if is_wide {
            made.wide = WideTree::of(tree, &made, &room.places);
        }
        made
    }

    /// What is handed over.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// The same treelets with lists of those that move, where they pay; in parallel.
    ///
    /// # Panics
    /// If `parts` are of a scene that has not all the triangles.
    #[must_use]
    pub fn with_moving(mut self, parts: &StaticParts) -> Self {
        self.moving = Moving::of_treelets(&self, parts);
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

    /// All that is handed over, in this order: the words, lists of what moves, the wide tree.
    pub fn parts(&self) -> [&[u32]; 3] {
        let lists = self.moving.as_ref().map_or(&[][..], |m| &m.words);
        let wide = self.wide.as_ref().map_or(&[][..], |w| &w.words);
        [&self.words, lists, wide]
    }

    /// Bytes handed over.
    pub fn bytes(&self) -> usize {
        self.parts().iter().map(|part| size_of_val(*part)).sum()
    }

    /// All treelets, level by level.
    pub fn treelet_count(&self) -> usize {
        self.levels.last().map_or(0, |level| level.end as usize)
    }

    /// A treelet's entry; it must be there.
    pub fn treelet(&self, number: usize) -> Treelet {
        assert!(number < self.treelet_count(), "no treelet {number}");
        let entry = &self.words[number * Self::ENTRY_WORDS..][..Self::ENTRY_WORDS];
        bytemuck::cast_slice(entry)[0]
    }

    /// The roots of the lowest level that has at most so many: the row of the first, and how many.
    /// Every triangle lies below one of them.
    pub fn few_roots(&self, most: u32) -> (u32, u32) {
        let roots = self.levels.iter().map(|level| {
            let each = level.clone().map(|t| self.treelet(t as usize).root_count);
            let first = self.treelet(level.start as usize).root_row;
            (first, each.sum())
        });
        let mut few = roots.filter(|&(_, count)| count <= most);
        few.next().unwrap_or((0, 1))
    }

    /// The triangles of a treelet of the lowest level, each with [`Treelets::SHARED`] or without.
    pub(crate) fn triangles(&self, number: usize) -> &[u32] {
        let entry = self.treelet(number);
        let at = self.triangles_at() + entry.first_leaf as usize;
        &self.words[at..][..entry.leaf_count as usize]
    }

    /// Where the triangles begin, in words.
    pub fn triangles_at(&self) -> usize {
        self.words.len() - (self.inner_count + self.leaf_count) as usize
    }

    /// Rows of 16 bytes in which a device keeps all nodes.
    pub fn rows(&self) -> usize {
        let waiting_roots = (self.root_count as usize).saturating_sub(1);
        4 * (1 + self.inner_count as usize) + 2 * waiting_roots
    }
}

impl Treelet {
    /// In place of a parent.
    pub const NONE: u32 = u32::MAX;
}
