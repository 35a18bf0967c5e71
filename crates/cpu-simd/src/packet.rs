//! Packet traversal of the wide tree: neighbouring rays, one in each lane. Boxes are tested against all rays at once,
//! by interval arithmetic (Boulos, Wald, Shirley 2006).
//!
//! Every operation of the box test is monotone in the ray's origin, in `|r|` and in `q`, rounding included. So bounds
//! on these give bounds on every ray's entry and exit. A box that the bounds exclude is excluded by each ray's own
//! test.

use crate::intersect::{Intersect, LaneTest, Touch};
use crate::leaf::{OfLane, TriangleRay};
use crate::rays::{Group, MOST_RAYS};
use crate::simd::{Halves, Isa, Lanes, Vector, each};
use crate::tree::{Block, LANES, NOWHERE, Planes, Wide, place};
use crate::walk::{BoxTest, Stack, Visitor, walk};
use geom::Hit;
use std::marker::PhantomData;

/// Rays that are traced together.
pub(crate) struct Packet<L, P> {
    pub(crate) rays: TriangleRay<L>,
    pub(crate) bundle: Bundle<P>,
    /// Factor from distances of each ray to the units of the first ray, a power of two.
    pub(crate) level: L,
    /// The `t_max` of each ray.
    /// The greatest `t_max`, in units of the first ray.
    pub(crate) t_max: L,
    pub(crate) bound: f32,
}

/// Limit on the ratio of direction lengths in one packet, so that distances stay in the normal range.
const APART: f32 = 16.0;

impl<L: Lanes, P: Halves> Packet<L, P> {
    /// Creates a packet. Returns `None` if some ray is unusual, if directions differ in main axis or sign, or if their
    /// exponents differ by too much.
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

/// Returns whether a component is negative, or `None` if its sign differs among the rays.
#[inline(always)]
fn is_negative<L: Lanes>(d: L) -> Option<bool> {
    let negative = L::bits(d.less(L::splat(0.0)));
    (negative == 0 || negative == L::ALL).then_some(negative != 0)
}

/// Bounds on a packet's rays. Halves are as in a node, lower planes first.
#[derive(Clone, Copy)]
pub(crate) struct Bundle<P> {
    /// The origin with the earliest entry or the latest exit: greatest for lower planes, least for upper ones.
    origin: [P; 3],
    /// The least `|r|`, then the greatest. Both are negated for upper planes.
    inverse: [[P; 2]; 3],
    /// The greatest `q`.
    pad: [P; 3],
    turned: [bool; 3],
    /// The least `t_min` for the entries, negative infinity for the negated exits.
    floor: P,
}

impl<P: Halves> Bundle<P> {
    /// Computes the bounds. `level` brings distances of all rays to one unit, exactly. `turned` marks negative
    /// directions.
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

    /// Runs [`BoxTest::meet`] on planes in registers: lower ones, then upper ones.
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

/// Joins `low`, for lower planes, and `high`, for upper ones.
#[inline(always)]
fn halves<P: Halves>(low: f32, high: f32) -> P {
    P::join(P::Half::splat(low), P::Half::splat(high))
}

/// Closest hits so far, one per lane.
pub(crate) struct Found<L: Lanes> {
    /// Distances in units of the prepared directions.
    pub(crate) t: L,
    pub(crate) u: L,
    pub(crate) v: L,
    /// Places of the triangles.
    pub(crate) places: [u32; MOST_RAYS],
    /// Lanes that rounded arithmetic cannot decide.
    pub(crate) open: u32,
}

/// A `skipped` argument of [`any`] that skips no triangle.
pub(crate) const NONE: [u32; MOST_RAYS] = [Hit::MISS.triangle; MOST_RAYS];

/// Number of triangles that a packet may still test before its rays are traced singly, as when each hits a different triangle.
pub(crate) struct Patient(u32);

impl Patient {
    pub(crate) const FULL: Self = Self(256);

    /// Subtracts tested triangles. Returns `None` if this exceeds the remaining number.
    #[inline(always)]
    pub(crate) fn spend(&mut self, triangles: u32) -> Option<()> {
        self.0 = self.0.checked_sub(triangles)?;
        Some(())
    }
}

/// Returns the closest hits of a packet, or `None` if tracing its rays singly is likely to be faster.
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

/// Number of blocks that a packet visits before its rays are traced singly. Packets are wide where hits are far apart.
const PATIENCE: u32 = 16;

/// Returns the lanes of `asked` that hit any triangle except the one in `skipped`, or `None` if tracing the rays singly
/// is likely to be faster.
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

/// Returns the triangles of a block whose own boxes some ray may meet.
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
            // At equal distance, the lower index wins.
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
    /// Rays without a hit yet.
    left: u32,
    /// Rays that may have hit something.
    open: u32,
    /// Number of blocks that may still be visited.
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
