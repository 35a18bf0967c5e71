//! Packet traversal of the wide tree: neighbouring rays, one in each lane. Interval arithmetic tests a box against all
//! rays at once (Boulos, Wald, Shirley 2006).
//!
//! Every operation of the box test is monotone in the ray's origin, in the reciprocal `|r|` of the direction and in
//! the padding `q`, rounding included. So limits of these values limit the entry and the exit of every ray. If they
//! exclude a box, each ray's own test excludes it too.

use crate::intersect::{AnyHitTest, AnyHits, LaneTest};
use crate::leaf::{BroadcastTriangle, TriangleRay};
use crate::rays::{MOST_RAYS, PreparedRays};
use crate::simd::{Halves, Isa, Lanes, PlaneVector, SetLanes, each};
use crate::tree::{BoxPlanes, Bvh8, LANES, NOWHERE, TriangleBlock, place};
use crate::walk::{BoxTest, MetBoxes, TraversalStack, Visitor, walk};
use cpu_ref::scale::MIN_NONZERO;
use geom::Hit;
use std::marker::PhantomData;

/// Rays that are traced together.
pub(crate) struct RayPacket<L, P> {
    pub(crate) rays: TriangleRay<L>,
    pub(crate) bundle: Bundle<P>,
    /// Factor from each ray's distances to units of the first ray. A power of two.
    pub(crate) to_first_ray: L,
    /// The `t_max` of each ray.
    pub(crate) t_max: L,
}

/// Limit on the ratio of direction lengths in one packet, each rounded to a power of two by its largest component.
/// Distances then stay in the normal range.
const MAX_LENGTH_RATIO: f32 = 16.0;

impl<L: Lanes, P: Halves> RayPacket<L, P> {
    /// Creates a packet. Returns `None` if a ray is not [ready](PreparedRays::ready), if directions differ in main axis
    /// or sign, or if their exponents differ too much.
    #[inline(always)]
    pub(crate) fn of(group: &PreparedRays<L>) -> Option<Self> {
        let main = group.main_of_all()?;
        let inverse = each!(i => L::load(&group.inverse[i]));
        let [x, y, z] = inverse;
        let turned = [is_negative(x)?, is_negative(y)?, is_negative(z)?];
        let back = L::load(&group.back);
        let to_first_ray = back.mul(L::splat(1.0 / group.back.as_ref()[0]));
        if to_first_ray.most() > MAX_LENGTH_RATIO * to_first_ray.least() {
            return None;
        }
        Some(Self {
            rays: TriangleRay::all(group, main),
            bundle: Bundle::new(group, turned, to_first_ray),
            to_first_ray,
            t_max: L::load(&group.limits[1]),
        })
    }
}

/// Returns whether a component is negative, or `None` if its sign differs among the rays.
#[inline(always)]
fn is_negative<L: Lanes>(d: L) -> Option<bool> {
    let negative = L::bits(d.less(L::splat(0.0)));
    (negative == 0 || negative == L::ALL).then_some(negative != 0)
}

/// Bounds on a packet's rays. As in a node, the first half of a vector is for lower planes and the second half for
/// upper planes.
#[derive(Clone, Copy)]
pub(crate) struct Bundle<P> {
    /// The greatest origin for lower planes, the least for upper planes. These give the earliest entry and the latest
    /// exit.
    origin: [P; 3],
    /// The least `|r|`, then the greatest. Both are negated for upper planes.
    inverse: [[P; 2]; 3],
    /// The greatest padding `q`.
    pad: [P; 3],
    /// For each axis, true if directions are negative, so that the upper planes are the near ones.
    turned: [bool; 3],
    /// The least `t_min` for near planes. Negative infinity for far planes, whose distances are negated.
    floor: P,
    /// The greatest `t_max`, in units of the first ray.
    t_max: f32,
}

impl<P: Halves> Bundle<P> {
    /// Computes the bounds. `to_first_ray` is [`RayPacket::to_first_ray`], and `turned` marks axes with negative
    /// directions.
    #[inline(always)]
    fn new<L: Lanes>(group: &PreparedRays<L>, turned: [bool; 3], to_first_ray: L) -> Self {
        let [t_min, t_max] = [L::load(&group.limits[0]), L::load(&group.limits[1])];
        let origin = each!(i => L::load(&group.origin[i]));
        Self {
            origin: each!(i => halves(origin[i].most(), origin[i].least())),
            inverse: each!(i => {
                let r = L::load(&group.inverse[i]).abs().mul(to_first_ray);
                let (least, most) = (r.least(), r.most());
                [halves(least, -least), halves(most, -most)]
            }),
            pad: each!(i => P::splat(L::load(&group.pad[i]).mul(to_first_ray).most())),
            turned,
            floor: halves(t_min.mul(to_first_ray).least(), f32::NEG_INFINITY),
            t_max: t_max.mul(to_first_ray).most(),
        }
    }

