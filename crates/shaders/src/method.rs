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

/// Words of the buffer `blocked` for so many rays: one each, and for `exact` the list of those left open and as many notes
/// of two words (`wgsl/shared/notes.wgsl`).
#[must_use]
pub fn blocked_words(intersector: Intersector, rays: u64) -> u64 {
    match intersector {
        Intersector::Exact => 4 * rays,
        _ => rays,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn woop_names_its_triangles_behind_the_rows() {
        for (leaves, rows) in [(1, 4), (4, 13), (5, 17)] {
            assert_eq!(record_bytes(Intersector::Woop, leaves), 16 * rows);
        }
    }
}
