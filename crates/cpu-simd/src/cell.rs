//! As many rays as a packet has lanes: neighbouring pixels, or neighbours in a list.

use crate::simd::{Lanes, each};
use crate::together::MOST_RAYS;
use cpu_ref::tiles::Tiles;
use cpu_ref::trace::TraceTask;
use geom::{Camera, Ray};

/// Columns of a cell of pixels; its rows follow from the lanes.
pub(crate) const COLUMNS: usize = 1 << COLUMN_BITS;
const COLUMN_BITS: usize = 2;

/// Cannot hit anything.
const NO_RAY: Ray = Ray {
    origin: [0.0; 3],
    t_min: 0.0,
    direction: [0.0; 3],
    t_max: 0.0,
};

/// A few columns and rows of a picture, or a row of a list. Lanes go row by row; those beyond the edge repeat the last ones.
pub(crate) struct Cell {
    /// Lanes within the picture.
    pub(crate) asked: u32,
    lanes: usize,
    column_bits: usize,
    /// Upper left pixel.
    corner: [usize; 2],
    /// The last pixel of the cell within the picture.
    last: [usize; 2],
    /// Columns of the picture.
    width: usize,
}

impl Cell {
    /// The cell whose upper left entry among those of `tiles` is `at`.
    #[inline(always)]
    pub(crate) fn new(tiles: &Tiles<'_>, at: [usize; 2], rows: usize) -> Self {
        let (index, width) = (tiles.index(at[0], at[1]), tiles.width());
        let corner = [index % width, index / width];
        let lanes = COLUMNS * rows;
        let columns = COLUMNS.min(tiles.columns() - at[0]);
        let rows = rows.min(tiles.height() - at[1]);
        let row = (1 << columns) - 1;
        let mut asked = 0;
        for y in 0..rows {
            asked |= row << (y * COLUMNS);
        }
        Self {
            asked,
            lanes,
            column_bits: COLUMN_BITS,
            corner,
            last: [corner[0] + columns - 1, corner[1] + rows - 1],
            width,
        }
    }

    /// Neighbours in a list.
    #[inline(always)]
    pub(crate) fn row(first: usize, count: usize) -> Self {
        Self {
            asked: (1 << count) - 1,
            lanes: MOST_RAYS,
            column_bits: MOST_RAYS.ilog2() as usize,
            corner: [first, 0],
            last: [first + count - 1, 0],
            width: 0,
        }
    }

    #[inline(always)]
    fn pixel(&self, lane: usize) -> [usize; 2] {
        let (x, y) = (
            lane & ((1 << self.column_bits) - 1),
            lane >> self.column_bits,
        );
        [
            (self.corner[0] + x).min(self.last[0]),
            (self.corner[1] + y).min(self.last[1]),
        ]
    }

    /// The index of a lane's ray.
    #[inline(always)]
    pub(crate) fn index(&self, lane: usize) -> usize {
        let [x, y] = self.pixel(lane);
        y * self.width + x
    }

    /// One a lane.
    #[inline(always)]
    pub(crate) fn rays(&self, of: &TraceTask<'_>) -> [Ray; MOST_RAYS] {
        let mut rays = [NO_RAY; MOST_RAYS];
        for (lane, to) in rays.iter_mut().enumerate() {
            if self.asked >> lane & 1 == 1 {
                *to = of.ray(self.index(lane));
            }
        }
        rays
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
