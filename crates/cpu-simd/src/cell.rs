//! As many rays of a picture as a packet has lanes: neighbouring pixels.

use crate::rays::Given;
use crate::simd::{Lanes, each};
use cpu_ref::tiles::Tiles;
use geom::Camera;

/// Columns of a cell of pixels; its rows follow from the lanes.
pub(crate) const COLUMNS: usize = 4;

/// A few columns and rows of a picture. Lanes go row by row; those beyond the edge repeat the last ones.
pub(crate) struct Cell {
    /// Lanes within the picture.
    pub(crate) asked: u32,
    lanes: usize,
    /// Upper left pixel.
    corner: [usize; 2],
    /// The last pixel of the cell within the picture.
    last: [usize; 2],
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
            corner,
            last: [corner[0] + columns - 1, corner[1] + rows - 1],
        }
    }

    #[inline(always)]
    fn pixel(&self, lane: usize) -> [usize; 2] {
        let (x, y) = (lane % COLUMNS, lane / COLUMNS);
        [
            (self.corner[0] + x).min(self.last[0]),
            (self.corner[1] + y).min(self.last[1]),
        ]
    }

    /// The camera's rays, as [`Camera::ray`] has them.
    #[inline(always)]
    pub(crate) fn rays<L: Lanes>(&self, camera: &Camera) -> Given<L> {
        Given {
            origin: each!(i => L::splat(camera.eye[i])),
            direction: self.directions(camera),
            limits: [L::splat(0.0), L::splat(f32::INFINITY)],
        }
    }

    #[inline(always)]
    fn directions<L: Lanes>(&self, camera: &Camera) -> [L; 3] {
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
