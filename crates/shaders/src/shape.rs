//! What a host must know of a tree's record to run kernels over it, and of what moves.

use crate::common;
use backend::Layout;
use bvh_layout::{Topology, Treelets};
use geom::{Animation, StaticParts};
use std::ops::Range;

/// A tree's parts and levels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shape {
    /// How its nodes lie. The record is the [`Topology`]'s words, or the [`Treelets`]' with layout `fast`.
    pub layout: Layout,
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
    /// With layout `fast`: each level's treelets, those of triangles first.
    pub treelets: Vec<Range<u32>>,
    /// Rows of 16 bytes in the buffer `nodes`.
    pub node_rows: u64,
    /// With layout `fast`: roots of treelets.
    pub root_count: u32,
    /// Boxes that a search by many invocations begins at: the first one's row, and how many lie there, two rows each.
    pub begin: (u32, u32),
    /// The wide tree, where the record has one.
    pub wide: WideShape,
}

/// Where a record keeps its [`bvh_layout::WideTree`]; all 0 if it has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WideShape {
    /// Its first word.
    pub at: u32,
    /// Lanes of all nodes.
    pub lanes: u32,
    /// The root's lanes, as the tree names them.
    pub root: u32,
}

impl WideShape {
    fn of(tree: &Treelets) -> Self {
        let [words, lists, _] = tree.parts();
        tree.wide.as_ref().map_or_else(Self::default, |wide| Self {
            at: (words.len() + lists.len()) as u32,
            lanes: wide.lanes as u32,
            root: wide.root,
        })
    }
}

/// Boxes that 64 invocations ask at once in less time than they take to go down to them.
const MANY: u32 = 2048;

/// No leaf; every part begins at word 0, a search at the root.
impl Default for Shape {
    fn default() -> Self {
        Self {
            layout: Layout::Bvh2,
            leaf_bits_at: 0,
            leaf_ranks_at: 0,
            leaf_triangles_at: 0,
            leaf_count: 0,
            node_count: 0,
            levels: Vec::new(),
            moving: None,
            treelets: Vec::new(),
            node_rows: 0,
            root_count: 0,
            begin: (0, 1),
            wide: WideShape::default(),
        }
    }
}

impl Shape {
    /// Of a record.
    pub fn of(tree: &Topology) -> Self {
        let bits = Topology::HEADER_WORDS + tree.level_count();
        let words = tree.leaf_bits().len();
        Self {
            leaf_bits_at: bits as u32,
            leaf_ranks_at: (bits + words) as u32,
            leaf_triangles_at: (bits + 2 * words) as u32,
            leaf_count: tree.leaf_count() as u32,
            node_count: tree.node_count() as u32,
            levels: tree.levels().filter(|inner| !inner.is_empty()).collect(),
            moving: MovingShape::of(tree),
            node_rows: 2 * tree.node_count() as u64,
            ..Self::default()
        }
    }

    /// About that of a tree of so many leaves that is yet to be built: enough to tell which kernels it will take.
    #[must_use]
    pub fn expected(layout: Layout, leaves: u32) -> Self {
        let (lanes, root) = match layout {
            Layout::Fast => (leaves, 1),
            Layout::Bvh2 => (0, 0),
        };
        Self {
            wide: WideShape { at: 0, lanes, root },
            ..Self::made_on_device(layout, leaves)
        }
    }

    /// Of a tree of so many leaves that the device makes: the leaves' triangles
    /// are the buffer `sorted`, from its start. It has no levels, as it needs no refit.
    pub fn made_on_device(layout: Layout, leaves: u32) -> Self {
        let node_count = (2 * leaves).saturating_sub(1);
        Self {
            layout,
            leaf_count: leaves,
            node_count,
            node_rows: match layout {
                Layout::Bvh2 => 2 * u64::from(node_count),
                Layout::Fast => 4 * u64::from(leaves),
            },
            ..Self::default()
        }
    }

    /// Of the same tree with layout `fast`.
    pub fn of_treelets(tree: &Treelets) -> Self {
        Self {
            layout: Layout::Fast,
            leaf_triangles_at: tree.triangles_at() as u32,
            leaf_count: tree.leaf_count,
            node_count: (2 * tree.leaf_count).saturating_sub(1),
            treelets: tree.levels.clone(),
            moving: MovingShape::of_treelets(tree),
            node_rows: tree.rows() as u64,
            root_count: tree.root_count,
            begin: tree.few_roots(MANY),
            wide: WideShape::of(tree),
            ..Self::default()
        }
    }

