//! What a device keeps to make trees.

use super::{DIGITS, PARTS, SORT_TILE, phases};
use crate::BufferName;
use geom::Animation;

/// Bytes of each buffer that making trees of the scene takes beside those that any tree does.
#[must_use]
pub fn buffers(animation: &Animation) -> Vec<(BufferName, u64)> {
    let count = animation.live_count() as u64;
    let tiles = count.div_ceil(u64::from(SORT_TILE));
    let survivors = phases::of(count.max(1) as u32)[0].left();
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

/// What kernels expect to find in some of them.
#[must_use]
pub fn contents(animation: &Animation) -> Vec<(BufferName, Vec<u32>)> {
    let all = 0..animation.triangle_count() as u32;
    let live: Vec<u32> = all.filter(|&t| animation.is_live(t)).collect();
    let numbers = (0..live.len() as u32).collect();
    match is_all_live(animation) {
        true => vec![(BufferName::Live, live)],
        false => vec![(BufferName::Live, live), (BufferName::LeafNumbers, numbers)],
    }
}

/// What stands for a tree's buffer while leaves are made into clusters.
#[must_use]
pub fn instead_of(name: BufferName, animation: &Animation) -> BufferName {
    match name {
        BufferName::Topology => BufferName::Sorted,
        // The numbers from 0 on.
        BufferName::LeafNodes if is_all_live(animation) => BufferName::Live,
        BufferName::LeafNodes => BufferName::LeafNumbers,
        BufferName::Nodes => BufferName::Clusters,
        other => other,
    }
}

fn is_all_live(animation: &Animation) -> bool {
    animation.live_count() == animation.triangle_count()
}
