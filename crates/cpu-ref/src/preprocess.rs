//! Positions to triangle records and boxes of leaves.

use crate::nodes::{Leaf, Nodes, Pair};
use crate::scale::Scale;
use crate::triangle_test::{Record, TriangleTest};
use geom::{Point, Range, Ray, Triangle, is_active, is_degenerate};
use glam::Vec3A;
use std::ops::AddAssign;

/// Leaves whose corners are fetched together.
const BATCH: usize = 16;

/// Leaves that are never hit, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Unhittable {
    /// A corner is not finite.
    pub(crate) inactive: u64,
    /// Active, but of zero area.
    pub(crate) degenerate: u64,
}

impl AddAssign for Unhittable {
    fn add_assign(&mut self, other: Self) {
        self.inactive += other.inactive;
        self.degenerate += other.degenerate;
    }
}

/// Where triangles are.
#[derive(Clone, Copy)]
pub(crate) struct Geometry<'a> {
    /// One a vertex, in the scene's units.
    pub(crate) positions: &'a [Point],
    /// Three vertices a triangle.
    pub(crate) triangles: &'a [[u32; 3]],
    /// To scaled units.
    pub(crate) scale: Scale,
    /// How far coordinates reach at this moment.
    pub(crate) range: Range,
}

impl Geometry<'_> {
    /// A triangle's corners in the scene's units.
    #[inline]
    pub(crate) fn corners(&self, triangle: u32) -> Triangle {
        self.triangles[triangle as usize].map(|v| self.positions[v as usize])
    }

    /// Whether the ray is beyond what rounded tests can tell.
    #[inline]
    pub(crate) fn is_extreme(&self, ray: &Ray) -> bool {
        self.range.is_extreme(self.scale.apply(ray.origin))
    }

    /// A triangle's corners in scaled units.
    #[inline]
    pub(crate) fn scaled_corners(&self, triangle: u32) -> Triangle {
        self.corners(triangle).map(|p| self.scale.apply(p))
    }
}

/// Writes one record and one box a leaf, in the order of the leaves.
pub(crate) fn preprocess<T: TriangleTest>(
    geometry: Geometry<'_>,
    nodes: &mut Nodes,
    records: &mut [Record],
) -> Unhittable {
    let mut pairs = std::mem::take(&mut nodes.pairs);
    let run = LeafRun {
        pairs: &mut pairs,
        records,
        first_pair: 0,
    };
    let unhittable = split::<T>(geometry, nodes, run);
    nodes.pairs = pairs;
    unhittable
}

/// Neighbouring pairs and the records of the leaves among them.
struct LeafRun<'a> {
    pairs: &'a mut [Pair],
    records: &'a mut [Record],
    first_pair: usize,
}

/// Halves a run until it is short: a plain recursion, since records are cut where the leaves fall.
fn split<T: TriangleTest>(geometry: Geometry<'_>, nodes: &Nodes, run: LeafRun<'_>) -> Unhittable {
    if run.pairs.len() <= Nodes::RUN {
        return prepare_leaves::<T>(geometry, nodes, run);
    }
    let half = (run.pairs.len() / 2).next_multiple_of(Nodes::RUN);
    let middle = run.first_pair + half;
    let cut = nodes.leaves_before(middle) - nodes.leaves_before(run.first_pair);
    let (left_pairs, right_pairs) = run.pairs.split_at_mut(half);
    let (left_records, right_records) = run.records.split_at_mut(cut);
    let left = LeafRun {
        pairs: left_pairs,
        records: left_records,
        first_pair: run.first_pair,
    };
    let right = LeafRun {
        pairs: right_pairs,
        records: right_records,
        first_pair: middle,
    };
    let (mut sum, right) = rayon::join(
        || split::<T>(geometry, nodes, left),
        || split::<T>(geometry, nodes, right),
    );
    sum += right;
    sum
}

