//! The closest-hit searches of intersectors. That of `exact` is in `exact.rs`.

use crate::intersect::{AnyHitTest, LaneTest};
use crate::packet::{self, PacketHits, RayPacket};
use crate::rays::OneRay;
use crate::simd::{Isa, Lanes};
use crate::single::{self, PlacedHit};
use crate::tree::Bvh8;
use crate::walk::TraversalStack;

/// An intersector with its closest-hit searches in the wide tree. All functions must be `#[inline(always)]`.
pub(crate) trait ClosestSearch: AnyHitTest {
    /// True if the searches find only places of triangles. `cpu-ref` then computes the values of each hit.
    const IS_FILTER: bool;

    /// Returns the closest hit of one ray, with `t` in scaled units.
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
        single::closest::<I, T>(tree, ray, stack)
    }

    #[inline(always)]
    fn closest_of_packet<I: Isa>(
        tree: &Bvh8,
        packet: &RayPacket<I::Packet, I::Planes>,
        stack: &mut TraversalStack,
    ) -> Option<PacketHits<I::Packet>> {
        packet::closest::<I, T>(tree, packet, stack)
    }
}
