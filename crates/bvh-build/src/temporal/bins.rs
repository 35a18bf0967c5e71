//! Sorts a node's triangles into bins along each axis at one moment, and finds the best plane between two bins.

use super::lanes::{Boxes, Ruler};
use super::prims::Prims;

/// The most bins along each axis.
pub(super) const BINS: usize = 16;
/// A node has a bin for so many triangles, but no fewer than half the most.
const PER_BIN: usize = 8;
/// Extents of centres below this are none.
const LEAST: f32 = 1.0 / (1_u64 << 60) as f32;

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

struct Bins {
    boxes: [Boxes; BINS],
    counts: [u32; BINS],
}

impl Bins {
    const EMPTY: Self = Self {
        boxes: [Boxes::EMPTY; BINS],
        counts: [0; BINS],
    };
}

/// The costs of all cuts of a row of `n` boxes, each with a number of triangles, by how many boxes go left; and the least of
/// them, the first of equals.
#[inline]
pub(super) fn cuts<'a>(
    n: usize,
    item: impl Fn(usize) -> (&'a Boxes, u32),
    ruler: Ruler<'_>,
) -> ([f32; BINS], (f32, usize)) {
    let mut costs = [0.0; BINS];
    let (mut b, mut count) = (Boxes::EMPTY, 0);
    for left in (1..n).rev() {
        let (next, its_count) = item(left);
        b.grow(next);
        count += its_count;
        costs[left] = ruler.half_area(&b) * count as f32;
    }
    let mut best = (f32::INFINITY, n / 2);
    (b, count) = (Boxes::EMPTY, 0);
    for (left, cost) in costs[..n].iter_mut().enumerate().skip(1) {
        let (next, its_count) = item(left - 1);
        b.grow(next);
        count += its_count;
        *cost += ruler.half_area(&b) * count as f32;
        if *cost < best.0 {
            best = (*cost, left);
        }
    }
    (costs, best)
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
        // Every cut's sides hold something, for the outermost bins are not empty.
        let row = |bin: usize| (&bins.boxes[bin], bins.counts[bin]);
        let (_, (cost, bin)) = cuts(grid.bins, row, ruler);
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
