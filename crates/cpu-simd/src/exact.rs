//! The vectorized filter of intersector `exact`: see "Filter" in `docs/design/hits.md`.
//!
//! If the filter cannot decide the hit of a ray, `cpu-ref` traces the ray again.

use crate::intersect::{AnyHitTest, AnyHits};
use crate::leaf::{BlockTriangles, BroadcastTriangle, TriangleRay, Triangles, edges, solve};
use crate::packet::{self, PacketHits, PacketSearch, RayPacket};
use crate::rays::{MOST_RAYS, OneRay};
use crate::search::ClosestSearch;
use crate::simd::{Isa, Lanes, PlaneVector, SetLanes};
use crate::single::PlacedHit;
use crate::tree::{Bvh8, LANES, NOWHERE, place};
use crate::walk::{NodeRay, TraversalStack, Visitor, walk};
use cpu_ref::scale::MIN_NONZERO;
use cpu_ref::{FILTER_UNDERFLOW_ERROR, SHEAR_ERROR, T_ERROR};
use geom::Hit;

/// Intersector `exact` in lanes.
pub(crate) struct ExactFilter;

impl AnyHitTest for ExactFilter {
    #[inline(always)]
    fn any_hit<L: Lanes>(ray: &TriangleRay<L>, triangles: &impl Triangles<L>) -> AnyHits {
        match filter(ray, triangles, ray.t_max) {
            Some(possible) => AnyHits {
                hit: possible.sure,
                open: possible.lanes & !possible.sure,
            },
            None => AnyHits::default(),
        }
    }
}

impl ClosestSearch for ExactFilter {
    const IS_FILTER: bool = true;

    #[inline(always)]
    fn closest_of_ray<I: Isa>(
        tree: &Bvh8,
        ray: &OneRay<'_, impl Lanes>,
        stack: &mut TraversalStack,
    ) -> PlacedHit {
        let mut closest = ExactClosestOfRay {
            tree,
            ray,
            bound: ray.t_max(),
            low: NEVER,
            other: NEVER,
            place: NOWHERE,
        };
        let node_ray = NodeRay::<I::Eight>::new(ray, tree.own_padding);
        walk::<I>(tree, &node_ray, ray.t_max(), stack, &mut closest);
        PlacedHit {
            hit: Hit::MISS,
            place: closest.place,
            is_open: closest.other < NEVER && closest.other <= closest.bound,
        }
    }

    #[inline(always)]
    fn closest_of_packet<I: Isa>(
        tree: &Bvh8,
        packet: &RayPacket<I::Packet, I::Planes>,
        stack: &mut TraversalStack,
    ) -> Option<PacketHits<I::Packet>> {
        let never = I::Packet::splat(NEVER);
        let mut closest = ExactClosestOfPacket {
            bound: packet.t_max,
            low: never,
            other: never,
            places: [NOWHERE; MOST_RAYS],
            placed: 0,
        };
        let completed = packet::search::<I>(tree, packet, stack, &mut closest);
        let zero = I::Packet::splat(0.0);
        let other = closest.other;
        let open = I::Packet::both(other.less(never), other.at_most(closest.bound));
        completed.then_some(PacketHits {
            t: closest.bound,
            u: zero,
            v: zero,
            places: closest.places,
            open: I::Packet::bits(open),
        })
    }
}

/// A distance beyond the lower end of every interval.
const NEVER: f32 = f32::MAX;

/// Triangles that may be hit. If a triangle is hit, the exact `t` is in `low..=high`.
struct PossibleHits<L> {
    /// Lanes that may be hit.
    lanes: u32,
    /// Lanes that are certainly hit within the ray's limits.
    sure: u32,
    low: L,
    high: L,
}

/// Runs the filter of `cpu-ref` in each lane. Excludes triangles whose own box is entered after `best`.
#[inline(always)]
fn filter<L: Lanes>(
    ray: &TriangleRay<L>,
    triangles: &impl Triangles<L>,
    best: L,
) -> Option<PossibleHits<L>> {
    let corners = ray.relative(triangles);
    let [x, y, along] = ray.sheared(&corners);
    let edges = edges(&x, &y);
    let wide = largest(&x).max(largest(&y));
    let deepest = largest(&along);
    let slack = L::splat(SHEAR_ERROR).mul(wide.add(L::splat(2.0).mul(deepest)));
    let slack = slack.add(L::splat(FILTER_UNDERFLOW_ERROR));
    let doubt = slack.mul(L::splat(4.0).mul(wide).add(L::splat(2.0).mul(slack)));
    let [u, v, w] = edges;
    let (least, most) = (u.min(v).min(w), u.max(v).max(w));
    let missed = L::bits(L::both(least.less(doubt.neg()), doubt.less(most)));
    let possible = L::ALL & !missed;
    if possible == 0 {
        return None;
    }
    let spans = ray.spans_of(&corners, best);
    let possible = possible & spans.lanes;
    if possible == 0 {
        return None;
    }
    // If an edge function is NaN, so is the sum.
    let sum = u.abs().add(v.abs()).add(w.abs());
    let inside = L::either(doubt.less(least), most.less(doubt.neg()));
    let certain = L::both(inside, sum.less(L::splat(f32::INFINITY)));
    let depths = ray.depths(&along);
    let [t, _, _] = solve(&edges, &depths);
    let four = L::splat(4.0).mul(doubt);
    let least_det = u.add(v).add(w).abs().sub(four);
    let size = largest(&depths);
    let spread = greatest(&depths).sub(least_of(&depths));
    let small = L::splat(MIN_NONZERO).mul(L::splat(1.0).add(size));
    let of_weights = L::splat(3.0)
        .mul(doubt.mul(spread).add(small))
        .div(least_det);
    let error = of_weights
        .add(L::splat(T_ERROR).mul(size))
        .add(L::splat(FILTER_UNDERFLOW_ERROR));
    let (near, far) = (t.sub(error).max(spans.entry), t.add(error).min(spans.exit));
    let is_bounded = L::both(L::both(certain, four.less(least_det)), near.at_most(far));
    let low = spans.entry.replace(is_bounded, near);
    let high = spans.exit.replace(is_bounded, far);
    let [after, before] = sure_limits(ray);
    let within = L::both(after.less(low), high.less(before));
    Some(PossibleHits {
        lanes: possible,
        sure: possible & L::bits(L::both(certain, within)),
        low,
        high,
    })
}

