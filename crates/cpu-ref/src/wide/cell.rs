//! Neighbouring pixels, as many as a packet has lanes.

use crate::packets::{Packets, Sink};
use crate::simd::{Lanes, each};
use geom::Camera;

/// Columns of a cell; its rows follow from the lanes.
pub(crate) const COLUMNS: usize = 4;

/// A few columns and rows of a picture. Lanes go row by row; those beyond the picture's edge repeat its last pixels.
pub(crate) struct Cell {
    /// Lanes within the picture.
    pub(crate) asked: u32,
    pub(crate) lanes: usize,
    /// Upper left pixel.
    corner: [usize; 2],
    /// The last pixel of the cell within the picture.
    last: [usize; 2],
    /// Columns of the picture.
    width: usize,
}

impl Cell {
    /// The cell whose upper left entry among those of `packets` is `at`.
    #[inline(always)]
    pub(crate) fn new<O: Sink>(packets: &Packets<O>, at: [usize; 2], size: [usize; 2]) -> Self {
        let (index, width) = (packets.index(at[0], at[1]), packets.width());
        let corner = [index % width, index / width];
        let columns = size[0].min(packets.columns() - at[0]);
        let rows = size[1].min(packets.height() - at[1]);
        let row = (1 << columns) - 1;
        let mut asked = 0;
        for y in 0..rows {
            asked |= row << (y * size[0]);
        }
        Self {
            asked,
            lanes: size[0] * size[1],
            corner,
            last: [corner[0] + columns - 1, corner[1] + rows - 1],
            width,
        }
    }

    #[inline(always)]
    fn pixel(&self, lane: usize) -> [usize; 2] {
        [
            (self.corner[0] + lane % COLUMNS).min(self.last[0]),
            (self.corner[1] + lane / COLUMNS).min(self.last[1]),
        ]
    }

    /// The index of a lane's ray in the picture.
    #[inline(always)]
    pub(crate) fn index(&self, lane: usize) -> usize {
        let [x, y] = self.pixel(lane);
        y * self.width + x
    }

    /// Directions of the camera's rays, as [`Camera::ray`] has them.
    #[inline(always)]
    pub(crate) fn directions<L: Lanes>(&self, camera: &Camera) -> [L; 3] {
        let (mut x, mut y) = (L::splat(0.0).store(), L::splat(0.0).store());
        for lane in 0..self.lanes {
            let pixel = self.pixel(lane);
            x.as_mut()[lane] = pixel[0] as f32 + 0.5;
            y.as_mut()[lane] = pixel[1] as f32 + 0.5;
        }
        let (x, y) = (L::load(&x), L::load(&y));
        each!(i => {
            L::splat(camera.corner[i])
                .add(x.mul(L::splat(camera.across[i])))
                .add(y.mul(L::splat(camera.down[i])))
        })
    }
}
