//! The watertight test by the wide tree, one ray at a time.

use super::leaf::{Meetings, TriangleRay};
use super::tree::{Block, LANES, Wide};
use super::walk::{NodeRay, Stack, Visitor, walk};
use crate::ray::PreparedRay;
use crate::simd::{Isa, Lanes};
use crate::slab::Reach;
use geom::Hit;

/// The closest hit so far.
struct Closest<'a, L> {
    blocks: &'a [Block],
    ray: TriangleRay<L>,
    best: Hit,
}

impl<L: Lanes<Array = [f32; LANES]>> Visitor for Closest<'_, L> {
    #[inline(always)]
    fn block(&mut self, block: usize, bound: f32) -> Option<f32> {
        let block = &self.blocks[block];
        if let Some(met) = self.ray.meet(block, bound) {
            take_best(&mut self.best, block, &met);
        }
        Some(self.best.t)
    }
}

#[inline(always)]
fn take_best<L: Lanes<Array = [f32; LANES]>>(best: &mut Hit, block: &Block, met: &Meetings<L>) {
    let (t, u, v) = (met.t.store(), met.u.store(), met.v.store());
    let mut lanes = met.lanes;
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize % LANES;
        lanes &= lanes - 1;
        let hit = Hit {
            t: t[lane],
            u: u[lane],
            v: v[lane],
            triangle: block.triangles[lane],
        };
        if hit.is_before(best) {
            *best = hit;
        }
    }
}

/// Ends at the first hit.
struct Any<'a, L> {
    blocks: &'a [Block],
    ray: TriangleRay<L>,
    skipped: u32,
}

impl<L: Lanes<Array = [f32; LANES]>> Visitor for Any<'_, L> {
    #[inline(always)]
    fn block(&mut self, block: usize, bound: f32) -> Option<f32> {
        let block = &self.blocks[block];
        let Some(met) = self.ray.meet(block, bound) else {
            return Some(bound);
        };
        let mut others = 0;
        for lane in 0..LANES {
            others |= u32::from(block.triangles[lane] != self.skipped) << lane;
        }
        (met.lanes & others == 0).then_some(bound)
    }
}

/// The closest hit, its `t` in scaled units.
#[inline(always)]
pub(crate) fn closest<I: Isa>(
    tree: &Wide,
    ray: &PreparedRay,
    reach: &Reach,
    stack: &mut Stack,
) -> Option<Hit> {
    let mut closest = Closest {
        blocks: &tree.blocks,
        ray: TriangleRay::<I::Eight>::single(ray, reach),
        best: Hit {
            t: ray.t_max,
            ..Hit::MISS
        },
    };
    let node_ray = NodeRay::new(ray, reach);
    walk::<I>(&tree.nodes, (&node_ray, ray.t_max), stack, &mut closest);
    closest.best.is_hit().then_some(closest.best)
}

/// Whether the ray hits any triangle but `skipped`.
#[inline(always)]
pub(crate) fn any<I: Isa>(
    tree: &Wide,
    ray: &PreparedRay,
    reach: &Reach,
    skipped: Option<u32>,
    stack: &mut Stack,
) -> bool {
    let mut any = Any {
        blocks: &tree.blocks,
        ray: TriangleRay::<I::Eight>::single(ray, reach),
        // No triangle has the index of a miss.
        skipped: skipped.unwrap_or(Hit::MISS.triangle),
    };
    let node_ray = NodeRay::new(ray, reach);
    walk::<I>(&tree.nodes, (&node_ray, ray.t_max), stack, &mut any)
}
