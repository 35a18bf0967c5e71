//! Positions to triangle records and boxes of leaves.

use crate::bvh2::{Leaf, Pair};
use crate::geometry::{Geometry, Unhittable};
use crate::intersect::{Record, TriangleTest};
use crate::pass::{SplitAt, Which, Window, pass};
use crate::scale::Scale;
use geom::{Triangle, is_active, is_degenerate};
use glam::Vec3A;

/// Leaves that one task handles.
const RUN: usize = 1024;
/// Leaves whose corners are fetched together: they lie scattered, and so their fetches overlap.
const BATCH: usize = 16;

/// Leaves by rank, with the pairs that hold their boxes and with their records.
pub(crate) struct Leaves<'a> {
    pub(crate) leaves: &'a [Leaf],
    pub(crate) pairs: Window<'a, Pair>,
    pub(crate) records: Window<'a, Record>,
}

impl SplitAt for Leaves<'_> {
    fn split(self, rank: usize) -> [Self; 2] {
        let pairs = self.pairs.split(self.leaves[rank].pair());
        let ([left_pairs, right_pairs], [left, right]) = (pairs, self.records.split(rank));
        let half = |pairs, records| Leaves {
            leaves: self.leaves,
            pairs,
            records,
        };
        [half(left_pairs, left), half(right_pairs, right)]
    }

    /// Both leaves of a pair are written by one task.
    fn joins(&self, left: usize, right: usize) -> bool {
        self.leaves[left].pair() == self.leaves[right].pair()
    }
}

/// Writes a record and a box for each of these leaves: the others keep theirs.
pub(crate) fn preprocess<T: TriangleTest>(
    geometry: &Geometry<'_>,
    which: Which<'_>,
    leaves: Leaves<'_>,
) -> Unhittable {
    pass(which, leaves, RUN, &|which, leaves| {
        prepare_run::<T>(geometry, &which, leaves)
    })
}

fn prepare_run<T: TriangleTest>(
    geometry: &Geometry<'_>,
    which: &Which<'_>,
    mut part: Leaves<'_>,
) -> Unhittable {
    let mut corners = [[[0.0; 3]; 3]; BATCH];
    let mut unhittable = Unhittable::default();
    for first in (0..which.count()).step_by(BATCH) {
        let batch = first..which.count().min(first + BATCH);
        for (corners, place) in corners.iter_mut().zip(batch.clone()) {
            let leaf = &part.leaves[which.at(place)];
            *corners = leaf.vertices.map(|v| geometry.positions[v as usize]);
        }
        for (corners, place) in corners.iter().zip(batch) {
            let rank = which.at(place);
            let record = &mut part.records[rank];
            let [min, max] = prepare::<T>(geometry.scale, corners, record, &mut unhittable);
            let leaf = &part.leaves[rank];
            part.pairs[leaf.pair()].set_bounds(leaf.lane(), min, max);
        }
    }
    unhittable
}

/// Writes a triangle's record and returns the corners of its box.
#[inline]
fn prepare<T: TriangleTest>(
    scale: Scale,
    corners: &Triangle,
    record: &mut Record,
    unhittable: &mut Unhittable,
) -> [Vec3A; 2] {
    if !is_active(corners) {
        unhittable.inactive += 1;
    } else if is_degenerate(corners) {
        unhittable.degenerate += 1;
    } else {
        let corners = corners.map(|p| scale.apply(p));
        *record = T::record(&corners);
        let [a, b, c] = corners.map(Vec3A::from_array);
        return [a.min(b).min(c), a.max(b).max(c)];
    }
    *record = Record::default();
    [Vec3A::INFINITY, Vec3A::NEG_INFINITY]
}
