//! The watertight test by the wide tree, one ray at a time.

use crate::leaf::{Meetings, TriangleRay};
use crate::rays::OneRay;
use crate::simd::{Isa, Lanes};
use crate::tree::{Block, LANES, NOWHERE, Wide, place};
use crate::walk::{NodeRay, Stack, Visitor, walk};
use geom::Hit;

/// A hit, and where its triangle lies in the tree: the block's number times [`LANES`], and the lane.
#[derive(Clone, Copy)]
pub(crate) struct Placed {
    pub(crate) hit: Hit,
    pub(crate) place: u32,
}

/// The closest hit so far.
struct Closest<'a, R: Lanes> {
    blocks: &'a [Block],
    ray: &'a OneRay<'a, R>,
    best: Placed,
}

impl<I: Isa, R: Lanes> Visitor<I> for Closest<'_, R> {
    #[inline(always)]
    fn block(&mut self, index: usize, bound: f32) -> Option<f32> {
        let block = &self.blocks[index];
        if let Some(met) = TriangleRay::<I::Eight>::single(self.ray).meet(block, bound) {
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
        best: Placed {
            hit: Hit {
                t: ray.t_max(),
                ..Hit::MISS
            },
            place: NOWHERE,
        },
    };
    let node_ray = NodeRay::<I::Eight>::new(ray);
    walk::<I>(tree, (&node_ray, ray.t_max()), stack, &mut closest);
    closest.best
}
