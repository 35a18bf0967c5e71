//! The stages that follow a tree with layout `fast`: treelet by treelet, level by level.

use super::{Groups, Work};
use crate::{Kernel, MovingTreeletShape, Params, Shape, kernel};
use backend::Method;
use std::ops::Range;

/// A tree just adopted to its leaves' vertices.
pub(super) fn adopt(method: Method, params: Params, tree: &Shape) -> Work {
    Work::linear(
        kernel("gather_corners", method),
        params,
        3 * tree.leaf_count,
    )
}

/// Positions to records, and to boxes of all nodes in treelets of triangles; if records stand, only where anything moves.
/// Also how many triangles of zero area that passes over.
pub(super) fn preprocess(method: Method, params: Params, tree: &Shape, stand: bool) -> (Work, u32) {
    let preprocess = kernel("preprocess_treelets", method);
    let (params, levels) = levels(params, tree, stand);
    let lowest = levels.first().cloned().unwrap_or_default();
    let uncounted = listed(tree, stand).map_or(0, |moving| moving.degenerate_elsewhere);
    (over(preprocess, params, lowest), uncounted)
}

/// Boxes of treelets' roots to those of all nodes above; if boxes stand, only where anything moves.
/// Each treelet has a sum of areas of its own, as those of triangles have.
pub(super) fn refit(method: Method, params: Params, tree: &Shape, stand: bool) -> Vec<Work> {
    let refit = kernel("refit_treelets", method);
    let (params, levels) = levels(params, tree, stand);
    let above = levels.iter().skip(1);
    above
        .map(|level| over(refit, params, level.clone()))
        .collect()
}

/// The lists to go by, if there are some.
fn listed(tree: &Shape, stand: bool) -> Option<&MovingTreeletShape> {
    tree.moving_treelets.as_ref().filter(|_| stand)
}

/// Each level's treelets by number, or where they are listed.
fn levels(params: Params, tree: &Shape, stand: bool) -> (Params, &[Range<u32>]) {
    match listed(tree, stand) {
        Some(moving) => (
            Params {
                listed: 1,
                ..params
            },
            &moving.levels,
        ),
        None => (params, &tree.treelets),
    }
}

fn over(kernel: &'static Kernel, params: Params, level: Range<u32>) -> Work {
    let (first, count) = (level.start, level.len() as u32);
    Work {
        kernel,
        params: Params {
            first,
            count,
            ..params
        },
        groups: Groups::Each(count),
    }
}

#[cfg(test)]
mod tests {
    use crate::work::{Progress, Work};
    use crate::{MovingTreeletShape, Params, Shape};
    use backend::{Layout, Method};

    /// Kernel, first element, count, whether listed.
    fn told(work: &[Work]) -> Vec<(&str, u32, u32, u32)> {
        let told = |w: &Work| {
            let p = &w.params;
            (w.kernel.entry, p.first, p.count, p.listed)
        };
        work.iter().map(told).collect()
    }

    #[test]
    fn treelets_are_done_whole_first_and_then_where_anything_moves() {
        let layout = Layout::Fast;
        let tree = Shape {
            layout,
            leaf_count: 20_000,
            treelets: vec![0..90, 90..93, 93..94],
            moving_treelets: Some(MovingTreeletShape {
                levels: vec![500..507, 507..508, 508..509],
                degenerate_elsewhere: 4,
            }),
            ..Shape::default()
        };
        let (mut progress, params) = (Progress::default(), Params::default());
        let method = Method {
            layout,
            ..Method::default()
        };
        let (work, uncounted) = progress.preprocess(method, params, &tree);
        let whole = vec![
            ("gather_corners", 0, 60_000, 0),
            ("preprocess_treelets", 0, 90, 0),
        ];
        assert_eq!((told(&work), uncounted), (whole, 0));
        progress.preprocessed();
        let (work, uncounted) = progress.preprocess(method, params, &tree);
        let listed = vec![("preprocess_treelets", 500, 7, 1)];
        assert_eq!((told(&work), uncounted), (listed, 4));
        let (work, _) = progress.refit(method, params, &tree);
        let whole = [("refit_treelets", 90, 3, 0), ("refit_treelets", 93, 1, 0)];
        assert_eq!(told(&work)[..2], whole);
        progress.refitted();
        let (work, _) = progress.refit(method, params, &tree);
        let expected = [
            ("refit_treelets", 507, 1, 1),
            ("refit_treelets", 508, 1, 1),
            ("sum_costs", 4, 94, 0),
        ];
        assert_eq!(told(&work), expected);
    }
}
