//! Exact hits, computed slowly in integer arithmetic.
//!
//! Every backend, the reference backend included, is measured against these hits. So this module shares no code with
//! any backend. From `geom`, it uses only types and their simplest methods. Its definition of a hit is that of
//! [`backend::Intersector::Exact`]:
//!
//! - Triangles include their edges. A ray through an edge or a vertex hits every triangle that shares it.
//! - A ray in a triangle's plane misses it.
//! - Inactive triangles and those of zero area are never hit.
//! - The float nearest to `t` is in the open interval `(t_min, t_max)`.
//! - The hit with the least exact `t` wins, then the least index.
//!
//! Each ray passes up to three stages. The first two are boxes (`cull`) and double precision with proven error bounds
//! (`filter`). They discard only triangles that the ray certainly misses, or, for the closest hit, triangles behind a
//! certain hit. The third decides the rest in integers (`exact`).

mod cull;
mod exact;
mod filter;
mod nearest;
#[cfg(test)]
mod tests;

use cull::CullTree;
use exact::{Crossing, cross};
use filter::{HitBounds, bound_hit};
use geom::{Moment, Ray, Triangle};

/// One exact hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExactHit {
    /// Index of the triangle.
    pub triangle: u32,
    /// The exact distance and the exact weights of the second and the third corner, each rounded once.
    pub rounded: [f32; 3],
}

/// A triangle that may be the closest hit.
#[derive(Clone, Copy)]
struct NearTriangle {
    index: u32,
    found: HitBounds,
}

/// Exact hits for static triangles. Rays are independent, so threads may share `&Oracle`.
#[derive(Clone, Debug)]
pub struct Oracle {
    corners: Vec<Triangle>,
    boxes: CullTree,
}

impl Oracle {
    /// Creates an oracle over triangles in the order of their indices.
    pub fn new(corners: Vec<Triangle>) -> Self {
        let active = |i: &u32| is_active(&corners[*i as usize]);
        let active = (0..corners.len() as u32).filter(active).collect();
        let boxes = CullTree::new(&corners, active);
        Self { corners, boxes }
    }

    /// Creates an oracle over the triangles of a moment.
    pub fn at(moment: &Moment<'_>) -> Self {
        let triangles = 0..moment.animation().triangle_count() as u32;
        Self::new(triangles.map(|i| moment.corners(i)).collect())
    }

    /// Returns the closest hit: least exact `t`, then least index. A ray that is not valid misses.
    pub fn closest(&self, ray: &Ray) -> Option<ExactHit> {
        let candidates = self.candidates(ray);
        let hits = self.settle(ray, candidates.into_iter().map(|c| c.index));
        hits.into_iter().next()
    }

    /// Returns the triangle of [`Oracle::closest`]. Most rays need no integers here, so this is several times faster.
    pub fn closest_triangle(&self, ray: &Ray) -> Option<u32> {
        match self.candidates(ray)[..] {
            // All other triangles are certainly farther away or missed.
            [only] if only.found.is_sure => Some(only.index),
            _ => self.closest(ray).map(|hit| hit.triangle),
        }
    }

    /// Returns all triangles that may be the closest hit.
    fn candidates(&self, ray: &Ray) -> Vec<NearTriangle> {
        let (mut bound, mut candidates) = (f64::INFINITY, Vec::new());
        self.each_candidate(ray, |index, found| {
            candidates.push(NearTriangle { index, found });
            if found.is_sure {
                bound = bound.min(found.high);
            }
            bound
        });
        candidates.retain(|candidate| candidate.found.low <= bound);
        candidates
    }

    /// Returns every triangle that is hit, ordered by exact `t`, then by index.
    pub fn all(&self, ray: &Ray) -> Vec<ExactHit> {
        let mut maybe = Vec::new();
        self.each_candidate(ray, |triangle, _| {
            maybe.push(triangle);
            f64::INFINITY
        });
        self.settle(ray, maybe.into_iter())
    }

    /// Calls `visit` for every triangle that the ray may hit, up to the bound that `visit` returns: see
    /// [`CullTree::near`].
    fn each_candidate(&self, ray: &Ray, mut visit: impl FnMut(u32, HitBounds) -> f64) {
        if ray.is_valid() {
            self.boxes.near(ray, |i| {
                let found = bound_hit(ray, &self.corners[i as usize]);
                found.map_or(f64::INFINITY, |found| visit(i, found))
            });
        }
    }

    /// Tests candidates in integers. Returns the hits, ordered by exact `t`, then by index.
    fn settle(&self, ray: &Ray, candidates: impl Iterator<Item = u32>) -> Vec<ExactHit> {
        let crossed = |i| Some((i, cross(ray, &self.corners[i as usize])?));
        let mut hits: Vec<(u32, Crossing)> = candidates.filter_map(crossed).collect();
        hits.sort_by(|(i, a), (j, b)| a.t.cmp(&b.t).then(i.cmp(j)));
        let exact = |(triangle, crossing): &(u32, Crossing)| ExactHit {
            triangle: *triangle,
            rounded: crossing.rounded,
        };
        hits.iter().map(exact).collect()
    }
}

fn is_active(corners: &Triangle) -> bool {
    corners.iter().flatten().all(|x| x.is_finite())
}
