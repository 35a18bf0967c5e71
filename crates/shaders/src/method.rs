//! Which variants of kernels a method takes, and how much room.

use crate::{BufferName, Shape};
use backend::{Intersector, Layout, Method};

/// The value along `axis` of the kernels that serve `method`: the host's half of `build/variants.rs`.
pub(crate) fn value(axis: &str, method: Method) -> &'static str {
    match (axis, method.intersector) {
        ("intersector", Intersector::MollerTrumbore) => "moller_trumbore",
        ("intersector", Intersector::Woop) => "woop",
        ("intersector", Intersector::Watertight) => "watertight",
        ("intersector", Intersector::Exact) => "exact",
        ("layout", _) => method.layout.name(),
        (axis, _) => panic!("no axis is named {axis}"),
    }
}

/// Bytes of the buffer `records` for so many leaves, in whole rows of 16 bytes.
///
/// 48 a leaf, and for `woop`, whose transform fills them all, 4 more behind all of those: the triangle's index.
fn record_bytes(intersector: Intersector, leaves: u64) -> u64 {
    match intersector {
        Intersector::Woop => leaves * 48 + (leaves * 4).next_multiple_of(16),
        _ => leaves * 48,
    }
}

/// Bytes of the buffer `range`.
pub const RANGE_BYTES: u64 = 4 * (8 + geom::Range::SAMPLES as u64);

/// Bytes of each buffer that suffice for every tree of so many leaves; with layout `fast` but for nodes and costs.
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

/// Words of the buffer `blocked` for so many rays: one each, and for `exact` the list of those left open, notes
/// of three words (`wgsl/intersect/candidates.wgsl`), and places at which rays are settled one by one (`fallback.wgsl`).
pub fn occluded_words(intersector: Intersector, rays: u64) -> u64 {
    match intersector {
        Intersector::Exact => open_shadows_at(rays) + rays,
        _ => rays,
    }
}

/// Where the list of open shadows begins in `blocked`, while that of open rays is in use too.
pub(crate) fn open_shadows_at(rays: u64) -> u64 {
    2 * rays + 3 * notes(rays) + STACK * u64::from(places(rays))
}

/// Words of a place: its stack.
const STACK: u64 = 64;
/// Enough places to fill any device.
const PLACES: u32 = 2048;

/// Notes for few rays, of which each may be a hard one.
const NOTES: u64 = 1 << 16;

/// How many notes there is room for: as many as rays, unless those are few.
pub(crate) fn notes(rays: u64) -> u64 {
    rays.max(NOTES)
}

/// How many places there are for so many rays.
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
