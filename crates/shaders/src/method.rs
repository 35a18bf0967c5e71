//! Which methods the kernels know, and what room they take.

use backend::{Intersector, Method};

/// Whether a scene can be loaded to be traced by `method`: by any. Asks no device.
#[must_use]
pub fn supports(_: Method) -> bool {
    true
}

/// Bytes of the buffer `records` for so many leaves, in whole rows of 16 bytes.
///
/// 48 a leaf, and for `woop`, whose transform fills them all, 4 more behind all of those: the triangle's index.
#[must_use]
pub fn record_bytes(intersector: Intersector, leaves: u64) -> u64 {
    match intersector {
        Intersector::Woop => leaves * 48 + (leaves * 4).next_multiple_of(16),
        _ => leaves * 48,
    }
}

/// Words of the buffer `blocked` for so many rays: one each, and for `exact` the list of those left open, notes
/// of three words (`wgsl/intersect/notes.wgsl`), and places at which rays are settled one by one (`fallback.wgsl`).
#[must_use]
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
    use crate::kernel;
    use backend::{Layout, Method};

    #[test]
    fn a_place_has_room_for_a_stack_as_deep_as_the_searchs() {
        let method = Method {
            intersector: Intersector::Exact,
            layout: Layout::Bvh2,
        };
        let says =
            |entry: &str, what: &str| assert!(kernel(entry, method).code.wgsl.contains(what));
        says("fallback_rays", &format!("const STACK: u32 = {STACK}u;"));
        says("trace_rays", &format!("var stack: array<u32, {STACK}>;"));
    }

    #[test]
    fn the_host_counts_on_as_many_candidates_at_once_as_kernels_take() {
        let method = Method {
            intersector: Intersector::Exact,
            layout: Layout::Bvh2,
        };
        let wgsl = kernel("resolve_exact_together", method).code.wgsl;
        let abreast = crate::work::ABREAST;
        assert!(wgsl.contains(&format!("const ABREAST: u32 = {abreast}u;")));
    }

    #[test]
    fn woop_names_its_triangles_behind_the_rows() {
        for (leaves, rows) in [(1, 4), (4, 13), (5, 17)] {
            assert_eq!(record_bytes(Intersector::Woop, leaves), 16 * rows);
        }
    }
}
