//! Positions to corners and boxes, block by block and node by node.

use super::fold::{fold, lane_areas, set_bounds};
use super::tree::{Block, EMPTY, LANES, Node, Planes, Wide};
use crate::preprocess::{Geometry, Unhittable};
use crate::scale::Scale;
use crate::simd::{Isa, Lanes, each};
use crate::triangle_test::{Record, TriangleTest};
use bvh_layout::Block as Source;
use geom::{Triangle, is_active, is_degenerate};
use rayon::prelude::*;

/// Sets a block's corners and its box in its node's lane. Returns the areas within.
#[inline(always)]
pub(super) fn fit_block<I: Isa>(
    geometry: &Geometry<'_>,
    source: &Source,
    (node, lane, block): (&mut Node, usize, &mut Block),
    unhittable: &mut Unhittable,
) -> f64 {
    let planes = fill::<I>(geometry, source, block, unhittable);
    let (whole, between) = fold(&planes, &source.ranges);
    set_bounds(&mut node.planes, lane, &whole);
    between + lane_areas(&planes)
}

/// Sets an inner child's box in its node's lane. Returns the areas between its own children.
#[inline(always)]
pub(super) fn fit_child(node: &mut Node, lane: usize, child: &Node) -> f64 {
    let (whole, between) = fold(&child.planes, &child.ranges);
    set_bounds(&mut node.planes, lane, &whole);
    between
}

/// Sets a block's corners and returns its triangles' boxes.
#[inline(always)]
fn fill<I: Isa>(
    geometry: &Geometry<'_>,
    source: &Source,
    block: &mut Block,
    unhittable: &mut Unhittable,
) -> Planes {
    let mut corners = [[[0.0; LANES]; 3]; 3];
    for (corner, vertices) in source.vertices.iter().enumerate() {
        for (lane, &vertex) in vertices.iter().enumerate() {
            let p = geometry.positions[vertex as usize];
            corners[0][corner][lane] = p[0];
            corners[1][corner][lane] = p[1];
            corners[2][corner][lane] = p[2];
        }
    }
    let hittable = hittable::<I::Eight>(&corners, u32::from(source.count), unhittable);
    let mut planes = EMPTY;
    for axis in 0..3 {
        let [a, b, c] = each!(i => scaled::<I::Eight>(geometry.scale, &corners[axis][i]));
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let mask = I::Eight::mask(hittable);
        let (none, on) = (
            I::Eight::splat(f32::INFINITY),
            I::Eight::splat(f32::NEG_INFINITY),
        );
        planes[axis][..LANES].copy_from_slice(&none.replace(mask, low).store());
        planes[axis][LANES..].copy_from_slice(&on.replace(mask, high).store());
        let unhittable = I::Eight::splat(f32::NAN);
        block.corners[axis] = each!(i => unhittable.replace(mask, [a, b, c][i]).store());
    }
    planes
}

/// [`Scale::apply`], lane by lane.
#[inline(always)]
fn scaled<L: Lanes<Array = [f32; LANES]>>(scale: Scale, x: &[f32; LANES]) -> L {
    let x = L::load(x).mul(L::splat(scale.factor()));
    let small = x.abs().less(L::splat(Scale::LEAST));
    x.replace(small, L::splat(0.0))
}

/// Which lanes hold a triangle that can be hit; the others are counted.
#[inline(always)]
fn hittable<L: Lanes<Array = [f32; LANES]>>(
    corners: &[[[f32; LANES]; 3]; 3],
    count: u32,
    unhittable: &mut Unhittable,
) -> u32 {
    let most = L::splat(f32::MAX);
    let mut finite = L::mask((1 << count) - 1);
    let mut edges = [[L::splat(0.0); 2]; 3];
    for axis in 0..3 {
        let [a, b, c] = &corners[axis];
        let [a, b, c] = [L::load(a), L::load(b), L::load(c)];
        for x in [a, b, c] {
            finite = L::both(finite, x.abs().at_most(most));
        }
        edges[axis] = [b.sub(a), c.sub(a)];
    }
    let clear = L::bits(L::either(
        stands_clear(&edges, 0, 1),
        L::either(stands_clear(&edges, 1, 2), stands_clear(&edges, 2, 0)),
    ));
    let finite = L::bits(finite);
    unhittable.inactive += u64::from(count - finite.count_ones());
    let mut doubtful = finite & !clear;
    let mut hittable = finite & clear;
    while doubtful != 0 {
        let lane = doubtful.trailing_zeros();
        doubtful &= doubtful - 1;
        if is_degenerate(&triangle(corners, lane as usize)) {
            unhittable.degenerate += 1;
        } else {
            hittable |= 1 << lane;
        }
    }
    hittable
}

/// Whether a component of the cross product is surely not zero: each product carries three roundings and
/// the difference one more. What is small may have lost digits, and what is large is infinite: not sure.
#[inline(always)]
fn stands_clear<L: Lanes>(edges: &[[L; 2]; 3], i: usize, j: usize) -> L::Mask {
    let (p, q) = (edges[i][0].mul(edges[j][1]), edges[j][0].mul(edges[i][1]));
    let size = p.abs().add(q.abs());
    let doubt = size.mul(L::splat(8.0 * f32::EPSILON));
    doubt.add(L::splat(1e-30)).less(p.sub(q).abs())
}

#[inline(always)]
fn triangle(corners: &[[[f32; LANES]; 3]; 3], lane: usize) -> Triangle {
    let corner = |c: usize| {
        [
            corners[0][c][lane],
            corners[1][c][lane],
            corners[2][c][lane],
        ]
    };
    [corner(0), corner(1), corner(2)]
}

impl Block {
    /// The corners in one lane, in scaled units.
    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> Triangle {
        triangle(&self.corners, lane)
    }
}

impl Wide {
    /// Makes the record of each lane for tests that ask for one. Comes after [`Wide::preprocess`].
    pub(crate) fn make_records<T: TriangleTest>(&mut self) {
        self.records
            .resize(self.blocks.len() * LANES, Record::default());
        let records = self.records.par_chunks_mut(LANES).with_min_len(128);
        records.zip(&self.blocks).for_each(|(records, block)| {
            for (lane, record) in records.iter_mut().enumerate() {
                let corners = block.triangle(lane);
                *record = if is_active(&corners) {
                    T::record(&corners)
                } else {
                    Record::default()
                };
            }
        });
    }
}