/// Returns the same limits as [`cpu_ref::scale::PreparedRay::sure_limits`].
#[inline(always)]
fn sure_limits<L: Lanes>(ray: &TriangleRay<L>) -> [L; 2] {
    // 2^-125 and 2^127 in the ray's own units. `small` is at least 2^-99 in scaled units.
    let small = L::splat(f32::MIN_POSITIVE * 2.0).div(ray.back);
    let small = small.max(L::splat(2.0 * MIN_NONZERO));
    let large = L::splat(f32::from_bits(254 << 23)).div(ray.back);
    let after = ray.t_min.replace(ray.t_min.abs().less(small), small);
    let before = ray.t_max.replace(ray.t_max.abs().less(small), small.neg());
    [after.max(large.neg()), before.min(large)]
}

#[inline(always)]
fn largest<L: Lanes>([a, b, c]: &[L; 3]) -> L {
    a.abs().max(b.abs()).max(c.abs())
}

#[inline(always)]
fn greatest<L: Lanes>([a, b, c]: &[L; 3]) -> L {
    a.max(*b).max(*c)
}

#[inline(always)]
fn least_of<L: Lanes>([a, b, c]: &[L; 3]) -> L {
    a.min(*b).min(*c)
}

/// The closest hit of one ray so far.
struct ExactClosestOfRay<'a, R: Lanes> {
    tree: &'a Bvh8,
    ray: &'a OneRay<'a, R>,
    /// Least upper end of the intervals of certain hits, or `t_max` if there is no certain hit.
    bound: f32,
    /// Lower end of the interval that ends at `bound`.
    low: f32,
    /// Least lower end of the intervals of other candidates that may be the closest hit.
    other: f32,
    /// Place of the triangle whose interval ends at `bound`, or [`NOWHERE`].
    place: u32,
}

impl<I: Isa, R: Lanes> Visitor<I> for ExactClosestOfRay<'_, R> {
    #[inline(always)]
    fn block(&mut self, block: usize, bound: f32) -> Option<f32> {
        let tree = self.tree;
        let ray = TriangleRay::<I::Eight>::single(self.ray);
        let (triangles, best) = (BlockTriangles { tree, block }, I::Eight::splat(bound));
        let Some(possible) = filter(&ray, &triangles, best) else {
            return Some(bound);
        };
        let (low, high) = (possible.low.store(), possible.high.store());
        for lane in SetLanes::<LANES>(possible.lanes) {
            let (low, high) = (low[lane], high[lane]);
            if low > self.bound {
                continue;
            }
            if possible.sure >> lane & 1 == 0 || high >= self.bound {
                self.other = self.other.min(low);
                continue;
            }
            if self.place != NOWHERE && self.low <= high {
                self.other = self.other.min(self.low);
            }
            (self.bound, self.low) = (high, low);
            self.place = place(block, lane);
        }
        Some(self.bound)
    }
}

/// The closest hits of a packet so far, one per lane. The fields correspond to those of [`ExactClosestOfRay`].
struct ExactClosestOfPacket<L> {
    bound: L,
    low: L,
    other: L,
    places: [u32; MOST_RAYS],
    /// Lanes that have a hit.
    placed: u32,
}

impl<L: Lanes> PacketSearch<L> for ExactClosestOfPacket<L> {
    #[inline(always)]
    fn triangle(&mut self, rays: &TriangleRay<L>, triangle: BroadcastTriangle<'_>) -> bool {
        let Some(possible) = filter(rays, &triangle, self.bound) else {
            return false;
        };
        let (low, high) = (possible.low, possible.high);
        let candidates = possible.lanes & L::bits(low.at_most(self.bound));
        let better = candidates & possible.sure & L::bits(high.less(self.bound));
        let overlapping = better & self.placed & L::bits(self.low.at_most(high));
        let other_low = self.low.replace(L::mask(candidates & !better), low);
        let others = L::mask((candidates & !better) | overlapping);
        self.other = self.other.replace(others, self.other.min(other_low));
        let mask = L::mask(better);
        self.bound = self.bound.replace(mask, high);
        self.low = self.low.replace(mask, low);
        L::put(&mut self.places, mask, place(triangle.block, triangle.lane));
        self.placed |= better;
        better != 0
    }

    #[inline(always)]
    fn bound(&self) -> L {
        self.bound
    }
}
