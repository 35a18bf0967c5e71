//! Dispatches that update a tree with layout `fast`: treelet by treelet, level by level.

use super::tree::sum;
use super::{Groups, Work};
use crate::{Kernel, MovingShape, Params, Shape, kernel};
use backend::Method;
use std::ops::Range;

/// Returns the dispatch that gathers the vertices of a newly adopted tree's leaves.
pub(super) fn adopt(method: Method, mut params: Params, tree: &Shape) -> Work {
    params.first_group = tree.treelet_count();
    let gather = kernel("gather_corners", method);
    Work::linear(gather, params, 3 * tree.leaf_count)
}

/// Maximum number of leaves for which `preprocess` blends key frames itself. Up to here, not waiting for positions saves
/// more time than blending a vertex once per triangle costs. On an H200: 4 us saved at 70K triangles, 0 at 500K, 8 lost
/// at 1.6M.
const FROM_KEYS: u32 = 1 << 19;

/// Returns whether `preprocess` reads key frames instead of positions.
pub(super) fn reads_keys(tree: &Shape) -> bool {
    tree.leaf_count <= FROM_KEYS
}

/// Returns whether `preprocess` also computes the boxes of all other treelets, if there are any. Treelets that it skips
/// keep the roots that it computed for the whole tree. This avoids a barrier per level, but takes longer for large trees.
/// On an H200: 2 us less at 70K and 250K triangles, 20 us more at 1.6M.
pub(super) fn climbs(tree: &Shape) -> bool {
    reads_keys(tree) && tree.treelet_count() > 1
}

/// Returns the dispatch that computes records from positions or key frames, and boxes of all nodes in treelets of triangles,
/// or in all treelets. If records already exist (`stand`), it only covers moving treelets. Also returns the number of
/// zero-area triangles that it skips.
pub(super) fn preprocess(method: Method, params: Params, tree: &Shape, stand: bool) -> (Work, u32) {
    let entry = match reads_keys(tree) {
        true => "preprocess_treelets_of_keys",
        false => "preprocess_treelets",
    };
    let preprocess = kernel(entry, method);
    let (mut params, levels) = levels(params, tree, stand);
    if climbs(tree) {
        params.first_group = tree.treelet_count();
    }
    let lowest = levels.first().cloned().unwrap_or_default();
    let uncounted = listed(tree, stand).map_or(0, |moving| moving.degenerate_elsewhere);
    (over(preprocess, params, lowest), uncounted)
}

/// Returns the dispatches that compute the boxes of all nodes above the roots of the lowest treelets. If boxes already exist
/// (`stand`), they only cover moving treelets.
///
/// Each treelet has its own sum of areas. The workgroup that computes the root box adds all sums and stores the total in
/// word [`Params::destination`] of the counts. Treelets that are skipped keep their sums.
pub(super) fn refit(method: Method, params: Params, tree: &Shape, stand: bool) -> Vec<Work> {
    let refit = kernel("refit_treelets", method);
    let (of_levels, levels) = levels(params, tree, stand);
    let above = levels.iter().skip(1);
    let above = above.map(|level| over(refit, of_levels, level.clone()));
    let mut work: Vec<_> = above.collect();
    match work.last_mut() {
        Some(last) => {
            last.params.first_group = tree.treelet_count();
        }
        None => work.push(sum(params, tree.treelet_count(), params.destination)),
    }
    work
}

/// Returns the lists of moving treelets if the tree has any and its records and boxes already exist (`stand`).
fn listed(tree: &Shape, stand: bool) -> Option<&MovingShape> {
    tree.moving.as_ref().filter(|_| stand)
}

/// Returns the treelets of each level, by index or as ranges of the lists.
fn levels(mut params: Params, tree: &Shape, stand: bool) -> (Params, &[Range<u32>]) {
    let listed = listed(tree, stand);
    params.listed = listed.is_some().into();
    (
        params,
        listed.map_or(&tree.treelets, |moving| &moving.levels),
    )
}

fn over(kernel: &'static Kernel, mut params: Params, level: Range<u32>) -> Work {
    (params.first, params.count) = (level.start, level.len() as u32);
    Work::new(kernel, params, Groups::Each(params.count))
}
