//! Closest hits of a few rays, and what their shadows need of them.

use super::together::MOST_RAYS;
use super::trace::WideTracer;
use super::tree::NOWHERE;
use crate::simd::{Isa, Lanes, each};
use geom::Hit;

/// Closest hits, and where their triangles lie.
pub(super) struct ClosestHits {
    pub(super) hits: [Hit; MOST_RAYS],
    pub(super) places: [u32; MOST_RAYS],
}

impl ClosestHits {
    pub(super) const MISSES: Self = Self {
        hits: [Hit::MISS; MOST_RAYS],
        places: [NOWHERE; MOST_RAYS],
    };

    /// Those that hit.
    #[inline(always)]
    pub(super) fn lanes(&self) -> u32 {
        let mut hit = 0;
        for (lane, found) in self.hits.iter().enumerate() {
            hit |= u32::from(found.is_hit()) << lane;
        }
        hit
    }

    /// What each hit.
    #[inline(always)]
    pub(super) fn triangles(&self) -> [u32; MOST_RAYS] {
        self.hits.map(|hit| hit.triangle)
    }

    /// Hits, and whether the light does not reach them.
    #[inline(always)]
    pub(super) fn with(&self, blocked: u32) -> [(Hit, u8); MOST_RAYS] {
        let mut both = [(Hit::MISS, 0); MOST_RAYS];
        for (lane, both) in both.iter_mut().enumerate() {
            *both = (self.hits[lane], (blocked >> lane & 1) as u8);
        }
        both
    }

    /// Corners of what was hit, by corner and axis.
    #[inline(always)]
    pub(super) fn corners<I: Isa>(&self, tracer: &WideTracer<'_>) -> [[I::Packet; 3]; 3] {
        let mut corners = [[I::Packet::splat(0.0).store(); 3]; 3];
        for lane in 0..I::Packet::ALL.count_ones() as usize {
            let (hit, place) = (&self.hits[lane], self.places[lane]);
            if !hit.is_hit() {
                continue;
            }
            let triangle = if place == NOWHERE {
                tracer.geometry.scaled_corners(hit.triangle)
            } else {
                tracer.tree.corners_at(place)
            };
            for corner in 0..3 {
                for axis in 0..3 {
                    corners[corner][axis].as_mut()[lane] = triangle[corner][axis];
                }
            }
        }
        each!(c => each!(i => I::Packet::load(&corners[c][i])))
    }

    /// `u` and `v`.
    #[inline(always)]
    pub(super) fn weights<I: Isa>(&self) -> [I::Packet; 2] {
        let spare = I::Packet::splat(0.0).store();
        let (mut u, mut v) = (spare, spare);
        for (lane, (u, v)) in u.as_mut().iter_mut().zip(v.as_mut()).enumerate() {
            (*u, *v) = (self.hits[lane].u, self.hits[lane].v);
        }
        [I::Packet::load(&u), I::Packet::load(&v)]
    }
}
