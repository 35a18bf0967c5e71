//! Sizes and offsets that a host needs to run kernels on a tree and on its moving parts.

use crate::{Params, common};
use backend::Layout;
use bvh_layout::{Topology, Treelets};
use geom::{Animation, StaticParts};
use std::ops::Range;

/// The parts and levels of a tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Layout of the nodes. The topology is the words of [`Topology`], or of [`Treelets`] with layout `fast`.
    pub layout: Layout,
    /// Parameters of kernels for the tree: where parts of the topology and of the wide tree begin, in words. `goal` and
    /// `count` are the first row and the number of the boxes where a workgroup's search starts.
    pub params: Params,
    /// Number of leaves.
    pub leaf_count: u32,
    /// Inner nodes of each level that has any, as indices among the inner nodes, root first.
    pub levels: Vec<Range<u32>>,
    /// The lists of moving parts, if the tree has any.
    pub moving: Option<MovingShape>,
    /// With layout `fast`: treelets of each level, those of triangles first.
    pub treelets: Vec<Range<u32>>,
    /// Number of rows of 16 bytes in the buffer `nodes`.
    pub node_rows: u64,
    /// With layout `fast`: number of roots of treelets.
    pub root_count: u32,
}

/// Maximum number of boxes that 64 invocations test in less time than they would take to traverse the levels above.
const MANY: u32 = 2048;

impl Shape {
    /// Returns the shape of an empty tree.
    pub fn none(layout: Layout) -> Self {
        Self::made_on_device(layout, 0)
    }

    /// Returns the shape of a tree with layout `bvh2`.
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

    /// Returns the approximate shape of a tree that is not built yet. It suffices to determine the kernels for the tree.
    #[must_use]
    pub fn expected(layout: Layout, leaves: u32) -> Self {
        let mut shape = Self::made_on_device(layout, leaves);
        if layout == Layout::Fast {
            (shape.params.wide_lanes, shape.params.wide_root) = (leaves, 1);
        }
        shape
    }

    /// Returns the shape of a tree that the device builds. The triangles of its leaves are at the start of the buffer
    /// `sorted`. It has no levels, because it needs no refit.
    pub fn made_on_device(layout: Layout, leaves: u32) -> Self {
        let node_count = (2 * leaves).saturating_sub(1);
        Self {
            layout,
            params: Params {
                node_count,
                // A search starts at the root.
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

    /// Returns the shape of a tree with layout `fast`.
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

    /// Returns the number of treelets of all levels.
    pub fn treelet_count(&self) -> u32 {
        self.treelets.last().map_or(0, |level| level.end)
    }

    /// Returns the size of the buffer `costs`, in bytes, that suffices for every tree of `leaves` leaves with layout `bvh2`:
    /// one f32 for each workgroup of each level, rounded up to 16 bytes.
    pub fn cost_bytes(leaves: u64) -> u64 {
        let group = u64::from(common("refit").workgroup[0]);
        let groups = leaves.div_ceil(group) + u64::from(bvh_build::MAX_DEPTH) + 1;
        (groups * 4).next_multiple_of(16)
    }

    /// Returns the size of the buffer `costs` that suffices for this tree, in bytes, rounded up to 16. A tree with treelets
    /// needs two words per treelet and eight per root, in the layout of `build/treelet_refit.wgsl`.
    pub fn own_cost_bytes(&self) -> u64 {
        match self.treelet_count() {
            0 => Self::cost_bytes(u64::from(self.leaf_count)),
            treelets => {
                (u64::from(treelets) * 8 + u64::from(self.root_count) * 32).next_multiple_of(16)
            }
        }
    }
}

/// Returns the rows of four floats, in the array of all positions, that contain moving vertices, in ascending order.
/// Returns `None` if too many move for lists to pay ([`StaticParts::pays`]).
///
/// `interpolate` may write only these rows if the positions already hold the first key frame.
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

/// Lists of a tree's moving parts, as ranges of words that are uploaded after the topology. See [`bvh_layout::Moving`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MovingShape {
    /// Ranks of leaves, with layout `bvh2`.
    pub leaves: Range<u32>,
    /// Indices of inner nodes among all inner nodes, with layout `bvh2`.
    pub inner: Range<u32>,
    /// With layout `bvh2`, the inner nodes of each level that has any, root first. With layout `fast`, the treelets of each
    /// level, those of triangles first.
    pub levels: Vec<Range<u32>>,
    /// Number of zero-area triangles in leaves or treelets that are not listed.
    pub degenerate_elsewhere: u32,
}

/// Returns `lists` moved to word `at`.
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