    /// Runs [`BoxTest::meet`] on planes in registers: lower planes, then upper planes.
    #[inline(always)]
    fn meet_planes(&self, planes: &[P; 3], best: f32) -> MetBoxes<P::Half> {
        // Each lane becomes a lower bound on the entry distance or on the negated exit distance. `turned` swaps the
        // halves for negative directions, so that entries are in the low half.
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
        MetBoxes {
            lanes: P::Half::bits(spans.low().at_most(exit)),
            entry: spans.low(),
        }
    }
}

impl<P: Halves> BoxTest<P::Half> for Bundle<P> {
    #[inline(always)]
    fn meet(&self, planes: &BoxPlanes, best: f32) -> MetBoxes<P::Half> {
        let planes = each!(axis => P::load(&planes[axis]));
        self.meet_planes(&planes, best)
    }
}

/// Returns a vector with `low` for all lower planes and `high` for all upper planes.
#[inline(always)]
fn halves<P: Halves>(low: f32, high: f32) -> P {
    P::join(P::Half::splat(low), P::Half::splat(high))
}

/// Closest hits so far, one per lane.
pub(crate) struct PacketHits<L: Lanes> {
    /// Distances in units of the prepared directions.
    pub(crate) t: L,
    pub(crate) u: L,
    pub(crate) v: L,
    /// Places of the triangles.
    pub(crate) places: [u32; MOST_RAYS],
    /// Lanes that the filter of `exact` cannot decide.
    pub(crate) open: u32,
}

/// The skipped triangle of each lane, for rays that skip no triangle.
pub(crate) const NONE_SKIPPED: [u32; MOST_RAYS] = [Hit::MISS.triangle; MOST_RAYS];

/// A search that tests the rays of a packet with one triangle at a time.
pub(crate) trait PacketSearch<L> {
    /// Tests a triangle. Returns whether a bound has changed. Must be `#[inline(always)]`.
    fn triangle(&mut self, rays: &TriangleRay<L>, triangle: BroadcastTriangle<'_>) -> bool;

    /// Returns the distance up to which each ray searches.
    fn bound(&self) -> L;
}

/// Searches the triangles that a packet may hit. Returns `false` if tracing its rays singly is likely to be faster.
#[inline(always)]
pub(crate) fn search<I: Isa>(
    tree: &Bvh8,
    packet: &RayPacket<I::Packet, I::Planes>,
    stack: &mut TraversalStack,
    search: &mut impl PacketSearch<I::Packet>,
) -> bool {
    let mut visitor = PacketVisitor {
        tree,
        packet,
        search,
        budget: TRIANGLE_BUDGET,
    };
    let bundle = &packet.bundle;
    !walk::<I>(tree, bundle, bundle.t_max, stack, &mut visitor)
}

/// Number of triangles that a closest-hit packet tests before its rays are traced singly. Packets that test more are
/// usually slower, because each ray hits a different triangle.
const TRIANGLE_BUDGET: u32 = 256;

struct PacketVisitor<'a, L: Lanes, P, S> {
    tree: &'a Bvh8,
    packet: &'a RayPacket<L, P>,
    search: &'a mut S,
    /// Number of triangles that may still be tested.
    budget: u32,
}

impl<I, L: Lanes, P: Halves, S: PacketSearch<L>> Visitor<I> for PacketVisitor<'_, L, P, S> {
    #[inline(always)]
    fn block(&mut self, block: usize, bound: f32) -> Option<f32> {
        let (tree, packet) = (self.tree, self.packet);
        let lanes = within_reach(&tree.blocks[block], &packet.bundle, bound);
        self.budget = self.budget.checked_sub(lanes.count_ones())?;
        let mut changed = false;
        for lane in SetLanes::<LANES>(lanes) {
            let triangle = BroadcastTriangle { tree, block, lane };
            changed |= self.search.triangle(&packet.rays, triangle);
        }
        if changed {
            return Some(self.search.bound().mul(packet.to_first_ray).most());
        }
        Some(bound)
    }
}

