//! A packet of rays through the wide tree: one walk for all.

use crate::packet::{Bundle, Packet};
use crate::simd::{Halves, Isa, Lanes, each};
use crate::tree::{Block, LANES, NOWHERE, Wide, place};
use crate::walk::{Stack, Visitor, walk};
use geom::Hit;

/// Closest hits so far, one a lane.
pub(crate) struct Found<L: Lanes> {
    /// In units of the prepared directions.
    pub(crate) t: L,
    pub(crate) u: L,
    pub(crate) v: L,
    /// Where the triangles lie.
    pub(crate) places: [u32; MOST_RAYS],
}

/// Rays of the widest packet.
pub(crate) const MOST_RAYS: usize = 16;

/// No ray leaves a triangle out.
pub(crate) const NONE: [u32; MOST_RAYS] = [Hit::MISS.triangle; MOST_RAYS];

/// Triangles that a packet tests before its rays go one by one, as where each hits another triangle.
const TRIANGLES: u32 = 256;

/// The closest hits of a packet; `None` if its rays go better one by one.
#[inline(always)]
pub(crate) fn closest<I: Isa>(
    tree: &Wide,
    packet: &Packet<I::Packet, I::Planes>,
    stack: &mut Stack,
) -> Option<Found<I::Packet>> {
    let mut closest = Closest {
        patience: TRIANGLES,
        tree,
        packet,
        found: Found {
            t: packet.t_max,
            u: I::Packet::splat(0.0),
            v: I::Packet::splat(0.0),
            places: [NOWHERE; MOST_RAYS],
        },
    };
    let rays = (&packet.bundle, packet.bound);
    let gave_up = walk::<I>(tree, rays, stack, &mut closest);
    (!gave_up).then_some(closest.found)
}

/// Blocks that a packet sees before its rays go one by one: some packets are wide, as where hits lie far apart.
const PATIENCE: u32 = 16;

/// Which lanes of `asked` hit any triangle but the one in `skipped`; `None` if the rays go better one by one.
#[inline(always)]
pub(crate) fn any<I: Isa>(
    tree: &Wide,
    packet: &Packet<I::Packet, I::Planes>,
    (asked, skipped): (u32, &[u32; MOST_RAYS]),
    stack: &mut Stack,
) -> Option<u32> {
    let mut any = Any {
        blocks: &tree.blocks,
        packet,
        skipped,
        left: asked,
        patience: PATIENCE,
    };
    let rays = (&packet.bundle, packet.bound);
    let ended = walk::<I>(tree, rays, stack, &mut any);
    (!ended || any.left == 0).then_some(asked & !any.left)
}

/// Triangles of a block whose own boxes some ray may meet.
#[inline(always)]
fn within_reach<P: Halves>(block: &Block, rays: &Bundle<P>, bound: f32) -> u32 {
    let planes = each!(axis => {
        let [a, b, c] = &block.corners[axis];
        let (a, b, c) = (P::Half::load(a), P::Half::load(b), P::Half::load(c));
        P::join(a.min(b).min(c), a.max(b).max(c))
    });
    rays.meet_planes(&planes, bound).0
}

struct Closest<'a, L: Lanes, P> {
    tree: &'a Wide,
    packet: &'a Packet<L, P>,
    found: Found<L>,
    /// Triangles that may still be tested.
    patience: u32,
}

impl<I, L: Lanes, P: Halves> Visitor<I> for Closest<'_, L, P> {
    #[inline(always)]
    fn block(&mut self, index: usize, bound: f32) -> Option<f32> {
        let block = &self.tree.blocks[index];
        let mut lanes = within_reach(block, &self.packet.bundle, bound);
        self.patience = self.patience.checked_sub(lanes.count_ones())?;
        let mut changed = false;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % LANES;
            lanes &= lanes - 1;
            changed |= self.triangle(block, (lane, place(index, lane)));
        }
        if changed {
            return Some(self.found.t.mul(self.packet.level).most());
        }
        Some(bound)
    }
}

impl<L: Lanes, P> Closest<'_, L, P> {
    #[inline(always)]
    fn triangle(&mut self, block: &Block, (lane, place): (usize, u32)) -> bool {
        let found = &mut self.found;
        let Some(met) = self.packet.rays.meet_one(block, lane, found.t) else {
            return false;
        };
        let mut better = L::bits(met.t.less(found.t)) & met.lanes;
        let mut as_near = met.lanes & !better;
        while as_near != 0 {
            let ray = as_near.trailing_zeros() as usize % MOST_RAYS;
            as_near &= as_near - 1;
            // The lower index wins.
            let other = found.places[ray];
            if other == NOWHERE || block.triangles[lane] < self.tree.triangle_at(other) {
                better |= 1 << ray;
            }
        }
        let mask = L::mask(better);
        found.t = found.t.replace(mask, met.t);
        found.u = found.u.replace(mask, met.u);
        found.v = found.v.replace(mask, met.v);
        L::put(&mut found.places, mask, place);
        better != 0
    }
}

struct Any<'a, L, P> {
    blocks: &'a [Block],
    packet: &'a Packet<L, P>,
    skipped: &'a [u32; MOST_RAYS],
    /// Rays that hit nothing yet.
    left: u32,
    /// Blocks that may still be seen.
    patience: u32,
}

impl<I, L: Lanes, P: Halves> Visitor<I> for Any<'_, L, P> {
    #[inline(always)]
    fn block(&mut self, block: usize, bound: f32) -> Option<f32> {
        self.patience = self.patience.checked_sub(1)?;
        let block = &self.blocks[block];
        let mut lanes = within_reach(block, &self.packet.bundle, bound);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % LANES;
            lanes &= lanes - 1;
            let rays = &self.packet.rays;
            let Some(met) = rays.meet_one(block, lane, self.packet.t_max) else {
                continue;
            };
            let mut hit = met.lanes & self.left;
            while hit != 0 {
                let ray = hit.trailing_zeros() as usize % MOST_RAYS;
                hit &= hit - 1;
                if self.skipped[ray] != block.triangles[lane] {
                    self.left &= !(1 << ray);
                }
            }
            if self.left == 0 {
                return None;
            }
        }
        Some(bound)
    }
}
