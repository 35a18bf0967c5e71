//! What a host must know of a tree's record to run kernels over it, and of what moves.

use crate::{Params, common};
use backend::Layout;
use bvh_layout::{Topology, Treelets};
use geom::{Animation, StaticParts};
use std::ops::Range;

/// A tree's parts and levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// How its nodes lie. The record is the [`Topology`]'s words, or the [`Treelets`]' with layout `fast`.
    pub layout: Layout,
    /// What kernels are told of it: where parts of the record begin, in words, and the wide tree, where it has one; in `goal`
    /// and `count` the boxes that a search by many invocations begins at, the first one's row and how many lie there.
    pub params: Params,
    /// Leaves.
    pub leaf_count: u32,
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
}

/// Boxes that 64 invocations ask at once in less time than they take to go down to them.
const MANY: u32 = 2048;

impl Shape {
    /// Of no leaf.
    pub fn none(layout: Layout) -> Self {
        Self::made_on_device(layout, 0)
    }

    /// Of a record.
    pub fn of(tree: &Topology) -> Self {
        let bits = Topology::HEADER_WORDS + tree.level_count();
        let words = tree.leaf_bits().len();
        let mut shape = Self::made_on_device(Layout::Bvh2, tree.leaf_count() as u32);
        shape.params.leaf_bits_at = bits as u32;
        shape.params.leaf_ranks_at = (bits + words) as u32;
        shape.params.leaf_triangles_at = (bits + 2 * words) as u32;
        shape.levels = tree.levels().filter(|inner| !inner.is_empty()).collect();
        shape.moving = tree.moving().map(|moving| {
            let at = tree.words().len() as u32;
            let mut lists = behind(at, &moving.lists);
            let leaves = lists.remove(0);
            MovingShape {
                inner: leaves.end..at + moving.words.len() as u32,
                leaves,
                levels: lists,
                degenerate_elsewhere: moving.degenerate_elsewhere,
            }
        });
        shape
    }

    /// About that of a tree of so many leaves that is yet to be built: enough to tell which kernels it will take.
    #[must_use]
    pub fn expected(layout: Layout, leaves: u32) -> Self {
        let mut shape = Self::made_on_device(layout, leaves);
        if layout == Layout::Fast {
            (shape.params.wide_lanes, shape.params.wide_root) = (leaves, 1);
        }
        shape
    }

    /// Of a tree of so many leaves that the device makes: the leaves' triangles
    /// are the buffer `sorted`, from its start. It has no levels, as it needs no refit.
    pub fn made_on_device(layout: Layout, leaves: u32) -> Self {
        let node_count = (2 * leaves).saturating_sub(1);
        Self {
            layout,
            params: Params {
                node_count,
                // A search begins at the root.
                count: 1,
                ..Params::default()
            },
            leaf_count: leaves,
            levels: Vec::new(),
            moving: None,
            treelets: Vec::new(),
            node_rows: match layout {
                Layout::Bvh2 => 2 * u64::from(node_count),
                Layout::Fast => 4 * u64::from(leaves),
            },
            root_count: 0,
        }
    }

    /// Of the same tree with layout `fast`.
    pub fn of_treelets(tree: &Treelets) -> Self {
        let mut shape = Self::made_on_device(Layout::Fast, tree.leaf_count);
        let params = &mut shape.params;
        params.leaf_triangles_at = tree.triangles_at() as u32;
        (params.goal, params.count) = tree.few_roots(MANY);
        if let Some(wide) = &tree.wide {
            let [words, lists, _] = tree.parts();
            params.wide_at = (words.len() + lists.len()) as u32;
            (params.wide_lanes, params.wide_root) = (wide.lanes as u32, wide.root);
        }
        Self {
            treelets: tree.levels.clone(),
            moving: tree.moving.as_ref().map(|moving| MovingShape {
                levels: behind(tree.words().len() as u32, &moving.lists),
                degenerate_elsewhere: moving.degenerate_elsewhere,
                ..MovingShape::default()
            }),
            node_rows: tree.rows() as u64,
            root_count: tree.root_count,
            ..shape
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

/// Lists that begin at a word.
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
