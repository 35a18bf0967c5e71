//! Parameters and limits that all nodes of a build share.

use crate::MAX_DEPTH;
use crate::bins::BlockSize;
use crate::cancel::Cancel;
use crate::occluder_first::reach;
use crate::prim::PrimBounds;
use geom::Point;

#[derive(Clone, Copy)]
pub(crate) struct BuildTask<'a> {
    pub(crate) cancel: &'a Cancel,
    /// Point that children are ordered toward, if any.
    pub(crate) toward: Option<Point>,
    pub(crate) block_size: BlockSize,
}

impl BuildTask<'_> {
    /// Returns whether the right side of a plane comes first.
    pub(crate) fn right_first(self, sides: [PrimBounds; 2]) -> bool {
        self.toward.is_some_and(|point| {
            let [left, right] = sides.map(|b| reach(&b.aabb(), point));
            right < left
        })
    }
}

/// Returns whether a node of `leaves` leaves at `depth` can stay within [`MAX_DEPTH`] by halving.
pub(crate) fn fits(leaves: usize, depth: u32) -> bool {
    depth + leaves.next_power_of_two().trailing_zeros() <= MAX_DEPTH
}