    /// Treelets of all levels.
    pub fn treelet_count(&self) -> u32 {
        self.treelets.last().map_or(0, |level| level.end)
    }

    /// Bytes of the buffer `costs` that suffice for every tree of so many
    /// leaves with layout `bvh2`: one f32 for each workgroup of each level, in whole rows of 16 bytes.
    pub fn cost_bytes(leaves: u64) -> u64 {
        let group = u64::from(common("refit").workgroup[0]);
        let groups = leaves.div_ceil(group) + u64::from(bvh_build::MAX_DEPTH) + 1;
        (groups * 4).next_multiple_of(16)
    }

    /// Bytes of the buffer `costs` that suffice for this tree, in whole rows: where it has treelets, two words for each
    /// and eight for each root, as `build/treelet_refit.wgsl` lays them out.
    pub fn own_cost_bytes(&self) -> u64 {
        match self.treelet_count() {
            0 => Self::cost_bytes(u64::from(self.leaf_count)),
            treelets => {
                (u64::from(treelets) * 8 + u64::from(self.root_count) * 32).next_multiple_of(16)
            }
        }
    }
}

/// Rows of four floats of all positions, laid end to end, in which any vertex moves: what `interpolate` may write in place
/// of all. They rise. `None` where so many move that lists do not pay ([`StaticParts::pays`]).
///
/// Whoever writes only these must have the first key frame in the positions before.
pub fn moving_rows(animation: &Animation) -> Option<Vec<u32>> {
    let is_static = &animation.static_parts().vertices;
    let all = (3 * is_static.len()).div_ceil(4);
    let mut rows: Vec<u32> = Vec::new();
    for (v, _) in is_static.iter().enumerate().filter(|(_, s)| !**s) {
        for row in [3 * v / 4, (3 * v + 2) / 4] {
            if rows.last().is_none_or(|&last| (last as usize) < row) {
                rows.push(row as u32);
            }
        }
    }
    StaticParts::pays(rows.len(), all).then_some(rows)
}

/// Where a tree's lists of what moves lie: words that are uploaded behind the tree's record. See [`bvh_layout::Moving`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MovingShape {
    /// With layout `bvh2`, leaves' ranks.
    pub leaves: Range<u32>,
    /// Likewise inner nodes by their number among inner nodes.
    pub inner: Range<u32>,
    /// Likewise those of each level that has any, root first. With layout `fast` the numbers of each level's treelets, that of
    /// the triangles first.
    pub levels: Vec<Range<u32>>,
    /// Triangles of zero area among leaves, or in treelets, that are not listed.
    pub degenerate_elsewhere: u32,
}

impl MovingShape {
    pub(crate) fn of(tree: &Topology) -> Option<Self> {
        let moving = tree.moving()?;
        let at = tree.words().len() as u32;
        let mut lists = behind(at, &moving.lists);
        let leaves = lists.remove(0);
        Some(Self {
            inner: leaves.end..at + moving.words.len() as u32,
            leaves,
            levels: lists,
            degenerate_elsewhere: moving.degenerate_elsewhere,
        })
    }

    pub(crate) fn of_treelets(tree: &Treelets) -> Option<Self> {
        let moving = tree.moving.as_ref()?;
        Some(Self {
            levels: behind(tree.words().len() as u32, &moving.lists),
            degenerate_elsewhere: moving.degenerate_elsewhere,
            ..Self::default()
        })
    }
}

fn behind(at: u32, lists: &[Range<usize>]) -> Vec<Range<u32>> {
    let place = |l: &Range<usize>| at + l.start as u32..at + l.end as u32;
    lists.iter().map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(moves: &[usize], vertices: usize) -> Option<Vec<u32>> {
        let mut keys = vec![vec![[1.0; 3]; vertices]; 2];
        moves.iter().for_each(|&v| keys[1][v][2] = 2.0);
        moving_rows(&Animation::new(keys, vec![]).unwrap())
    }

    #[test]
    fn rows_hold_every_float_of_what_moves() {
        assert_eq!(rows(&[], 9), Some(vec![]));
        assert_eq!(rows(&[0], 9), Some(vec![0]));
        assert_eq!(rows(&[1], 9), Some(vec![0, 1]));
        assert_eq!(rows(&[1, 2], 9), Some(vec![0, 1, 2]));
        assert_eq!(rows(&[3, 8], 9), Some(vec![2, 6]));
        assert_eq!(rows(&[0, 3, 6, 8], 9), None);
        assert_eq!(rows(&[], 0), Some(vec![]));
    }
}
