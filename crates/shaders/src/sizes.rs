//! Sizes of buffers, and of the lists that kernels keep in them.

use crate::BufferName;
use backend::Intersector;

/// Returns the size of the buffer `records` for `leaves` leaves, in bytes, a multiple of 16.
///
/// Each leaf has 48 bytes. The transform of `woop` fills them all, so the triangle indices follow, 4 bytes each.
fn record_bytes(intersector: Intersector, leaves: u64) -> u64 {
    match intersector {
        Intersector::Woop => leaves * 48 + (leaves * 4).next_multiple_of(16),
        _ => leaves * 48,
    }
}

/// Size of the buffer `range`, in bytes.
pub const RANGE_BYTES: u64 = 4 * (8 + geom::CoordinateRange::SAMPLES as u64);

/// Returns the size of each buffer of a tree, except its topology, in bytes. It is enough for every tree of `leaves`
/// leaves. Exceptions: `nodes` fits only the root, and `costs` is empty. Their sizes depend on the tree: see
/// [`crate::Shape`].
pub fn tree_buffers(intersector: Intersector, leaves: u64) -> [(BufferName, u64); 4] {
    [
        (BufferName::LeafCorners, leaves * 12),
        (BufferName::Records, record_bytes(intersector, leaves)),
        (BufferName::Nodes, 64),
        (BufferName::Costs, 0),
    ]
}

/// Returns the size of the buffer `occluded` for `rays` rays, in words: one per ray. `exact` adds the list of
/// undecided rays, candidates of two words (`wgsl/intersect/candidates.wgsl`), the stacks of `fallback.wgsl`, and
/// the list of undecided shadow rays.
pub fn occluded_words(intersector: Intersector, rays: u64) -> u64 {
    match intersector {
        Intersector::Exact => undecided_shadows_at(rays) + rays,
        _ => rays,
    }
}

/// Returns the word of `occluded` where the list of undecided shadow rays begins in kernels that use both lists. Other
/// kernels store it in place of the list of undecided rays.
pub(crate) fn undecided_shadows_at(rays: u64) -> u64 {
    2 * rays + 2 * candidate_capacity(rays) + STACK_SIZE * u64::from(fallback_workers(rays))
}

/// Number of words of a stack.
const STACK_SIZE: u64 = 64;
/// Maximum number of stacks, one per worker. One of 16 invocations is a worker (wgsl/intersect/fallback.wgsl). So a
/// dispatch has up to 32,768 invocations, which occupies any device.
const MAX_WORKERS: u32 = 2048;

/// Minimum capacity for candidates. Even a single ray may need many candidates.
const MIN_CANDIDATES: u64 = 1 << 16;

/// Returns the capacity for candidates: one per ray, but at least `MIN_CANDIDATES`.
pub(crate) fn candidate_capacity(rays: u64) -> u64 {
    rays.max(MIN_CANDIDATES)
}

/// Returns the number of stacks for `rays` rays.
pub(crate) fn fallback_workers(rays: u64) -> u32 {
    rays.min(MAX_WORKERS.into()) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{KERNELS, kernel};
    use std::collections::BTreeSet;

    #[test]
    fn every_intersector_has_each_kernel_once() {
        for intersector in Intersector::ALL {
            let serving: Vec<_> = KERNELS.iter().filter(|k| k.serves(intersector)).collect();
            let entries: BTreeSet<_> = serving.iter().map(|k| k.entry).collect();
            assert_eq!(serving.len(), entries.len(), "{intersector:?}");
            assert!(entries.contains("trace_rays") && entries.contains("preprocess_treelets"));
        }
        let names: BTreeSet<_> = KERNELS.iter().map(|k| k.name).collect();
        assert_eq!(names.len(), KERNELS.len());
    }

    #[test]
    fn host_constants_match_kernel_sources() {
        let exact = |entry| kernel(entry, Intersector::Exact);
        exact("fallback_rays").assert_declares("STACK_SIZE", STACK_SIZE as u32);
        let stack = format!("var stack: array<u32, {STACK_SIZE}>;");
        assert!(exact("trace_rays").code.wgsl.contains(&stack), "{stack}");
    }

    #[test]
    fn woop_records_append_triangle_indices() {
        for (leaves, rows) in [(1, 4), (4, 13), (5, 17)] {
            assert_eq!(record_bytes(Intersector::Woop, leaves), 16 * rows);
        }
    }
}
