//! Kernel variants and buffer sizes of a method.

use crate::{BufferName, Shape};
use backend::{Intersector, Layout, Method};

/// Returns the value along `axis` of the kernels that serve `method`: the host's part of `build/variants.rs`.
pub(crate) fn value(axis: &str, method: Method) -> String {
    match axis {
        "intersector" => method.intersector.name().replace('-', "_"),
        "layout" => method.layout.name().to_owned(),
        axis => panic!("no axis is named {axis}"),
    }
}

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
pub const RANGE_BYTES: u64 = 4 * (8 + geom::Range::SAMPLES as u64);

/// Returns the size of each buffer, in bytes, that suffices for every tree of `leaves` leaves. With layout `fast`, nodes
/// and costs are excluded.
pub fn tree_buffers(method: Method, leaves: u64) -> [(BufferName, u64); 6] {
    let usual = |bytes| match method.layout {
        Layout::Bvh2 => bytes,
        Layout::Fast => 0,
    };
    let nodes = (2 * leaves).saturating_sub(1);
    [
        (BufferName::LeafNodes, usual(leaves * 4)),
        (BufferName::InnerNodes, usual(leaves * 4)),
        (BufferName::LeafCorners, leaves * 12 - usual(leaves * 12)),
        (
            BufferName::Records,
            record_bytes(method.intersector, leaves),
        ),
        (BufferName::Nodes, usual(nodes * 32)),
        (BufferName::Costs, usual(Shape::cost_bytes(leaves))),
    ]
}

/// Returns the size of the buffer `occluded` for `rays` rays, in words: one per ray. `exact` adds the list of open rays,
/// notes of three words (`wgsl/intersect/candidates.wgsl`), and the stacks of `fallback.wgsl`.
pub fn occluded_words(intersector: Intersector, rays: u64) -> u64 {
    match intersector {
        Intersector::Exact => open_shadows_at(rays) + rays,
        _ => rays,
    }
}

/// Returns where the list of open shadow rays begins in `occluded`, if the list of open rays is in use too.
pub(crate) fn open_shadows_at(rays: u64) -> u64 {
    2 * rays + 3 * notes(rays) + STACK * u64::from(places(rays))
}

/// Number of words of a stack.
const STACK: u64 = 64;
/// Number of stacks that fills any device.
const PLACES: u32 = 2048;

/// Number of notes if rays are few, since each may need many.
const NOTES: u64 = 1 << 16;

/// Returns the capacity for notes: one per ray, but at least `NOTES`.
pub(crate) fn notes(rays: u64) -> u64 {
    rays.max(NOTES)
}

/// Returns the number of stacks for `rays` rays.
pub(crate) fn places(rays: u64) -> u32 {
    rays.min(PLACES.into()) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{KERNELS, kernel};
    use std::collections::BTreeSet;

    #[test]
    fn every_method_has_each_kernel_once() {
        let pairs = Intersector::ALL.map(|i| Layout::ALL.map(|l| (i, l)));
        for (intersector, layout) in pairs.into_iter().flatten() {
            let method = Method {
                intersector,
                layout,
            };
            let serving: Vec<_> = KERNELS.iter().filter(|k| k.serves(method)).collect();
            let entries: BTreeSet<_> = serving.iter().map(|k| k.entry).collect();
            assert_eq!(serving.len(), entries.len(), "{method:?}");
            assert!(entries.contains("trace_rays") && entries.contains("preprocess"));
        }
        let names: BTreeSet<_> = KERNELS.iter().map(|k| k.name).collect();
        assert_eq!(names.len(), KERNELS.len());
    }

    #[test]
    fn the_host_makes_room_for_what_kernels_take_at_once() {
        let method = Method {
            intersector: Intersector::Exact,
            layout: Layout::Bvh2,
        };
        let says =
            |entry: &str, what: &str| assert!(kernel(entry, method).code.wgsl.contains(what));
        says("fallback_rays", &format!("const STACK: u32 = {STACK}u;"));
        says("trace_rays", &format!("var stack: array<u32, {STACK}>;"));
        let abreast = format!("const ABREAST: u32 = {}u;", crate::work::ABREAST);
        says("resolve_exact_together", &abreast);
    }

    #[test]
    fn woop_names_its_triangles_behind_the_rows() {
        for (leaves, rows) in [(1, 4), (4, 13), (5, 17)] {
            assert_eq!(record_bytes(Intersector::Woop, leaves), 16 * rows);
        }
    }
}
