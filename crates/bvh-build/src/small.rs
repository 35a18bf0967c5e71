//! Builds subtrees of few triangles by a full sweep, which evaluates every plane between neighbours along each axis.

use crate::bins::{BlockSize, Column, Cuts};
use crate::prim::{Prim, PrimBounds, Ruler};
use crate::task::{BuildTask, fits};
use crate::tiny;
use crate::tree::SubtreeSlot;
use geom::Point;
use glam::Vec4;

/// Maximum number of triangles of a subtree built here.
pub(crate) const MOST: usize = 32;

/// A node is halved if halving costs at most this factor times the least cost. Such a difference is due to rounding, so
/// equal boxes make a balanced tree.
const NEARLY: f32 = 1.0 + 1e-5;

/// The triangles of a subtree, sorted along each axis.
struct Sorted {
    prims: [Prim; MOST],
    order: [[u8; MOST]; 3],
    toward: Option<Point>,
    block_size: BlockSize,
}

/// A plane between neighbours along an axis.
struct SweepCut {
    axis: usize,
    /// Number of triangles on the left.
    left: usize,
}

/// Builds a subtree of 1 to [`MOST`] triangles whose root has the given depth.
#[inline(never)]
pub(crate) fn build(prims: &[Prim], slot: SubtreeSlot<'_>, depth: u32, task: BuildTask<'_>) {
    if prims.len() <= tiny::MOST {
        return tiny::build(prims, slot, depth);
    }
    let mut sorted = Sorted::new(prims, task);
    sorted.build([0, prims.len()], slot, depth);
}

impl Sorted {
    #[inline(never)]
    fn new(from: &[Prim], task: BuildTask<'_>) -> Self {
        let mut prims = [Prim::default(); MOST];
        let mut centers = [[f32::INFINITY; MOST]; 3];
        for (i, prim) in from.iter().enumerate() {
            prims[i] = *prim;
            let c = prim.center();
            for axis in 0..3 {
                centers[axis][i] = c[axis];
            }
        }
        let n = from.len();
        Self {
            prims,
            order: centers.map(|c| sort(&c, n)),
            toward: task.toward,
            block_size: task.block_size,
        }
    }

    #[inline]
    fn at(&self, axis: usize, place: usize) -> &Prim {
        &self.prims[self.order[axis][place % MOST] as usize % MOST]
    }

    fn build(&mut self, range: [usize; 2], slot: SubtreeSlot<'_>, depth: u32) {
        let [start, end] = range;
        let n = end - start;
        if n <= tiny::MOST {
            let mut few = [Prim::default(); tiny::MOST];
            for (i, to) in few[..n].iter_mut().enumerate() {
                *to = *self.at(0, start + i);
            }
            return tiny::build(&few[..n], slot, depth);
        }
        let SweepCut { axis, mut left } = self.best_cut(start, end);
        if !fits(left.max(n - left), depth + 1) {
            left = n / 2;
        }
        self.divide(range, axis, left);
        let middle = start + left;
        let mut sides = [[start, middle], [middle, end]];
        if self.right_first(axis, middle) {
            sides.reverse();
        }
        let [first, second] = sides;
        let [a, b] = slot.split(first[1] - first[0]);
        self.build(first, a, depth + 1);
        self.build(second, b, depth + 1);
    }

    /// Returns whether [`BuildTask::toward`] is right of a cut. Compares it only with the middle of the two centres
    /// next to the cut, which suffices for few triangles.
    fn right_first(&self, axis: usize, middle: usize) -> bool {
        self.toward.is_some_and(|point| {
            // Twice the centres, so their sum is four times the middle.
            let [left, right] =
                [middle - 1, middle].map(|place| self.at(axis, place).center()[axis]);
            4.0 * point[axis] > left + right
        })
    }

    #[inline(never)]
    fn best_cut(&self, start: usize, end: usize) -> SweepCut {
        let mut node = PrimBounds::EMPTY;
        for place in start..end {
            node.grow(&self.at(0, place).bounds);
        }
        let column = |i: usize| Column {
            boxes: [0, 1, 2].map(|axis| self.at(axis, start + i).bounds),
            triangles: Vec4::ONE,
        };
        // If the node fits into one block, each side of any cut counts as one block. So triangles are counted instead.
        let block_size = if end - start <= self.block_size.triangles() {
            BlockSize::One
        } else {
            self.block_size
        };
        let cuts = Cuts::<MOST>::of(end - start, column, Ruler::new(&node), block_size);
        let axis = cuts.least_axis().unwrap_or(0);
        let half = (end - start) / 2;
        let halving_is_best = cuts.costs[half % MOST][axis] <= cuts.best[axis] * NEARLY;
        SweepCut {
            axis,
            left: if halving_is_best {
                half
            } else {
                cuts.best_left[axis] as usize
            },
        }
    }

