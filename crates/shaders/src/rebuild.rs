//! Builds a tree on the device from the current positions.
//!
//! There are three steps. Each is a list of dispatches whose sizes do not depend on results of the device:
//!
//! 1. [`sort`] orders the live triangles along a space-filling curve (Lauterbach, Garland, Sengupta, Luebke, Manocha:
//!    *Fast BVH Construction on GPUs*, 2009), by a stable radix sort of 8 bits per pass.
//! 2. [`leaves`] computes triangle records and one cluster per triangle, in the order of the curve.
//! 3. [`cluster`] merges neighbours bottom-up into `nodes`, including boxes.
//!
//! The result can be traced at once, without a refit. Like other trees, it has 64-byte inner nodes, and leaf nodes of one or
//! two triangles. But triangles stay in the order of the curve, and there are no treelets.

mod phases;

use crate::work::{Groups, Work, sum_costs, word_of_counter};
use crate::{BufferName, Counts, Params, Shape, SortParams, common, kernel};
use backend::Intersector;
use geom::Animation;
use phases::Phase;
use std::mem::offset_of;

/// Entry points of kernels that only tree building uses.
pub(crate) const KERNELS: [&str; 7] = [
    "bounds",
    "morton",
    "sort_count",
    "sort_scan",
    "sort_scatter",
    "cluster_leaves",
    "cluster",
];
/// Number of elements that one workgroup sorts: see build/sort.wgsl.
const SORT_TILE: u32 = 2048;
/// Number of values of a digit.
const DIGITS: u32 = 256;
/// Number of bits of a digit. With four digits, elements end in the half of the buffer where they began.
const DIGIT_BITS: usize = 8;
/// Number of partial bounding boxes of the scene: see build/morton.wgsl.
const PARTS: u32 = 128;

/// Returns the dispatches that sort the triangles of `tree` along a curve into the buffer `sorted`. `vertices` is
/// the number of positions.
pub fn sort(mut params: Params, vertices: usize, tree: &Shape) -> Vec<Work> {
    let count = tree.leaf_count;
    if count == 0 {
        return Vec::new();
    }
    params.count = vertices as u32;
    let mut work = vec![
        Work::new(common("bounds"), params, Groups::Each(PARTS)),
        Work::linear(common("morton"), params, count),
    ];
    params.count = count;
    let tiles = Groups::Each(count.div_ceil(SORT_TILE));
    for (pass, shift) in (0..32).step_by(DIGIT_BITS).enumerate() {
        let odd = pass as u32 % 2;
        let params = params.with(SortParams {
            source_at: odd * count,
            target_at: (1 - odd) * count,
            shift,
        });
        let steps = [
            ("sort_count", tiles),
            ("sort_scan", Groups::Each(DIGITS)),
            ("sort_scatter", tiles),
        ];
        work.extend(steps.map(|(entry, groups)| Work::new(common(entry), params, groups)));
    }
    work
}

/// Returns the dispatch that computes records and clusters of all leaves from positions.
pub fn leaves(intersector: Intersector, params: Params, tree: &Shape) -> Work {
    let kernel = kernel("cluster_leaves", intersector);
    Work::linear(kernel, params, tree.leaf_count)
}

/// Returns the dispatches that compute `tree`'s nodes and its cost from the leaves in `clusters`.
pub fn cluster(params: Params, tree: &Shape) -> Vec<Work> {
    if tree.leaf_count == 0 {
        return Vec::new();
    }
    let phases = phases::of(tree.leaf_count);
    let cluster = common("cluster");
    let phase = |phase: &Phase| {
        let params = Params {
            count: phase.count,
            ..params.with(phase.own)
        };
        Work::new(cluster, params, Groups::Each(phase.tiles()))
    };
    let mut work: Vec<_> = phases.iter().map(phase).collect();
    let groups = phases.iter().map(Phase::tiles).sum();
    let areas = word_of_counter(offset_of!(Counts, areas));
    work.push(sum_costs(params, groups, areas));
    work
}

/// Returns the size of the buffer `costs` for [`cluster`], in bytes: one f32 for each tile of each phase, rounded up to 16.
pub(crate) fn cost_bytes(leaves: u32) -> u64 {
    let phases = phases::of(leaves.max(1));
    let tiles: u32 = phases.iter().map(Phase::tiles).sum();
    (u64::from(tiles) * 4).next_multiple_of(16)
}

/// Returns the size in bytes of each buffer that building trees needs in addition to [`crate::tree_buffers`].
pub fn buffers(animation: &Animation) -> Vec<(BufferName, u64)> {
    let count = animation.live_count() as u64;
    let tiles = count.div_ceil(u64::from(SORT_TILE));
    let survivors = phases::of(count.max(1) as u32)[0].remaining();
    vec![
        (BufferName::Live, count * 4),
        (BufferName::Keys, count * 8),
        (BufferName::Sorted, count * 8),
        (BufferName::Digits, (tiles + 1) * u64::from(DIGITS) * 4),
        (BufferName::Boxes, u64::from(PARTS) * 32),
        (BufferName::Clusters, (count + u64::from(survivors)) * 32),
    ]
}

/// Returns the contents of [`BufferName::Live`].
pub fn live(animation: &Animation) -> Vec<u32> {
    let all = 0..animation.triangle_count() as u32;
    all.filter(|&t| animation.is_live(t)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PhaseParams;

    #[test]
    fn cost_buffer_fits_every_tile() {
        for leaves in [1, 2, 511, 513, 100_000, 1 << 24] {
            let tree = Shape::built_on_device(leaves);
            let work = cluster(Params::default(), &tree);
            let (sum, phases) = work.split_last().unwrap();
            let last = phases::of(leaves).pop().unwrap();
            assert_eq!(
                phases.last().unwrap().params.own.get::<PhaseParams>(),
                last.own
            );
            let after = last.own.first_tile + last.tiles();
            assert_eq!(sum.params.count, after);
            assert!(u64::from(after) * 4 <= tree.cost_bytes);
        }
    }

    #[test]
    fn rebuild_constants_match_kernel_sources() {
        common("cluster").assert_declares("CLUSTER_TILE", phases::TILE);
        for kernel in ["sort_count", "sort_scan", "sort_scatter"] {
            common(kernel).assert_declares("TILE", SORT_TILE);
        }
        for kernel in KERNELS.into_iter().filter(|k| *k != "cluster_leaves") {
            assert_eq!(common(kernel).workgroup, [256, 1, 1], "{kernel}");
        }
    }
}
