//! Results of the rays in all lanes, and their shadow rays: [`Light::ray`] in vector code.

use crate::rays::{InputRays, MOST_RAYS};
use crate::simd::{Isa, Lanes, PlaneVector, each};
use crate::tree::{Bvh8, NOWHERE};
use crate::units::flushed;
use cpu_ref::scale::Scale;
use cpu_ref::shadow::{Light, ROUNDING};
use cpu_ref::{Geometry, HitCounts, RayResult};
use geom::Hit;

/// For each lane, the closest hit and the place of its triangle. `blocked` has a bit for each occluded lane.
pub(crate) struct LaneAnswers {
    pub(crate) hits: [Hit; MOST_RAYS],
    pub(crate) places: [u32; MOST_RAYS],
    pub(crate) blocked: u32,
}

impl LaneAnswers {
    pub(crate) const NOTHING: Self = Self {
        hits: [Hit::MISS; MOST_RAYS],
        places: [NOWHERE; MOST_RAYS],
        blocked: 0,
    };

    /// Returns the result of one lane.
    #[inline(always)]
    pub(crate) fn result(&self, lane: usize) -> RayResult {
        RayResult {
            hit: self.hits[lane],
            blocked: self.blocked >> lane & 1 == 1,
        }
    }

    /// Returns the number of hits and of occluded rays in `lanes`.
    #[inline(always)]
    pub(crate) fn counts(&self, lanes: u32) -> HitCounts {
        HitCounts {
            hits: u64::from((self.hit_lanes() & lanes).count_ones()),
            blocked: u64::from((self.blocked & lanes).count_ones()),
        }
    }

    /// Returns the lanes with a hit.
    #[inline(always)]
    pub(crate) fn hit_lanes(&self) -> u32 {
        let mut hit = 0;
        for (lane, found) in self.hits.iter().enumerate() {
            hit |= u32::from(found.is_hit()) << lane;
        }
        hit
    }

    /// Returns the corners of the hit triangles, by corner and axis.
    #[inline(always)]
    pub(crate) fn corners<I: Isa>(
        &self,
        geometry: &Geometry<'_>,
        tree: &Bvh8,
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

    /// Returns `u` and `v`.
    #[inline(always)]
    pub(crate) fn weights<I: Isa>(&self) -> [I::Packet; 2] {
        let zeros = I::Packet::splat(0.0).store();
        let (mut u, mut v) = (zeros, zeros);
        for (lane, (u, v)) in u.as_mut().iter_mut().zip(v.as_mut()).enumerate() {
            (*u, *v) = (self.hits[lane].u, self.hits[lane].v);
        }
        [I::Packet::load(&u), I::Packet::load(&v)]
    }
}

/// One point per lane.
type Points<L> = [L; 3];

/// Computes shadow rays to `light`. The arguments are the corners of the hit triangles, the weights `u` and `v` of the
/// hits, and the origins of the rays. If an input is not finite, the shadow ray misses.
#[inline(always)]
pub(crate) fn shadow_rays<L: Lanes>(
    light: &Light,
    [a, b, c]: &[Points<L>; 3],
    [u, v]: [L; 2],
    eyes: &Points<L>,
) -> InputRays<L> {
    let at = each!(i => L::splat(light.scaled_position[i]));
    let (e1, e2) = (minus(b, a), minus(c, a));
    let p = each!(i => {
        let p = a[i].add(u.mul(e1[i]).add(v.mul(e2[i])));
        p.replace(p.abs().less(L::splat(Scale::MIN_NONZERO_COORDINATE)), L::splat(0.0))
    });
    let normal = cross(&e1, &e2);
    let side = sign(dot(&normal, &minus(&at, &p)));
    let in_plane = side.abs().less(L::splat(1.0));
    let side = side.replace(in_plane, sign(dot(&normal, &minus(eyes, &p))));
    let largest = p[0].abs().max(p[1].abs()).max(p[2].abs());
    let longest = each!(i => e1[i].abs().max(e2[i].abs()));
    let longest = longest[0].max(longest[1]).max(longest[2]);
    let extent = longest.max(L::splat(light.extent));
    let delta = L::splat(4.0 * ROUNDING)
        .mul(largest)
        .add(L::splat(32.0 * ROUNDING).mul(extent));
    let origin = each!(i => p[i].add(side.mul(sign(normal[i])).mul(delta)));
    InputRays {
        origin,
        direction: minus(&at, &origin),
        limits: [L::splat(0.0), L::splat(1.0)],
    }
}

#[inline(always)]
fn minus<L: Lanes>(a: &Points<L>, b: &Points<L>) -> Points<L> {
    each!(i => a[i].sub(b[i]))
}

#[inline(always)]
fn dot<L: Lanes>(a: &Points<L>, b: &Points<L>) -> L {
    let [x, y, z] = each!(i => flushed(a[i].mul(b[i])));
    x.add(y).add(z)
}

#[inline(always)]
fn cross<L: Lanes>(a: &Points<L>, b: &Points<L>) -> Points<L> {
    each!(i => {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        flushed(a[j].mul(b[k]).sub(a[k].mul(b[j])))
    })
}

/// Returns 1, -1, or 0 for zero and NaN.
#[inline(always)]
fn sign<L: Lanes>(x: L) -> L {
    let zero = L::splat(0.0);
    let positive = zero.replace(zero.less(x), L::splat(1.0));
    positive.replace(x.less(zero), L::splat(-1.0))
}
