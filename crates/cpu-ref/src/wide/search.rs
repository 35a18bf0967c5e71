//! The watertight test by the wide tree, one ray at a time.

use super::leaf::{Meetings, TriangleRay};
use super::single::OneRay;
use super::tree::{Block, LANES, Wide};
use super::walk::{AnyVisitor, NodeRay, Stack, Visitor, walk, walk_any};
use crate::simd::{Isa, Lanes};
use geom::Hit;
use std::marker::PhantomData;

/// The closest hit so far.
struct Closest<'a, R, L> {
    blocks: &'a [Block],
    ray: &'a R,
    best: Hit,
    lanes: PhantomData<L>,
}

impl<R: OneRay, L: Lanes<Array = [f32; LANES]>> Visitor for Closest<'_, R, L> {
    #[inline(always)]
    fn block(&mut self, block: usize, bound: f32) -> Option<f32> {
        let block = &self.blocks[block];
        if let Some(met) = TriangleRay::<L>::single(self.ray).meet(block, bound) {
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
struct Any<'a, R, L> {
    blocks: &'a [Block],
    ray: &'a R,
    skipped: u32,
    lanes: PhantomData<L>,
}

impl<R: OneRay, L: Lanes<Array = [f32; LANES]>> AnyVisitor for Any<'_, R, L> {
    #[inline(always)]
    fn hits(&mut self, block: usize) -> bool {
        let block = &self.blocks[block];
        let Some(met) = TriangleRay::<L>::single(self.ray).meet(block, self.ray.t_max()) else {
            return false;
        };
        let mut others = 0;
        for lane in 0..LANES {
            others |= u32::from(block.triangles[lane] != self.skipped) << lane;
        }
        met.lanes & others != 0
    }
}

/// The closest hit, its `t` in scaled units.
#[inline(always)]
pub(crate) fn closest<I: Isa>(tree: &Wide, ray: &impl OneRay, stack: &mut Stack) -> Option<Hit> {
    let mut closest = Closest {
        blocks: &tree.blocks,
        ray,
        lanes: PhantomData::<I::Eight>,
        best: Hit {
            t: ray.t_max(),
            ..Hit::MISS
        },
    };
    let node_ray = NodeRay::<I::Eight>::new(ray);
    walk::<I, _>(tree, (&node_ray, ray.t_max()), stack, &mut closest);
    closest.best.is_hit().then_some(closest.best)
}

/// Whether the ray hits any triangle but `skipped`.
#[inline(always)]
pub(crate) fn any<I: Isa>(
    tree: &Wide,
    ray: &impl OneRay,
    skipped: Option<u32>,
    stack: &mut Stack,
) -> bool {
    let mut any = Any {
        blocks: &tree.blocks,
        ray,
        lanes: PhantomData::<I::Eight>,
        // No triangle has the index of a miss.
        skipped: skipped.unwrap_or(Hit::MISS.triangle),
    };
    let node_ray = NodeRay::<I::Eight>::new(ray);
    walk_any::<I>(tree, (&node_ray, ray.t_max()), stack, &mut any)
}
