//! What is found of a few rays, and what their shadows need of it.

use crate::simd::{Isa, Lanes, each};
use crate::together::MOST_RAYS;
use crate::tree::{NOWHERE, Wide};
use cpu_ref::geometry::Geometry;
use cpu_ref::tiles::{Answer, Counts};
use geom::Hit;

/// Closest hits, where their triangles lie, and which lanes are blocked.
pub(crate) struct Found {
    pub(crate) hits: [Hit; MOST_RAYS],
    pub(crate) places: [u32; MOST_RAYS],
    pub(crate) blocked: u32,
}

impl Found {
    pub(crate) const NOTHING: Self = Self {
        hits: [Hit::MISS; MOST_RAYS],
        places: [NOWHERE; MOST_RAYS],
        blocked: 0,
    };

    /// Of the ray in one lane.
    #[inline(always)]
    pub(crate) fn answer(&self, lane: usize) -> Answer {
        (self.hits[lane], (self.blocked >> lane & 1) as u8)
    }

    /// Of the rays in these lanes.
    #[inline(always)]
    pub(crate) fn counts(&self, lanes: u32) -> Counts {
        Counts {
            hits: u64::from((self.lanes() & lanes).count_ones()),
            blocked: u64::from((self.blocked & lanes).count_ones()),
        }
    }

    /// Lanes that hit.
    #[inline(always)]
    pub(crate) fn lanes(&self) -> u32 {
        let mut hit = 0;
        for (lane, found) in self.hits.iter().enumerate() {
            hit |= u32::from(found.is_hit()) << lane;
        }
        hit
    }

    /// Corners of what was hit, by corner and axis.
    #[inline(always)]
    pub(crate) fn corners<I: Isa>(
        &self,
        geometry: &Geometry<'_>,
        tree: &Wide,
    ) -> [[I::Packet; 3]; 3] {
        let mut corners = [[I::Packet::splat(0.0).store(); 3]; 3];
        for lane in 0..I::Packet::ALL.count_ones() as usize {
            let (hit, place) = (&self.hits[lane], self.places[lane]);
            if !hit.is_hit() {
                continue;
            }
            let triangle = if place == NOWHERE {
                geometry.scaled_corners(hit.triangle)
            } else {
                tree.corners_at(place)
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
    pub(crate) fn weights<I: Isa>(&self) -> [I::Packet; 2] {
        let spare = I::Packet::splat(0.0).store();
        let (mut u, mut v) = (spare, spare);
        for (lane, (u, v)) in u.as_mut().iter_mut().zip(v.as_mut()).enumerate() {
            (*u, *v) = (self.hits[lane].u, self.hits[lane].v);
        }
        [I::Packet::load(&u), I::Packet::load(&v)]
    }
}
