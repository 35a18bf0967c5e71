//! Neighbouring rays, one in each lane, through the wide tree by one walk: boxes are tested against all of them at once,
//! by interval arithmetic (Boulos, Wald, Shirley 2006).
//!
//! Every operation of the box test is monotone in the ray's start, in `|r|` and in `q`, rounding included. So from
//! their bounds come bounds of every ray's entry and exit; what these exclude, each ray's own test excludes too.

use crate::intersect::{Intersect, LaneTest, Touch};
use crate::leaf::{OfLane, TriangleRay};
use crate::rays::{Group, MOST_RAYS};
use crate::simd::{Halves, Isa, Lanes, Vector, each};
use crate::tree::{Block, LANES, NOWHERE, Planes, Wide, place};
use crate::walk::{BoxTest, Stack, Visitor, walk};
use geom::Hit;
use std::marker::PhantomData;

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
    /// Lanes of which rounded arithmetic cannot tell.
    pub(crate) open: u32,
}

/// No ray leaves a triangle out.
pub(crate) const NONE: [u32; MOST_RAYS] = [Hit::MISS.triangle; MOST_RAYS];

/// Triangles that a packet may still test before its rays go one by one, as where each hits another triangle.
pub(crate) struct Patient(u32);

impl Patient {
    pub(crate) const FULL: Self = Self(256);

    /// Takes triangles off; `None` if that is too many.
    #[inline(always)]
    pub(crate) fn spend(&mut self, triangles: u32) -> Option<()> {
        self.0 = self.0.checked_sub(triangles)?;
        Some(())
    }
}

/// The closest hits of a packet; `None` if its rays go better one by one.
#[inline(always)]
pub(crate) fn closest<I: Isa, T: LaneTest>(
    tree: &Wide,
    packet: &Packet<I::Packet, I::Planes>,
    stack: &mut Stack,
) -> Option<Found<I::Packet>> {
    let mut closest = Closest {
        patience: Patient::FULL,
        test: PhantomData::<T>,
        tree,
        packet,
        found: Found {
            t: packet.t_max,
            u: I::Packet::splat(0.0),
            v: I::Packet::splat(0.0),
            places: [NOWHERE; MOST_RAYS],
            open: 0,
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
pub(crate) fn any<I: Isa, T: Intersect>(
    tree: &Wide,
    packet: &Packet<I::Packet, I::Planes>,
    (asked, skipped): (u32, &[u32; MOST_RAYS]),
    stack: &mut Stack,
) -> Option<Touch> {
    let mut any = Any {
        tree,
        packet,
        skipped,
        left: asked,
        open: 0,
        patience: PATIENCE,
        test: PhantomData::<T>,
    };
    let rays = (&packet.bundle, packet.bound);
    let ended = walk::<I>(tree, rays, stack, &mut any);
    (!ended || any.left == 0).then_some(Touch {
        hit: asked & !any.left,
        open: any.left & any.open,
    })
}

/// Triangles of a block whose own boxes some ray may meet.
#[inline(always)]
pub(crate) fn within_reach<P: Halves>(block: &Block, rays: &Bundle<P>, bound: f32) -> u32 {
    let planes = each!(axis => {
        let [a, b, c] = &block.corners[axis];
        let (a, b, c) = (P::Half::load(a), P::Half::load(b), P::Half::load(c));
        P::join(a.min(b).min(c), a.max(b).max(c))
    });
    rays.meet_planes(&planes, bound).0
}

struct Closest<'a, L: Lanes, P, T> {
    tree: &'a Wide,
    packet: &'a Packet<L, P>,
    found: Found<L>,
    patience: Patient,
    test: PhantomData<T>,
}

impl<I, L: Lanes, P: Halves, T: LaneTest> Visitor<I> for Closest<'_, L, P, T> {
    #[inline(always)]
    fn block(&mut self, block: usize, bound: f32) -> Option<f32> {
        let tree = self.tree;
        let mut lanes = within_reach(&tree.blocks[block], &self.packet.bundle, bound);
        self.patience.spend(lanes.count_ones())?;
        let mut changed = false;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % LANES;
            lanes &= lanes - 1;
            changed |= self.triangle(OfLane { tree, block, lane });
        }
        if changed {
            return Some(self.found.t.mul(self.packet.level).most());
        }
        Some(bound)
    }
}

impl<L: Lanes, P, T: LaneTest> Closest<'_, L, P, T> {
    #[inline(always)]
    fn triangle(&mut self, triangle: OfLane<'_>) -> bool {
        let found = &mut self.found;
        let Some(met) = T::meet(&self.packet.rays, &triangle, found.t) else {
            return false;
        };
        let place = place(triangle.block, triangle.lane);
        let mut better = L::bits(met.t.less(found.t)) & met.lanes;
        let mut as_near = met.lanes & !better;
        while as_near != 0 {
            let ray = as_near.trailing_zeros() as usize % MOST_RAYS;
            as_near &= as_near - 1;
            // The lower index wins.
            let other = found.places[ray];
            if other == NOWHERE || self.tree.triangle_at(place) < self.tree.triangle_at(other) {
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

struct Any<'a, L, P, T> {
    tree: &'a Wide,
    packet: &'a Packet<L, P>,
    skipped: &'a [u32; MOST_RAYS],
    /// Rays that hit nothing yet.
    left: u32,
    /// Rays that may have hit something.
    open: u32,
    /// Blocks that may still be seen.
    patience: u32,
    test: PhantomData<T>,
}

impl<I, L: Lanes, P: Halves, T: Intersect> Visitor<I> for Any<'_, L, P, T> {
    #[inline(always)]
    fn block(&mut self, block: usize, bound: f32) -> Option<f32> {
        self.patience = self.patience.checked_sub(1)?;
        let tree = self.tree;
        let triangles = &tree.blocks[block].triangles;
        let mut lanes = within_reach(&tree.blocks[block], &self.packet.bundle, bound);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % LANES;
            lanes &= lanes - 1;
            let touch = T::touch(&self.packet.rays, &OfLane { tree, block, lane });
            let mut rays = (touch.hit | touch.open) & self.left;
            while rays != 0 {
                let ray = rays.trailing_zeros() as usize % MOST_RAYS;
                rays &= rays - 1;
                if self.skipped[ray] != triangles[lane] {
                    self.left &= !(touch.hit & 1 << ray);
                    self.open |= touch.open & 1 << ray;
                }
            }
            if self.left == 0 {
                return None;
            }
        }
        Some(bound)
    }
}
