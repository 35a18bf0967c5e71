//! The stages that follow a tree with layout `fast`: treelet by treelet, level by level.

use super::tree::sum;
use super::{Groups, Work};
use crate::{Kernel, MovingShape, Params, Shape, kernel};
use backend::Method;
use std::ops::Range;

/// A tree just adopted to its leaves' vertices.
pub(super) fn adopt(method: Method, mut params: Params, tree: &Shape) -> Work {
    params.first_group = tree.treelet_count();
    let gather = kernel("gather_corners", method);
    Work::linear(gather, params, 3 * tree.leaf_count)
}

/// Leaves of a tree that `preprocess` makes from key frames. Below, not to wait for positions saves more than blending a
/// vertex once for each triangle costs (measured on an H200: 4 us saved at 70K triangles, none at 500K, 8 lost at 1.6M).
const FROM_KEYS: u32 = 1 << 19;

/// Whether `preprocess` reads key frames in place of positions.
pub(super) fn reads_keys(tree: &Shape) -> bool {
    tree.leaf_count <= FROM_KEYS
}

/// Whether `preprocess` goes on to the boxes of all other treelets, if there are others. Roots of those that it passes over
/// stand where they were left when it went over all. That saves the wait for one level after the other; but of large trees
/// it takes longer (an H200: 2 us less at 70K and 250K triangles, 20 more at 1.6M).
pub(super) fn climbs(tree: &Shape) -> bool {
    reads_keys(tree) && tree.treelet_count() > 1
}

/// Positions, or key frames, to records, and to boxes of all nodes in treelets of triangles, or in all; if records stand,
/// only where anything moves. Also how many triangles of zero area that passes over.
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

/// Boxes of treelets' roots to those of all nodes above; if boxes stand, only where anything moves.
/// Each treelet has a sum of areas of its own, as those of triangles have. The workgroup that makes the root's box adds up all
/// sums, to the word [`Params::destination`] of the counts. Treelets that were passed over kept their sums.
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

/// The lists to go by, if there are some.
fn listed(tree: &Shape, stand: bool) -> Option<&MovingShape> {
    tree.moving.as_ref().filter(|_| stand)
}

/// Each level's treelets by number, or where they are listed.
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
