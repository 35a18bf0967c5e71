//! The stages that follow a tree with layout `fast`: treelet by treelet, level by level.

use super::tree::{AREAS, sum, word_of};
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

/// Positions, or key frames, to records, and to boxes of all nodes in treelets of triangles, or in all; if records stand, only
/// where anything moves.
/// Also how many triangles of zero area that passes over.
pub(super) fn preprocess(method: Method, params: Params, tree: &Shape, stand: bool) -> (Work, u32) {
    let entry = match reads_keys(tree) {
        true => "preprocess_treelets_of_keys",
        false => "preprocess_treelets",
    };
    let preprocess = kernel(entry, method);
    let (mut params, levels) = levels(params, tree, stand);
    if climbs(tree) {
        params.first_group = tree.treelet_count();
        params.destination = word_of(AREAS);
    }
    let lowest = levels.first().cloned().unwrap_or_default();
    let uncounted = listed(tree, stand).map_or(0, |moving| moving.degenerate_elsewhere);
    (over(preprocess, params, lowest), uncounted)
}

/// Boxes of treelets' roots to those of all nodes above; if boxes stand, only where anything moves.
/// Each treelet has a sum of areas of its own, as those of triangles have; whoever makes the root's box adds up all
/// of them. What was passed over kept its sum.
pub(super) fn refit(method: Method, params: Params, tree: &Shape, stand: bool) -> Vec<Work> {
    let refit = kernel("refit_treelets", method);
    let (of_levels, levels) = levels(params, tree, stand);
    let above = levels.iter().skip(1);
    let above = above.map(|level| over(refit, of_levels, level.clone()));
    let mut work: Vec<_> = above.collect();
    match work.last_mut() {
        Some(last) => {
            last.params.first_group = tree.treelet_count();
            last.params.destination = word_of(AREAS);
        }
        None => work.push(sum(params, tree.treelet_count(), AREAS)),
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

#[cfg(test)]
mod tests {
    use crate::work::{Progress, Work};
    use crate::{Extent, MovingShape, Params, Shape};
    use backend::{Layout, Method};

    /// Kernel, first element, count, whether listed.
    fn told(work: &[Work]) -> Vec<(&str, u32, u32, u32)> {
        let told = |w: &Work| {
            let p = &w.params;
            (w.kernel.entry, p.first, p.count, p.listed)
        };
        work.iter().map(told).collect()
    }

    fn fast() -> (Method, Shape) {
        let layout = Layout::Fast;
        let method = Method {
            layout,
            ..Method::default()
        };
        let shape = Shape {
            layout,
            ..Shape::default()
        };
        (method, shape)
    }

    fn beside(work: &[Work]) -> Vec<bool> {
        work.iter().map(|w| w.alongside).collect()
    }

    #[test]
    fn treelets_are_done_whole_first_and_then_where_anything_moves() {
        let (method, shape) = fast();
        let tree = Shape {
            leaf_count: 20_000,
            treelets: vec![0..90, 90..93, 93..94],
            moving: Some(MovingShape {
                levels: vec![500..507, 507..508, 508..509],
                degenerate_elsewhere: 4,
                ..MovingShape::default()
            }),
            ..shape
        };
        let (mut progress, params) = (Progress::default(), Params::default());
        let (work, uncounted) = progress.preprocess(method, params, &tree);
        let whole = vec![
            ("gather_corners", 0, 60_000, 0),
            ("preprocess_treelets_of_keys", 0, 90, 0),
        ];
        assert_eq!((told(&work), uncounted), (whole, 0));
        assert_eq!(beside(&work), [true, false]);
        let climbs = |w: &Work| (w.params.first_group, w.params.destination);
        assert_eq!(climbs(&work[1]), (94, 4));
        progress.preprocessed(&tree);
        let (work, extent) = progress.refit(method, params, &tree);
        assert!(work.is_empty() && extent == Extent::Whole);
        progress.submitted();
        let (work, uncounted) = progress.preprocess(method, params, &tree);
        let listed = vec![("preprocess_treelets_of_keys", 500, 7, 1)];
        assert_eq!((told(&work), uncounted), (listed, 4));
        assert_eq!(beside(&work), [true]);
        assert_eq!(climbs(&work[0]), (94, 4));
        let (work, _) = progress.refit(method, params, &tree);
        let whole = [("refit_treelets", 90, 3, 0), ("refit_treelets", 93, 1, 0)];
        assert_eq!(told(&work), whole);
        let sums = work.iter().map(|w| w.params.first_group);
        assert_eq!(sums.collect::<Vec<_>>(), [0, 94]);
        progress.refitted();
        let (work, _) = progress.refit(method, params, &tree);
        let expected = [("refit_treelets", 507, 1, 1), ("refit_treelets", 508, 1, 1)];
        assert_eq!(told(&work), expected);
        assert_eq!(work[1].params.first_group, 94);
    }
}
