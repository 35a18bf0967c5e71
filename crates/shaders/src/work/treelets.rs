//! The stages that follow a tree with layout `fast`: treelet by treelet, level by level.

use super::{Groups, Work};
use crate::{Kernel, Params, Shape, kernel};
use backend::Method;
use std::ops::Range;

/// Positions to records, and to boxes of all nodes in treelets of triangles.
pub(super) fn preprocess(method: Method, params: Params, tree: &Shape) -> Work {
    let level = tree.treelets.first().cloned().unwrap_or_default();
    over(kernel("preprocess_treelets", method), params, level)
}

/// Boxes of treelets' roots to those of all nodes above. Each treelet has a sum of areas of its own, as those of triangles have.
pub(super) fn refit(method: Method, params: Params, tree: &Shape) -> Vec<Work> {
    let refit = kernel("refit_treelets", method);
    let above = tree.treelets.iter().skip(1);
    above
        .map(|level| over(refit, params, level.clone()))
        .collect()
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