    /// Reorders the two other axes so that the first `left` triangles along `axis` come first, each side still sorted.
    fn divide(&mut self, [start, end]: [usize; 2], axis: usize, left: usize) {
        let mut is_left = [false; MOST];
        for &i in &self.order[axis][start..start + left] {
            is_left[i as usize % MOST] = true;
        }
        for other in [(axis + 1) % 3, (axis + 2) % 3] {
            let from = self.order[other];
            let to = &mut self.order[other];
            let (mut a, mut b) = (start, start + left);
            for &i in &from[start..end] {
                let goes_left = is_left[i as usize % MOST];
                to[if goes_left { a } else { b } % MOST] = i;
                a += usize::from(goes_left);
                b += usize::from(!goes_left);
            }
        }
    }
}

/// Returns the indices of the first `n` keys in ascending order of keys. The sort is stable.
///
/// A key's rank is the number of lesser keys, counted without a branch. Equal keys then take the next free place.
/// Keys past `n` must be infinite.
#[inline(never)]
fn sort(keys: &[f32; MOST], n: usize) -> [u8; MOST] {
    let mut order = [0; MOST];
    let mut taken = 0_u32;
    for (i, &key) in keys[..n].iter().enumerate() {
        let rank: u32 = keys.iter().map(|&other| u32::from(other < key)).sum();
        let place = rank + (!taken >> rank).trailing_zeros();
        taken |= 1 << place;
        order[place as usize % MOST] = i as u8;
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cancel;
    use crate::builder::tests::sized;
    use geom::Aabb;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sort_is_stable(values in prop::collection::vec(-3_i8..4, 0..=MOST)) {
            let mut keys = [f32::INFINITY; MOST];
            for (key, &value) in keys.iter_mut().zip(&values) {
                *key = f32::from(value);
            }
            let mut expected: Vec<_> = (0..values.len()).collect();
            expected.sort_by_key(|&i| values[i]);
            let order = sort(&keys, values.len());
            let found: Vec<_> = order[..values.len()].iter().map(|&i| usize::from(i)).collect();
            prop_assert_eq!(found, expected);
        }

        #[test]
        fn best_cut_has_minimal_cost(
            corners in prop::collection::vec(prop::array::uniform6(0_u8..50), 5..=MOST),
            block_size in prop::sample::select(vec![BlockSize::One, BlockSize::Eight]),
        ) {
            let prims: Vec<_> = corners.iter().zip(0..).map(|(c, i)| prim(c, i)).collect();
            let task = BuildTask { cancel: &Cancel::new(), toward: None, block_size };
            let sorted = Sorted::new(&prims, task);
            let n = prims.len();
            let in_block = if n <= block_size.triangles() { 1 } else { block_size.triangles() };
            let blocks = |triangles: usize| triangles.div_ceil(in_block) as f64;
            let cost = |axis: usize, left: usize| {
                let area = |places: std::ops::Range<usize>| {
                    let boxes = places.map(|place| sorted.at(axis, place).bounds.aabb());
                    boxes.fold(Aabb::EMPTY, Aabb::union).half_area()
                };
                area(0..left) * blocks(left) + area(left..n) * blocks(n - left)
            };
            let all = (0..3).flat_map(|axis| (1..n).map(move |left| (axis, left)));
            let best = all.map(|(axis, left)| cost(axis, left)).fold(f64::MAX, f64::min);
            let SweepCut { axis, left } = sorted.best_cut(0, n);
            prop_assert!(cost(axis, left) <= best * (1.0 + 1e-4), "{} {best}", cost(axis, left));
        }
    }

    fn prim(corners: &[u8; 6], triangle: u32) -> Prim {
        let [a, b, c, x, y, z] = corners.map(f32::from);
        Prim::new(&sized([a, b, c], [x, y, z].map(|e| e + 1.0)), triangle)
    }
}
