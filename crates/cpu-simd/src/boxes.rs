//! Operations on eight boxes at once: unions of neighbouring lanes, and surface areas.

use crate::simd::{Eight, each};
use crate::tree::{BoxPlanes, LANES};
use bvh_layout::Ranges;
use geom::Aabb;

/// The boxes of eight lanes. Empty boxes extend from infinity to minus infinity.
pub(crate) struct EightBoxes<L> {
    pub(crate) low: [L; 3],
    pub(crate) high: [L; 3],
}

/// The union of eight boxes, and the areas of unions of neighbouring boxes.
pub(crate) struct FoldedBoxes<L> {
    pub(crate) whole: Aabb,
    /// For each of the [`Ranges`], half the surface area of the union of its boxes. Unused lanes are 0.
    pub(crate) half_areas: L,
}

impl<L: Eight> EightBoxes<L> {
    #[inline(always)]
    pub(crate) fn load(planes: &BoxPlanes) -> Self {
        let halves = each!(axis => planes[axis].as_chunks::<LANES>().0);
        Self {
            low: each!(axis => L::load(&halves[axis][0])),
            high: each!(axis => L::load(&halves[axis][1])),
        }
    }

    /// Returns the union of each box `i` with box `i + further`, modulo eight.
    #[inline(always)]
    fn joined(&self, further: u8) -> Self {
        let mut lanes = [0, 1, 2, 3, 4, 5, 6, 7];
        for lane in &mut lanes {
            *lane += further;
        }
        self.union(&self.permuted(&lanes))
    }

    #[inline(always)]
    fn permuted(&self, lanes: &[u8; LANES]) -> Self {
        Self {
            low: each!(axis => self.low[axis].permuted(lanes)),
            high: each!(axis => self.high[axis].permuted(lanes)),
        }
    }

    #[inline(always)]
    fn union(&self, other: &Self) -> Self {
        Self {
            low: each!(axis => self.low[axis].min(other.low[axis])),
            high: each!(axis => self.high[axis].max(other.high[axis])),
        }
    }

    /// Returns the union of all lanes, and half the surface area of each range of lanes.
    ///
    /// Each range is the union of two parts of two or four lanes, as in a sparse table: see [`Ranges`].
    #[inline(always)]
    pub(crate) fn fold(&self, ranges: &Ranges) -> FoldedBoxes<L> {
        let twos = self.joined(1);
        let fours = twos.joined(2);
        let [first, second] = ranges.places();
        let short = twos.permuted(first).union(&twos.permuted(second));
        let long = fours.permuted(first).union(&fours.permuted(second));
        let mask = L::mask(u32::from(ranges.fours()));
        let of_ranges = Self {
            low: each!(axis => short.low[axis].replace(mask, long.low[axis])),
            high: each!(axis => short.high[axis].replace(mask, long.high[axis])),
        };
        let all = fours.joined(4);
        let whole = Aabb {
            min: each!(axis => all.low[axis].store()[0]),
            max: each!(axis => all.high[axis].store()[0]),
        };
        let used = L::mask((1 << ranges.count()) - 1);
        FoldedBoxes {
            whole,
            half_areas: L::splat(0.0).replace(used, of_ranges.half_areas()),
        }
    }

    /// Returns half the surface area of each box, computed in single precision.
    #[inline(always)]
    pub(crate) fn half_areas(&self) -> L {
        let [x, y, z] = each!(axis => self.high[axis].sub(self.low[axis]));
        let area = x.mul(y.add(z)).add(y.mul(z));
        let is_full = self.low[0].at_most(self.high[0]);
        L::splat(0.0).replace(is_full, area)
    }
}

/// Sums of areas, one per lane, in double precision so that sums over large trees stay accurate.
#[derive(Default)]
pub(crate) struct Sums([f64; LANES]);

impl Sums {
    #[inline(always)]
    pub(crate) fn add<L: Eight>(&mut self, areas: L) {
        let areas = areas.store();
        for (sum, area) in self.0.iter_mut().zip(areas) {
            *sum += f64::from(area);
        }
    }

    #[inline(always)]
    pub(crate) fn total(&self) -> f64 {
        let mut total = 0.0;
        for sum in self.0 {
            total += sum;
        }
        total
    }
}
