//! Sorts a node's triangles into bins along each axis, and finds the best plane between two bins.

use crate::prim::{Prim, PrimBounds, Ruler};
use glam::Vec4;
use rayon::join;

#[cfg(target_arch = "x86_64")]
mod avx2;

/// Maximum number of bins along each axis; a power of two.
pub(crate) const BINS: usize = 64;

/// Mean number of triangles per bin, unless a node would have fewer than [`LEAST_BINS`] or more than [`BINS`] bins.
const PER_BIN: usize = 4;
const LEAST_BINS: usize = 8;

/// Maximum number of triangles that a parallel task bins or moves. It does not depend on the number of threads.
pub(crate) const CHUNK: usize = 8192;

/// Number of triangles that a ray tests at once. The heuristic counts blocks of this size (Embree's `sahBlockSize`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BlockSize {
    /// Single triangles.
    #[default]
    One,
    /// Blocks of up to eight triangles.
    Eight,
}

impl BlockSize {
    pub(crate) fn triangles(self) -> usize {
        match self {
            Self::One => 1,
            Self::Eight => 8,
        }
    }
}

/// Number of triangles in each bin, axis by axis.
pub(crate) type BinCounts = [[u32; BINS]; 3];

/// Maps a centre to its bin: `(center - base) * scale`, rounded to nearest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    bins: usize,
    base: Vec4,
    scale: Vec4,
}

impl Grid {
    /// Adding this to a number in `0..2^22` rounds the number to an integer, which the low bits of the sum hold.
    const ROUND: f32 = (1 << 23) as f32;

    /// Creates bins for `n` triangles over `centers`. On an axis without extent, all triangles are in bin 0.
    pub(crate) fn new(centers: &PrimBounds, n: usize) -> Self {
        let bins = (n / PER_BIN).clamp(LEAST_BINS, BINS);
        let scale = centers.extent().to_array().map(|e| {
            if e > Ruler::LEAST {
                (bins - 1) as f32 / e
            } else {
                0.0
            }
        });
        Self {
            bins,
            base: centers.lo,
            scale: Vec4::from_array(scale).with_w(0.0),
        }
    }

    /// Returns the bins of a box as floats, offset by [`Self::ROUND`].
    #[inline]
    fn place(&self, prim: &Prim) -> Vec4 {
        (prim.center() - self.base) * self.scale + Vec4::splat(Self::ROUND)
    }

    #[inline]
    fn bins_of(&self, prim: &Prim) -> [usize; 3] {
        let [x, y, z, _] = self.place(prim).to_array();
        [x, y, z].map(|p| p.to_bits() as usize % BINS)
    }
}

/// A split plane: triangles in bins below `bin` of `axis` go left.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    grid: Grid,
    pub(crate) axis: usize,
    pub(crate) bin: usize,
    /// Least [`Grid::place`] on the right, in the lane of `axis`. Minus infinity in the other lanes.
    limit: Vec4,
}

impl Plane {
    fn new(grid: Grid, axis: usize, bin: usize) -> Self {
        let mut limit = Vec4::NEG_INFINITY;
        limit[axis] = Grid::ROUND + bin as f32;
        Self {
            grid,
            axis,
            bin,
            limit,
        }
    }

    #[inline]
    pub(crate) fn is_left(&self, prim: &Prim) -> bool {
        self.grid.place(prim).cmplt(self.limit).any()
    }

