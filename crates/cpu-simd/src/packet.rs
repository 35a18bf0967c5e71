//! Neighbouring rays, one in each lane, through the wide tree by one walk: boxes are tested against all of them at once,
//! by interval arithmetic (Boulos, Wald, Shirley 2006).
//!
//! Every operation of the box test is monotone in the ray's start, in `|r|` and in `q`, rounding included. So from
//! their bounds come bounds of every ray's entry and exit; what these exclude, each ray's own test excludes too.

use crate::leaf::TriangleRay;
use crate::rays::{Group, MOST_RAYS};
use crate::simd::{Halves, Isa, Lanes, Vector, each};
use crate::tree::{Block, LANES, NOWHERE, Planes, Wide, place};
use crate::walk::{BoxTest, Stack, Visitor, walk};
use geom::Hit;

/// Rays that run together.
pub(crate) struct Packet<L, P> {
    pub(crate) rays: TriangleRay<L>,
    pub(crate) bundle: Bundle<P>,
    /// Brings distances of all rays to the units of one of them.
    pub(crate) level: L,
    /// Where each ray ends, and the last of these ends in units of one ray.
    pub(crate) t_max: L,
    pub(crate) bound: f32,
}

/// How far lengths of one packet may differ: distances must not leave the normal range.
const APART: f32 = 16.0;

impl<L: Lanes, P: Halves> Packet<L, P> {
    /// `None` for rays that cannot run together: some are unusual, or their directions differ in main axis, sign or
    /// exponent.
    #[inline(always)]
    pub(crate) fn of(group: &Group<L>) -> Option<Self> {
        let main = group.main_of_all()?;
        let inverse = each!(i => L::load(&group.inverse[i]));
        let [x, y, z] = inverse;
        let turned = [is_negative(x)?, is_negative(y)?, is_negative(z)?];
        let back = L::load(&group.back);
        let level = back.mul(L::splat(1.0 / group.back.as_ref()[0]));
        if level.most() > APART * level.least() {
            return None;
        }
        let [t_min, t_max] = [L::load(&group.limits[0]), L::load(&group.limits[1])];
        Some(Self {
            rays: TriangleRay::all(group, main),
            bundle: Bundle::new(group, turned, level, t_min.mul(level).least()),
            level,
            t_max,
            bound: t_max.mul(level).most(),
        })
    }
}

/// Whether a component is negative, where that is the same for all.
#[inline(always)]
fn is_negative<L: Lanes>(d: L) -> Option<bool> {
    let negative = L::bits(d.less(L::splat(0.0)));
    (negative == 0 || negative == L::ALL).then_some(negative != 0)
}

/// The bounds of a packet's rays: halves as in a node, lower planes first.
#[derive(Clone, Copy)]
pub(crate) struct Bundle<P> {
    /// The start that lies nearest to the far side: greatest for lower planes, least for upper ones.
    origin: [P; 3],
    /// The least `|r|`, then the greatest; negative for upper planes.
    inverse: [[P; 2]; 3],
    /// The greatest `q`.
    pad: [P; 3],
    turned: [bool; 3],
    /// The least `t_min` for the entries, no bound for the exits.
    floor: P,
}

impl<P: Halves> Bundle<P> {
    /// `level` brings distances of all rays to one unit, exactly; `turned` says which directions are negative.
    #[inline(always)]
    fn new<L: Lanes>(group: &Group<L>, turned: [bool; 3], level: L, t_min: f32) -> Self {
        let origin = each!(i => L::load(&group.origin[i]));
        Self {
            origin: each!(i => halves(origin[i].most(), origin[i].least())),
            inverse: each!(i => {
                let r = L::load(&group.inverse[i]).abs().mul(level);
                let (least, most) = (r.least(), r.most());
                [halves(least, -least), halves(most, -most)]
            }),
            pad: each!(i => P::splat(L::load(&group.pad[i]).mul(level).most())),
            turned,
            floor: halves(t_min, f32::NEG_INFINITY),
        }
    }

    /// [`BoxTest::meet`], for planes at hand: lower ones, then upper ones.
    #[inline(always)]
    pub(crate) fn meet_planes(&self, planes: &[P; 3], best: f32) -> (u32, P::Half) {
        let [x, y, z] = each!(axis => {
            let from = planes[axis].sub(self.origin[axis]);
            let [least, most] = self.inverse[axis];
            from.mul(least)
                .min(from.mul(most))
                .sub(self.pad[axis])
                .turned(self.turned[axis])
        });
        let spans = self.floor.max(x).max(y).max(z);
        let exit = spans.high().neg().min(P::Half::splat(best));
        (P::Half::bits(spans.low().at_most(exit)), spans.low())
    }
}

impl<P: Halves> BoxTest<P::Half> for Bundle<P> {
    #[inline(always)]
    fn meet(&self, planes: &Planes, best: f32) -> (u32, P::Half) {
        let planes = each!(axis => P::load(&planes[axis]));
        self.meet_planes(&planes, best)
    }
}

/// `low` for lower planes, `high` for upper ones.
#[inline(always)]
fn halves<P: Halves>(low: f32, high: f32) -> P {
    P::join(P::Half::splat(low), P::Half::splat(high))
}

/// Closest hits so far, one a lane.
pub(crate) struct Found<L: Lanes> {
    /// In units of the prepared directions.
    pub(crate) t: L,
    pub(crate) u: L,
    pub(crate) v: L,
    /// Where the triangles lie.
    pub(crate) places: [u32; MOST_RAYS],
}

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
