//! Sizes and offsets that a host needs to run kernels on a tree and on its moving treelets.

use crate::{Params, rebuild};
use bvh_layout::{Treelets, WideTree};
use geom::{Animation, StaticParts};
use std::ops::Range;

/// The parts and levels of a tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shape {
    /// Kernel parameters that depend only on the tree: sizes, and where its parts begin.
    pub params: Params,
    /// Number of triangles in the tree. Kernels call each one a leaf, although a leaf node may reference two.
    pub leaf_count: u32,
    /// Treelets of each level, the lowest first. The leaves of the lowest treelets are triangles (*treelets of
    /// triangles*). The leaves of the others are roots of the level below.
    pub treelets: Vec<Range<u32>>,
    /// The lists of moving treelets, if the tree has any.
    pub moving: Option<MovingShape>,
    /// Number of rows of 16 bytes in the buffer `nodes`.
    pub node_rows: u64,
    /// Size of the buffer `costs`, in bytes.
    pub cost_bytes: u64,
}

/// Maximum number of boxes with which a workgroup of 64 invocations starts a search (wgsl/intersect/resolve_camera.wgsl).
/// The ray may meet all of them, so this is the capacity of the workgroup's queue. Testing all these boxes takes less time
/// than traversing the levels above them.
const MAX_START_BOXES: u32 = 1024;

impl Shape {
    /// Returns the shape of a tree that the host built. The words of [`Treelets`] are its topology.
    pub fn of(tree: &Treelets) -> Self {
        let mut params = params_of(tree.leaf_count);
        params.leaf_triangles_at = tree.triangles_at() as u32;
        // The lowest level with at most this many roots.
        (params.start_row, params.start_count) = tree.few_roots(MAX_START_BOXES);
        if let Some(wide) = &tree.wide {
            let [words, lists, _] = tree.parts();
            params.wide_at = (words.len() + lists.len()) as u32;
            (params.wide_lanes, params.wide_root) = (wide.lanes as u32, wide.root);
        }
        let lists_at = tree.words().len() as u32;
        let level = |list: &Range<usize>| lists_at + list.start as u32..lists_at + list.end as u32;
        let mut shape = Self {
            params,
            leaf_count: tree.leaf_count,
            treelets: tree.levels.clone(),
            moving: tree.moving.as_ref().map(|moving| MovingShape {
                levels: moving.lists.iter().map(level).collect(),
                degenerate_elsewhere: moving.degenerate_elsewhere,
            }),
            node_rows: tree.rows() as u64,
            cost_bytes: 0,
        };
        // Two words per treelet and eight per root, in the order of `build/treelet_refit.wgsl`.
        let costs = u64::from(shape.treelet_count()) * 8 + u64::from(tree.root_count) * 32;
        shape.cost_bytes = costs.next_multiple_of(16);
        shape
    }

    /// Returns the approximate shape of a tree that the host has not built yet. It suffices to determine the kernels for
    /// the tree.
    #[must_use]
    pub fn expected(leaves: u32) -> Self {
        let mut params = params_of(leaves);
        if (1..=WideTree::MOST_TRIANGLES).contains(&(leaves as usize)) {
            (params.wide_lanes, params.wide_root) = (leaves, 1);
        }
        Self {
            params,
            leaf_count: leaves,
            ..Self::default()
        }
    }

    /// Returns the shape of a tree that the device builds. It has no treelets, because it needs no refit.
    pub fn built_on_device(leaves: u32) -> Self {
        Self {
            params: params_of(leaves),
            leaf_count: leaves,
            node_rows: 4 * u64::from(leaves),
            cost_bytes: rebuild::cost_bytes(leaves),
            ..Self::default()
        }
    }

    /// Returns the number of treelets of all levels.
    pub fn treelet_count(&self) -> u32 {
        self.treelets.last().map_or(0, |level| level.end)
    }
}

/// Returns the parameters that all trees of `leaves` leaves share.
fn params_of(leaves: u32) -> Params {
    Params {
        node_count: (2 * leaves).saturating_sub(1),
        // A search starts at the root.
        start_count: 1,
        ..Params::default()
    }
}

/// Returns the rows of four floats, in the array of all positions, that contain moving vertices, in ascending order.
/// Returns `None` if too many rows move for a list to save time ([`StaticParts::pays`]).
///
/// If the positions already hold the first key frame, it suffices that `interpolate` writes these rows.
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

/// Lists of a tree's moving treelets, which are uploaded after the topology. See [`bvh_layout::Moving`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MovingShape {
    /// The list of each level, the lowest first, as a range of words.
    pub levels: Vec<Range<u32>>,
    /// Number of zero-area triangles in treelets that are not listed.
    pub degenerate_elsewhere: u32,
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
    fn rows_cover_all_moving_floats() {
        assert_eq!(rows(&[], 9), Some(vec![]));
        assert_eq!(rows(&[0], 9), Some(vec![0]));
        assert_eq!(rows(&[1], 9), Some(vec![0, 1]));
        assert_eq!(rows(&[1, 2], 9), Some(vec![0, 1, 2]));
        assert_eq!(rows(&[3, 8], 9), Some(vec![2, 6]));
        assert_eq!(rows(&[0, 3, 6, 8], 9), None);
        assert_eq!(rows(&[], 0), Some(vec![]));
    }

    #[test]
    fn start_boxes_fit_the_queue() {
        let kernel = include_str!("../wgsl/intersect/resolve_camera.wgsl");
        let capacity = format!("const QUEUE_CAPACITY: u32 = {MAX_START_BOXES}u;");
        assert!(kernel.contains(&capacity), "expected {capacity}");
    }
}
