//! Builds a tree on the device from the current positions.
//!
//! There are three steps. Each is a list of dispatches whose sizes do not depend on results of the device:
//!
//! 1. [`sort`] orders the live triangles along a space-filling curve (Lauterbach, Garland, Sengupta, Luebke, Manocha:
//!    *Fast BVH Construction on GPUs*, 2009), by a stable radix sort of 8 bits per pass.
//! 2. [`crate::work::leaves`] computes leaves in that order. [`instead_of`] replaces buffers of a tree for that.
//! 3. [`cluster`] merges neighbours bottom-up into `nodes`, including boxes.
//!
//! The result can be traced at once, without `expand` or `refit`. With layout `fast` it only has the 64-byte inner nodes
//! and the leaves of two triangles: leaves stay in the order of the curve, and there are no treelets.

mod phases;

use crate::work::{Groups, Work, sum, word_of};
use crate::{BufferName, Counts, Params, Shape, common, kernel};
use backend::Method;
use geom::Animation;
use std::mem::offset_of;

/// Entry points of kernels that only tree building uses.
pub(crate) const KERNELS: [&str; 6] = [
    "bounds",
    "morton",
    "sort_count",
    "sort_scan",
    "sort_scatter",
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

/// Returns the dispatches that sort the triangles of `tree` along a curve, from `vertices` positions to the buffer `sorted`.
pub fn sort(mut params: Params, vertices: usize, tree: &Shape) -> Vec<Work> {
    let count = tree.leaf_count;
    if count == 0 {
        return Vec::new();
    }
    params.count = vertices as u32;
    let mut work = vec![
        Work::new(common("bounds"), params, Groups::Linear(PARTS * 256)),
        Work::linear(common("morton"), params, count),
    ];
    params.count = count;
    let tiles = Groups::Linear(count.div_ceil(SORT_TILE) * 256);
    for (pass, shift) in (0..32).step_by(DIGIT_BITS).enumerate() {
        let odd = pass as u32 % 2;
        (params.first, params.destination) = (odd * count, (1 - odd) * count);
        params.shift = shift;
        let steps = [
            ("sort_count", tiles),
            ("sort_scan", Groups::Linear(DIGITS * 256)),
            ("sort_scatter", tiles),
        ];
        work.extend(steps.map(|(entry, groups)| Work::new(common(entry), params, groups)));
    }
    work
}

/// Returns the dispatches that compute `tree`'s nodes and its cost from the leaves in `clusters`. `again` is set if boxes
/// were refitted or built before in the same submission.
pub fn cluster(method: Method, params: Params, tree: &Shape, again: bool) -> Vec<Work> {
    let mut work = Vec::new();
    if tree.leaf_count > 0 {
        let phases = phases::of(params, tree.leaf_count);
        let cluster = kernel("cluster", method);
        let phase = |p: &Params| Work::new(cluster, *p, Groups::Linear(phases::tiles(p) * 256));
        work.extend(phases.iter().map(phase));
        let groups = phases.iter().map(phases::tiles).sum();
        work.push(sum(params, groups, word_of(offset_of!(Counts, areas))));
    }
    if again {
        // Clears the areas of moving nodes that an earlier refit counted.
        work.push(sum(params, 0, word_of(offset_of!(Counts, moving_areas))));
    }
    work
}

/// Returns the size of each buffer, in bytes, that building trees needs in addition to those of any tree.
pub fn buffers(animation: &Animation) -> Vec<(BufferName, u64)> {
    let count = animation.live_count() as u64;
    let tiles = count.div_ceil(u64::from(SORT_TILE));
    let survivors = phases::left(&phases::of(Params::default(), count.max(1) as u32)[0]);
    let mut all = vec![
        (BufferName::Live, count * 4),
        (BufferName::Keys, count * 8),
        (BufferName::Sorted, count * 8),
        (BufferName::Digits, (tiles + 1) * u64::from(DIGITS) * 4),
        (BufferName::Boxes, u64::from(PARTS) * 32),
        (BufferName::Clusters, (count + u64::from(survivors)) * 32),
    ];
    if !is_all_live(animation) {
        all.push((BufferName::LeafNumbers, count * 4));
    }
    all
}

/// Returns the initial contents of some buffers in that list.
pub fn contents(animation: &Animation) -> Vec<(BufferName, Vec<u32>)> {
    let all = 0..animation.triangle_count() as u32;
    let live: Vec<u32> = all.filter(|&t| animation.is_live(t)).collect();
    let numbers = (0..live.len() as u32).collect();
    let numbers = Some((BufferName::LeafNumbers, numbers)).filter(|_| !is_all_live(animation));
    [(BufferName::Live, live)]
        .into_iter()
        .chain(numbers)
        .collect()
}

/// Returns the buffer to bind in place of a tree's buffer while leaves are computed.
pub fn instead_of(name: BufferName, animation: &Animation) -> BufferName {
    match name {
        BufferName::Topology => BufferName::Sorted,
        // It holds the numbers from 0 on.
        BufferName::LeafNodes if is_all_live(animation) => BufferName::Live,
        BufferName::LeafNodes => BufferName::LeafNumbers,
        BufferName::Nodes => BufferName::Clusters,
        other => other,
    }
}

fn is_all_live(animation: &Animation) -> bool {
    animation.live_count() == animation.triangle_count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use backend::Layout;

    fn shape(leaves: u32) -> Shape {
        Shape::made_on_device(Layout::Bvh2, leaves)
    }

    #[test]
    fn costs_have_a_slot_for_each_tile() {
        for leaves in [1, 2, 511, 513, 100_000, 1 << 24] {
            let work = cluster(Method::default(), Params::default(), &shape(leaves), false);
            let last = work.last().map_or(0, |w| w.params.count);
            assert!(u64::from(last) * 4 <= Shape::cost_bytes(u64::from(leaves)));
        }
    }

    #[test]
    fn the_hosts_numbers_are_the_kernels() {
        let has = |kernel: &str, text: &str| {
            let found = common(kernel).code.wgsl.contains(text);
            assert!(found, "{kernel} lacks {text}");
        };
        let tile = format!("const CLUSTER_TILE: u32 = {}u;", phases::TILE);
        has("cluster", &tile);
        for kernel in ["sort_count", "sort_scan", "sort_scatter"] {
            has(kernel, &format!("const TILE: u32 = {SORT_TILE}u;"));
        }
        for kernel in KERNELS {
            assert_eq!(common(kernel).workgroup, [256, 1, 1], "{kernel}");
        }
    }
}