    /// Returns the number of counted triangles on the left.
    pub(crate) fn left_of(&self, counts: &BinCounts) -> usize {
        counts[self.axis][..self.bin].iter().sum::<u32>() as usize
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Bins {
    boxes: [[PrimBounds; BINS]; 3],
    pub(crate) counts: BinCounts,
}

impl Bins {
    pub(crate) const NO_COUNTS: BinCounts = [[0; BINS]; 3];
    pub(crate) const EMPTY: Self = Self {
        boxes: [[PrimBounds::EMPTY; BINS]; 3],
        counts: Self::NO_COUNTS,
    };

    /// Adds `prims` to the bins sequentially.
    #[inline(never)]
    pub(crate) fn add(&mut self, prims: &[Prim], grid: &Grid) {
        #[cfg(target_arch = "x86_64")]
        if let Some(add) = avx2::add() {
            return add(self, prims, grid);
        }
        self.add_each(prims, grid);
    }

    fn add_each(&mut self, prims: &[Prim], grid: &Grid) {
        for prim in prims {
            for (axis, bin) in grid.bins_of(prim).into_iter().enumerate() {
                self.boxes[axis][bin].grow(&prim.bounds);
                self.counts[axis][bin] += 1;
            }
        }
    }

    /// Adds `prims` to empty bins by chunks in parallel. Writes each chunk's counts to `counts`.
    ///
    /// Takes references, because bins are large and the stack must hold few at once.
    pub(crate) fn add_parallel(&mut self, prims: &[Prim], grid: &Grid, counts: &mut [BinCounts]) {
        if let [only] = counts {
            self.add(prims, grid);
            *only = self.counts;
            return;
        }
        let half = counts.len() / 2;
        let (first, second) = prims.split_at(half * CHUNK);
        let (counts_a, counts_b) = counts.split_at_mut(half);
        let mut other = Self::EMPTY;
        join(
            || self.add_parallel(first, grid, counts_a),
            || other.add_parallel(second, grid, counts_b),
        );
        self.merge(&other);
    }

    fn merge(&mut self, other: &Self) {
        for axis in 0..3 {
            for bin in 0..BINS {
                self.boxes[axis][bin].grow(&other.boxes[axis][bin]);
                self.counts[axis][bin] += other.counts[axis][bin];
            }
        }
    }

    fn column(&self, bin: usize) -> Column {
        let count = |axis: usize| self.counts[axis][bin] as f32;
        Column {
            boxes: [0, 1, 2].map(|axis| self.boxes[axis][bin]),
            triangles: Vec4::new(count(0), count(1), count(2), 0.0),
        }
    }

    /// Returns the plane of least cost by the surface area heuristic. `None` if every axis has all triangles in one
    /// bin.
    #[inline(never)]
    pub(crate) fn best_plane(
        &self,
        node: &PrimBounds,
        grid: &Grid,
        block_size: BlockSize,
    ) -> Option<Plane> {
        let column = |bin| self.column(bin);
        let cuts = Cuts::<BINS>::of(grid.bins, column, Ruler::new(node), block_size);
        let axis = cuts.least_axis()?;
        Some(Plane::new(*grid, axis, cuts.best_left[axis] as usize))
    }

    pub(crate) fn sides(&self, plane: &Plane) -> [PrimBounds; 2] {
        let (left, right) = self.boxes[plane.axis].split_at(plane.bin);
        [left, right].map(|side| {
            side.iter()
                .copied()
                .fold(PrimBounds::EMPTY, PrimBounds::union)
        })
    }
}

/// Each axis has a row of boxes: its bins, or its sorted triangles. A column holds the three boxes at one index, and
/// their numbers of triangles in one lane per axis.
#[derive(Clone, Copy)]
pub(crate) struct Column {
    pub(crate) boxes: [PrimBounds; 3],
    pub(crate) triangles: Vec4,
}

impl Column {
    const EMPTY: Self = Self {
        boxes: [PrimBounds::EMPTY; 3],
        triangles: Vec4::ZERO,
    };

    #[inline(always)]
    fn add(&mut self, other: Self) {
        let boxes = self.boxes.iter_mut().zip(other.boxes);
        boxes.for_each(|(b, c)| b.grow(&c));
        self.triangles += other.triangles;
    }
}

/// Costs of dividing each axis's row of boxes into a left and a right part, in one lane per axis.
pub(crate) struct Cuts<const N: usize> {
    /// Cost of each cut. The index is the number of boxes on the left.
    pub(crate) costs: [Vec4; N],
    /// Least costs.
    pub(crate) best: Vec4,
    /// Numbers of boxes on the left at the least costs.
    pub(crate) best_left: Vec4,
}

impl<const N: usize> Cuts<N> {
    /// Evaluates all cuts of a row of `n` boxes. `column` returns the boxes at an index.
    ///
    /// An empty side costs infinity times zero, which is NaN and never the least.
    #[inline(always)]
    pub(crate) fn of(
        n: usize,
        column: impl Fn(usize) -> Column,
        ruler: Ruler,
        block_size: BlockSize,
    ) -> Self {
        match block_size {
            BlockSize::One => Self::by(n, column, ruler, |triangles| triangles),
            BlockSize::Eight => Self::by(n, column, ruler, eights),
        }
    }

    #[inline(always)]
    fn by(
        n: usize,
        column: impl Fn(usize) -> Column,
        ruler: Ruler,
        blocks: impl Fn(Vec4) -> Vec4,
    ) -> Self {
        let cost_of = |side: &Column| ruler.half_areas(&side.boxes) * blocks(side.triangles);
        let mut costs = [Vec4::NAN; N];
        let mut side = Column::EMPTY;
        for left in (1..n).rev() {
            side.add(column(left));
            // `left` is below `N`: `% N` removes the bounds check.
            costs[left % N] = cost_of(&side);
        }
        let (mut best, mut best_left) = (Vec4::INFINITY, Vec4::ONE);
        side = Column::EMPTY;
        for left in 1..n {
            side.add(column(left - 1));
            let cost = cost_of(&side) + costs[left % N];
            let better = cost.cmplt(best);
            best = Vec4::select(better, cost, best);
            best_left = Vec4::select(better, Vec4::splat(left as f32), best_left);
            costs[left % N] = cost;
        }
        Self {
            costs,
            best,
            best_left,
        }
    }

    /// Returns the first axis of least cost, if that cost is finite.
    pub(crate) fn least_axis(&self) -> Option<usize> {
        let least = |a, b| if self.best[b] < self.best[a] { b } else { a };
        let axis = (0..3).reduce(least)?;
        self.best[axis].is_finite().then_some(axis)
    }
}

/// Returns `triangles / 8` rounded up. Computed by adding 7/16 and rounding to nearest.
#[inline(always)]
fn eights(triangles: Vec4) -> Vec4 {
    let round = Vec4::splat(Grid::ROUND);
    (triangles / 8.0 + Vec4::splat(7.0 / 16.0) + round) - round
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builder::tests::sized;
    use crate::prim::PrimExtents;
    use geom::Aabb;
    use proptest::prelude::*;

    fn prim(corners: &[i16; 6], triangle: u32) -> Prim {
        let [a, b, c, x, y, z] = corners.map(f32::from);
        Prim::new(&sized([a, b, c], [x, y, z].map(f32::abs)), triangle)
    }

    /// Returns the area of one side of a plane times its number of blocks.
    fn side_cost(side: &[&Prim], block_size: BlockSize) -> f64 {
        let boxes = side.iter().map(|p| p.bounds.aabb());
        boxes.fold(Aabb::EMPTY, Aabb::union).half_area()
            * side.len().div_ceil(block_size.triangles()) as f64
    }

    proptest! {
        #[test]
        fn best_plane_has_minimal_cost(
            corners in prop::collection::vec(prop::array::uniform6(-90_i16..90), 2..300),
            size in prop::sample::select(vec![BlockSize::One, BlockSize::Eight]),
        ) {
            let prims: Vec<_> = corners.iter().zip(0..).map(|(c, i)| prim(c, i)).collect();
            let extents = PrimExtents::of(&prims);
            let grid = Grid::new(&extents.centers, prims.len());
            let mut bins = Bins::EMPTY;
            bins.add(&prims, &grid);
            prop_assert!(bins.counts.iter().all(|c| c.iter().sum::<u32>() as usize == prims.len()));
            let cost = |plane: &Plane| {
                let (left, right): (Vec<_>, Vec<_>) = prims.iter().partition(|p| plane.is_left(p));
                let all = !left.is_empty() && !right.is_empty();
                all.then(|| side_cost(&left, size) + side_cost(&right, size))
            };
            let planes = (0..3).flat_map(|axis| (1..grid.bins).map(move |bin| (axis, bin)));
            let best = planes
                .filter_map(|(axis, bin)| cost(&Plane::new(grid, axis, bin)))
                .fold(f64::MAX, f64::min);
            let Some(plane) = bins.best_plane(&extents.boxes, &grid, size) else {
                prop_assert_eq!(best, f64::MAX);
                return Ok(());
            };
            let found = cost(&plane).expect("both sides hold something");
            // The tolerance covers the padding of edges and single precision.
            prop_assert!(found <= best * (1.0 + 1e-4), "{found} {best}");
        }
    }

    #[test]
    fn outermost_centers_use_outermost_bins() {
        for far in [1.0, 0.1, 3.3e7, 1e-30] {
            let ends = [-0.7 * far, far].map(|x: f32| sized([x; 3], [0.0; 3]));
            let prims = [Prim::new(&ends[0], 0), Prim::new(&ends[1], 1)];
            let grid = Grid::new(&PrimExtents::of(&prims).centers, 1000);
            let bins = prims.map(|p| grid.bins_of(&p));
            assert_eq!(bins, [[0; 3], [BINS - 1; 3]], "{far}");
        }
    }
}