/// Likewise for the leaves of a list alone: others keep records and boxes.
pub(crate) fn preprocess_moving<T: TriangleTest>(
    geometry: Geometry<'_>,
    nodes: &mut Nodes,
    (list, records): (&[u32], &mut [Record]),
) -> Unhittable {
    let mut pairs = std::mem::take(&mut nodes.pairs);
    let chosen = Chosen {
        list,
        pairs: &mut pairs,
        records,
        first_pair: 0,
        first_leaf: 0,
    };
    let unhittable = split_list::<T>(geometry, &nodes.leaves, chosen);
    nodes.pairs = pairs;
    unhittable
}

/// Leaves of a list, and slices that hold their pairs and records.
struct Chosen<'a> {
    list: &'a [u32],
    pairs: &'a mut [Pair],
    records: &'a mut [Record],
    first_pair: usize,
    first_leaf: usize,
}

/// Halves a list until it is short, never between two leaves of one pair.
fn split_list<T: TriangleTest>(
    geometry: Geometry<'_>,
    leaves: &[Leaf],
    chosen: Chosen<'_>,
) -> Unhittable {
    let pair = |i: usize| leaves[chosen.list[i] as usize].slot as usize / 2;
    let half = chosen.list.len() / 2;
    if chosen.list.len() <= Nodes::RUN {
        return prepare_list::<T>(geometry, leaves, chosen);
    }
    let cut = half + usize::from(pair(half) == pair(half - 1));
    let (middle_pair, middle_leaf) = (pair(cut), chosen.list[cut] as usize);
    let (left_list, right_list) = chosen.list.split_at(cut);
    let (left_pairs, right_pairs) = chosen.pairs.split_at_mut(middle_pair - chosen.first_pair);
    let (left_records, right_records) =
        chosen.records.split_at_mut(middle_leaf - chosen.first_leaf);
    let left = Chosen {
        list: left_list,
        pairs: left_pairs,
        records: left_records,
        ..chosen
    };
    let right = Chosen {
        list: right_list,
        pairs: right_pairs,
        records: right_records,
        first_pair: middle_pair,
        first_leaf: middle_leaf,
    };
    let (mut sum, right) = rayon::join(
        || split_list::<T>(geometry, leaves, left),
        || split_list::<T>(geometry, leaves, right),
    );
    sum += right;
    sum
}

fn prepare_list<T: TriangleTest>(
    geometry: Geometry<'_>,
    leaves: &[Leaf],
    chosen: Chosen<'_>,
) -> Unhittable {
    let mut corners = [[[0.0; 3]; 3]; BATCH];
    let mut unhittable = Unhittable::default();
    for list in chosen.list.chunks(BATCH) {
        let leaf = |rank: u32| &leaves[rank as usize];
        for (corners, &rank) in corners.iter_mut().zip(list) {
            *corners = leaf(rank).vertices.map(|v| geometry.positions[v as usize]);
        }
        for (corners, &rank) in corners.iter().zip(list) {
            let record = &mut chosen.records[rank as usize - chosen.first_leaf];
            let [min, max] = prepare::<T>(geometry.scale, corners, record, &mut unhittable);
            let slot = leaf(rank).slot as usize;
            chosen.pairs[slot / 2 - chosen.first_pair].set_bounds(slot % 2, min, max);
        }
    }
    unhittable
}

/// Corners are fetched for a batch of leaves first: they lie scattered, and so their fetches overlap.
fn prepare_leaves<T: TriangleTest>(
    geometry: Geometry<'_>,
    nodes: &Nodes,
    run: LeafRun<'_>,
) -> Unhittable {
    let first = nodes.leaves_before(run.first_pair);
    let leaves = &nodes.leaves[first..][..run.records.len()];
    let mut corners = [[[0.0; 3]; 3]; BATCH];
    let mut unhittable = Unhittable::default();
    for (leaves, records) in leaves.chunks(BATCH).zip(run.records.chunks_mut(BATCH)) {
        for (corners, leaf) in corners.iter_mut().zip(leaves) {
            *corners = leaf.vertices.map(|v| geometry.positions[v as usize]);
        }
        for ((corners, leaf), record) in corners.iter().zip(leaves).zip(records) {
            let [min, max] = prepare::<T>(geometry.scale, corners, record, &mut unhittable);
            let slot = leaf.slot as usize;
            run.pairs[slot / 2 - run.first_pair].set_bounds(slot % 2, min, max);
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
