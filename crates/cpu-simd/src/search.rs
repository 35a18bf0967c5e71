//! The watertight test by the wide tree, one ray at a time.

use crate::leaf::{Meetings, TriangleRay};
use crate::rays::OneRay;
use crate::simd::{Isa, Lanes};
use crate::tree::{Block, LANES, NOWHERE, Wide, place};
use crate::walk::{AnyVisitor, NodeRay, Stack, Visitor, walk, walk_any};
use geom::Hit;
use std::marker::PhantomData;

/// A hit, and where its triangle lies in the tree: the block's number times [`LANES`], and the lane.
#[derive(Clone, Copy)]
pub(crate) struct Placed {
    pub(crate) hit: Hit,
    pub(crate) place: u32,
}

/// The closest hit so far.
struct Closest<'a, R: Lanes, L> {
    blocks: &'a [Block],
    ray: &'a OneRay<'a, R>,
    best: Placed,
    lanes: PhantomData<L>,
}

impl<R: Lanes, L: Lanes<Array = [f32; LANES]>> Visitor for Closest<'_, R, L> {
    #[inline(always)]
    fn block(&mut self, index: usize, bound: f32) -> Option<f32> {
        let block = &self.blocks[index];
        if let Some(met) = TriangleRay::<L>::single(self.ray).meet(block, bound) {
            take_best(&mut self.best, (block, index), &met);
        }
        Some(self.best.hit.t)
    }
}

#[inline(always)]
fn take_best<L: Lanes<Array = [f32; LANES]>>(
    best: &mut Placed,
    (block, index): (&Block, usize),
    met: &Meetings<L>,
) {
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
        if hit.is_before(&best.hit) {
            let place = place(index, lane);
            *best = Placed { hit, place };
        }
    }
}

/// Ends at the first hit.
struct Any<'a, R: Lanes, L> {
    blocks: &'a [Block],
    ray: &'a OneRay<'a, R>,
    skipped: u32,
    lanes: PhantomData<L>,
}

impl<R: Lanes, L: Lanes<Array = [f32; LANES]>> AnyVisitor for Any<'_, R, L> {
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

/// The closest hit, its `t` in scaled units; a miss has no place.
#[inline(always)]
pub(crate) fn closest<I: Isa>(
    tree: &Wide,
    ray: &OneRay<'_, impl Lanes>,
    stack: &mut Stack,
) -> Placed {
    let mut closest = Closest {
        blocks: &tree.blocks,
        ray,
        lanes: PhantomData::<I::Eight>,
        best: Placed {
            hit: Hit {
                t: ray.t_max(),
                ..Hit::MISS
            },
            place: NOWHERE,
        },
    };
    let node_ray = NodeRay::<I::Eight>::new(ray);
    walk::<I, _>(tree, (&node_ray, ray.t_max()), stack, &mut closest);
    closest.best
}

/// Whether the ray hits any triangle but `skipped`, which may be none: that of a miss.
#[inline(always)]
pub(crate) fn any<I: Isa>(
    tree: &Wide,
    ray: &OneRay<'_, impl Lanes>,
    skipped: u32,
    stack: &mut Stack,
) -> bool {
    let mut any = Any {
        blocks: &tree.blocks,
        ray,
        lanes: PhantomData::<I::Eight>,
        skipped,
    };
    let node_ray = NodeRay::<I::Eight>::new(ray);
    walk_any::<I>(tree, (&node_ray, ray.t_max()), stack, &mut any)
}
