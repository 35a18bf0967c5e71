//! Sorts a node's triangles into bins along each axis at one moment, and finds the best plane between two bins.

use super::lanes::{Boxes, Ruler};
use super::prims::Prims;

/// The most bins along each axis.
const BINS: usize = 16;
/// A node has a bin for so many triangles, but no fewer than half the most.
const PER_BIN: usize = 8;
/// Extents of centres below this are none.
const LEAST: f32 = 1.0 / (1_u64 << 60) as f32;

/// Boxes of a node's triangles, and boxes of their centres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extents {
    boxes: Boxes,
    centers: Boxes,
    bins: usize,
}

impl Extents {
    pub(super) fn of<'a>(ids: impl ExactSizeIterator<Item = &'a u32>, prims: &Prims) -> Self {
        let mut all = Self {
            boxes: Boxes::EMPTY,
            centers: Boxes::EMPTY,
            bins: (ids.len() / PER_BIN).clamp(BINS / 2, BINS),
        };
        for &id in ids {
            let b = prims.get(id);
            all.boxes.grow(b);
            let [x, y, z] = [0, 1, 2].map(|axis| b.centers(axis));
            let [u, v, w] = [x, y, z].map(|c| c.map(|c| -c));
            all.centers.grow(&Boxes {
                rows: [u, v, w, x, y, z],
            });
        }
        all
    }
}

/// Between two bins along an axis at one moment: lesser bins go left.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    lane: usize,
    axis: usize,
    grid: Grid,
    bin: usize,
}

impl Plane {
    #[inline]
    pub(super) fn is_left(&self, b: &Boxes) -> bool {
        self.grid.bin(b.center(self.axis, self.lane)) < self.bin
    }
}

/// From a centre to its bin.
#[derive(Clone, Copy, Debug)]
struct Grid {
    bins: usize,
    base: f32,
    scale: f32,
}

impl Grid {
    /// None where the centres have no extent.
    fn new(extents: &Extents, axis: usize, lane: usize) -> Option<Self> {
        let base = -extents.centers.rows[axis][lane];
        let extent = extents.centers.rows[axis + 3][lane] - base;
        (extent > LEAST).then(|| Self {
            bins: extents.bins,
            base,
            scale: extents.bins as f32 / extent,
        })
    }

    /// Centres beyond the extents fall into the outermost bins.
    #[inline]
    fn bin(self, center: f32) -> usize {
        (((center - self.base) * self.scale) as usize).min(self.bins - 1)
    }
}

/// What fell into each bin along one axis.
struct Bins {
    boxes: [Boxes; BINS],
    counts: [u32; BINS],
}

impl Bins {
    const EMPTY: Self = Self {
        boxes: [Boxes::EMPTY; BINS],
        counts: [0; BINS],
    };

    /// The least cost of a plane, and its bin. Every bin's side holds something, for the outermost are not empty.
    fn best(&self, bins: usize, ruler: Ruler<'_>) -> (f32, usize) {
        let mut right = [0.0; BINS];
        let (mut b, mut count) = (Boxes::EMPTY, 0);
        for bin in (1..bins).rev() {
            b.grow(&self.boxes[bin]);
            count += self.counts[bin];
            right[bin] = ruler.half_area(&b) * count as f32;
        }
        let mut best = (f32::INFINITY, 0);
        (b, count) = (Boxes::EMPTY, 0);
        for (bin, right) in right[..bins].iter().enumerate().skip(1) {
            b.grow(&self.boxes[bin - 1]);
            count += self.counts[bin - 1];
            let cost = ruler.half_area(&b) * count as f32 + right;
            if cost < best.0 {
                best = (cost, bin);
            }
        }
        best
    }
}

/// The best plane at one moment with its cost, in the order of the axes.
#[inline(never)]
pub(super) fn best_plane<'a>(
    ids: impl Iterator<Item = &'a u32>,
    prims: &Prims,
    extents: &Extents,
    lane: usize,
) -> Option<(f32, Plane)> {
    let grids = [0, 1, 2].map(|axis| Grid::new(extents, axis, lane));
    let mut bins = [Bins::EMPTY; 3];
    for &id in ids {
        let b = prims.get(id);
        for (axis, (bins, grid)) in bins.iter_mut().zip(&grids).enumerate() {
            if let Some(grid) = grid {
                let bin = grid.bin(b.center(axis, lane));
                bins.boxes[bin].grow(b);
                bins.counts[bin] += 1;
            }
        }
    }
    let ruler = Ruler::new(&extents.boxes, &prims.weights);
    let mut best: Option<(f32, Plane)> = None;
    for (axis, (bins, grid)) in bins.iter().zip(grids).enumerate() {
        let Some(grid) = grid else { continue };
        let (cost, bin) = bins.best(grid.bins, ruler);
        if best.is_none_or(|(least, _)| cost < least) {
            let plane = Plane {
                lane,
                axis,
                grid,
                bin,
            };
            best = Some((cost, plane));
        }
    }
    best
}
