//! Eight boxes to the box of all, and to the areas of the binary nodes between.

use super::tree::{LANES, Planes};
use bvh_layout::Ranges;
use geom::Aabb;

/// One plane of every range of two, then of four lanes, and of all lanes.
#[inline(always)]
fn table(planes: &[f32], least: impl Fn(f32, f32) -> f32) -> ([f32; 2 * LANES], f32) {
    let mut table = [planes[0]; 2 * LANES];
    for i in 0..LANES - 1 {
        table[i] = least(planes[i], planes[i + 1]);
    }
    for i in 0..LANES - 3 {
        table[LANES + i] = least(table[i], table[i + 2]);
    }
    (table, least(table[LANES], table[LANES + 4]))
}

/// The box of all lanes, and the sum of half areas of the boxes of `ranges`.
#[inline(always)]
pub(crate) fn fold(planes: &Planes, ranges: &Ranges) -> (Aabb, f64) {
    let mut whole = Aabb::EMPTY;
    let mut lower = [[0.0; 2 * LANES]; 3];
    let mut upper = lower;
    for axis in 0..3 {
        let (low, high) = planes[axis].split_at(LANES);
        (lower[axis], whole.min[axis]) = table(low, |a, b| if a < b { a } else { b });
        (upper[axis], whole.max[axis]) = table(high, |a, b| if a > b { a } else { b });
    }
    let mut sum = 0.0;
    for &[a, b] in ranges.places() {
        let (a, b) = (usize::from(a) % (2 * LANES), usize::from(b) % (2 * LANES));
        let mut range = Aabb::EMPTY;
        for axis in 0..3 {
            range.min[axis] = lower[axis][a].min(lower[axis][b]);
            range.max[axis] = upper[axis][a].max(upper[axis][b]);
        }
        sum += range.half_area();
    }
    (whole, sum)
}

/// The sum of half areas of all lanes.
#[inline(always)]
pub(crate) fn lane_areas(planes: &Planes) -> f64 {
    let mut sum = 0.0;
    for lane in 0..LANES {
        sum += bounds(planes, lane).half_area();
    }
    sum
}

/// The box of one lane.
#[inline(always)]
pub(crate) fn bounds(planes: &Planes, lane: usize) -> Aabb {
    Aabb {
        min: [planes[0][lane], planes[1][lane], planes[2][lane]],
        max: [
            planes[0][lane + LANES],
            planes[1][lane + LANES],
            planes[2][lane + LANES],
        ],
    }
}

/// Sets the box of one lane.
#[inline(always)]
pub(crate) fn set_bounds(planes: &mut Planes, lane: usize, bounds: &Aabb) {
    for (axis, planes) in planes.iter_mut().enumerate() {
        planes[lane] = bounds.min[axis];
        planes[lane + LANES] = bounds.max[axis];
    }
}