/// Number of blocks that an any-hit packet visits before its rays are traced singly. If the origins of shadow rays are
/// far apart, the packet's bounds are loose and it visits too many blocks.
const BLOCK_BUDGET: u32 = 16;

/// Returns the active lanes that hit any triangle except the lane's skipped one. Returns `None` if tracing the rays
/// singly is likely to be faster.
#[inline(always)]
pub(crate) fn any<I: Isa, T: AnyHitTest>(
    tree: &Bvh8,
    packet: &RayPacket<I::Packet, I::Planes>,
    active: u32,
    skipped: &[u32; MOST_RAYS],
    stack: &mut TraversalStack,
) -> Option<AnyHits> {
    let mut any = Any {
        tree,
        packet,
        skipped,
        left: active,
        open: 0,
        budget: BLOCK_BUDGET,
        test: PhantomData::<T>,
    };
    let bundle = &packet.bundle;
    let ended = walk::<I>(tree, bundle, bundle.t_max, stack, &mut any);
    (!ended || any.left == 0).then_some(AnyHits {
        hit: active & !any.left,
        open: any.left & any.open,
    })
}

/// Returns the triangles of a block whose own boxes some ray may meet.
#[inline(always)]
fn within_reach<P: Halves>(block: &TriangleBlock, rays: &Bundle<P>, bound: f32) -> u32 {
    let planes = each!(axis => {
        let [a, b, c] = &block.corners[axis];
        let (a, b, c) = (P::Half::load(a), P::Half::load(b), P::Half::load(c));
        P::join(a.min(b).min(c), a.max(b).max(c))
    });
    rays.meet_planes(&planes, bound).lanes
}

pub(crate) struct ClosestOfPacket<'a, L: Lanes, T> {
    pub(crate) tree: &'a Bvh8,
    pub(crate) hits: PacketHits<L>,
    pub(crate) test: PhantomData<T>,
}

impl<L: Lanes, T: LaneTest> PacketSearch<L> for ClosestOfPacket<'_, L, T> {
    #[inline(always)]
    fn triangle(&mut self, rays: &TriangleRay<L>, triangle: BroadcastTriangle<'_>) -> bool {
        let best = &mut self.hits;
        let Some(hits) = T::intersect(rays, &triangle, best.t) else {
            return false;
        };
        let place = place(triangle.block, triangle.lane);
        let mut better = L::bits(hits.t.less(best.t)) & hits.lanes;
        for ray in SetLanes::<MOST_RAYS>(hits.lanes & !better) {
            // At equal distance, the lower index wins.
            let other = best.places[ray];
            if other == NOWHERE || self.tree.triangle_at(place) < self.tree.triangle_at(other) {
                better |= 1 << ray;
            }
        }
        let mask = L::mask(better);
        best.t = best.t.replace(mask, hits.t);
        best.u = best.u.replace(mask, hits.u);
        best.v = best.v.replace(mask, hits.v);
        L::put(&mut best.places, mask, place);
        better != 0
    }

    #[inline(always)]
    fn bound(&self) -> L {
        self.hits.t.max(L::splat(MIN_NONZERO))
    }
}

struct Any<'a, L, P, T> {
    tree: &'a Bvh8,
    packet: &'a RayPacket<L, P>,
    skipped: &'a [u32; MOST_RAYS],
    /// Rays without a hit yet.
    left: u32,
    /// Rays that may have hit something.
    open: u32,
    /// Number of blocks that may still be visited.
    budget: u32,
    test: PhantomData<T>,
}

impl<I, L: Lanes, P: Halves, T: AnyHitTest> Visitor<I> for Any<'_, L, P, T> {
    #[inline(always)]
    fn block(&mut self, block: usize, bound: f32) -> Option<f32> {
        self.budget = self.budget.checked_sub(1)?;
        let tree = self.tree;
        let triangles = &tree.blocks[block].triangles;
        let lanes = within_reach(&tree.blocks[block], &self.packet.bundle, bound);
        for lane in SetLanes::<LANES>(lanes) {
            let hits = T::any_hit(&self.packet.rays, &BroadcastTriangle { tree, block, lane });
            for ray in SetLanes::<MOST_RAYS>((hits.hit | hits.open) & self.left) {
                if self.skipped[ray] != triangles[lane] {
                    self.left &= !(hits.hit & 1 << ray);
                    self.open |= hits.open & 1 << ray;
                }
            }
            if self.left == 0 {
                return None;
            }
        }
        Some(bound)
    }
}
