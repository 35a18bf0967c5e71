//! What a device needs to make trees.

use super::{DIGITS, PARTS, SORT_TILE, phases};

/// Bytes of each buffer, by the kernels' names, beside those that any tree takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Room {
    /// The live triangles, filled by the host; also the numbers from 0 on.
    pub live: u64,
    /// Twice: before a pass and after it.
    pub keys: u64,
    /// Likewise.
    pub sorted: u64,
    /// How often each value of a digit occurs in each tile, and in all.
    pub digits: u64,
    /// Parts of the box round the scene.
    pub boxes: u64,
    /// Clusters before a phase and after it, 32 bytes each.
    pub clusters: u64,
}

impl Room {
    /// For a scene of so many live triangles.
    #[must_use]
    pub fn of(leaves: u32) -> Self {
        let count = u64::from(leaves);
        let tiles = count.div_ceil(u64::from(SORT_TILE));
        let survivors = phases::of(leaves.max(1))[0].left();
        Self {
            live: count * 4,
            keys: count * 8,
            sorted: count * 8,
            digits: (tiles + 1) * u64::from(DIGITS) * 4,
            boxes: u64::from(PARTS) * 32,
            clusters: (count + u64::from(survivors)) * 32,
        }
    }
}
