//! The closest-hit searches of intersectors. The search of `exact` is in `exact.rs`.

use crate::intersect::{AnyHitTest, LaneTest};
use crate::packet::{self, ClosestOfPacket, PacketHits, RayPacket};
use crate::rays::{MOST_RAYS, OneRay};
use crate::simd::{Isa, Lanes, PlaneVector};
use crate::single::{ClosestOfRay, PlacedHit};
use crate::tree::{Bvh8, NOWHERE};
use crate::walk::{NodeRay, TraversalStack, walk};
use geom::Hit;
use std::marker::PhantomData;

/// An intersector with its closest-hit searches in the wide tree. All functions must be `#[inline(always)]`.
pub(crate) trait ClosestSearch: AnyHitTest {
    /// True if the searches find only places of triangles. `cpu-ref` then computes the values of each hit.
    const IS_FILTER: bool;

    /// Returns the closest hit of one ray, with `t` in scaled units. A miss has place [`NOWHERE`].
    fn closest_of_ray<I: Isa>(
        tree: &Bvh8,
        ray: &OneRay<'_, impl Lanes>,
        stack: &mut TraversalStack,
    ) -> PlacedHit;

    /// Returns the closest hits of a packet, or `None` if tracing its rays singly is likely to be faster.
    fn closest_of_packet<I: Isa>(
        tree: &Bvh8,
        packet: &RayPacket<I::Packet, I::Planes>,
        stack: &mut TraversalStack,
    ) -> Option<PacketHits<I::Packet>>;
}

impl<T: LaneTest> ClosestSearch for T {
    const IS_FILTER: bool = false;

    #[inline(always)]
    fn closest_of_ray<I: Isa>(
        tree: &Bvh8,
        ray: &OneRay<'_, impl Lanes>,
        stack: &mut TraversalStack,
    ) -> PlacedHit {
        let mut closest = ClosestOfRay {
            tree,
            ray,
            test: PhantomData::<T>,
            best: PlacedHit {
                hit: Hit {
                    t: ray.t_max(),
                    ..Hit::MISS
                },
                place: NOWHERE,
                is_open: false,
            },
        };
        let node_ray = NodeRay::<I::Eight>::new(ray, tree.own_padding);
        walk::<I>(tree, &node_ray, ray.t_max(), stack, &mut closest);
        closest.best
    }

    #[inline(always)]
    fn closest_of_packet<I: Isa>(
        tree: &Bvh8,
        packet: &RayPacket<I::Packet, I::Planes>,
        stack: &mut TraversalStack,
    ) -> Option<PacketHits<I::Packet>> {
        let mut closest = ClosestOfPacket {
            test: PhantomData::<T>,
            tree,
            hits: PacketHits {
                t: packet.t_max,
                u: I::Packet::splat(0.0),
                v: I::Packet::splat(0.0),
                places: [NOWHERE; MOST_RAYS],
                open: 0,
            },
        };
        packet::search::<I>(tree, packet, stack, &mut closest).then_some(closest.hits)
    }
}
