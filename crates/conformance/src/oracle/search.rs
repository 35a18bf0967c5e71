//! The oracle itself: many triangles, one ray at a time.

use crate::oracle::cull::Boxes;
use crate::oracle::exact::{Crossing, cross};
use crate::oracle::filter::{Verdict, judge};
use geom::{Moment, Ray, Triangle};
use num_traits::ToPrimitive;

/// One exact hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExactHit {
    /// Index of the triangle.
    pub triangle: u32,
    /// The exact distance in units of the direction, rounded once.
    pub t: f64,
    /// Whether the hit point lies exactly on an edge or a vertex of the triangle.
    pub edge: bool,
    /// Whether another triangle is hit at exactly the same distance.
    pub tie: bool,
}

/// Answers for triangles that stand still. Rays are independent, so `&Oracle` may be shared by threads.
#[derive(Clone, Debug)]
pub struct Oracle {
    corners: Vec<Triangle>,
    boxes: Boxes,
}

impl Oracle {
    /// An oracle over triangles in the order of their indices.
    #[must_use]
    pub fn new(corners: Vec<Triangle>) -> Self {
        let active = |i: &u32| is_active(&corners[*i as usize]);
        let active = (0..corners.len() as u32).filter(active).collect();
        let boxes = Boxes::new(&corners, active);
        Self { corners, boxes }
    }

    /// An oracle over a moment.
    #[must_use]
    pub fn at(moment: &Moment<'_>) -> Self {
        let triangles = 0..moment.animation().triangle_count() as u32;
        Self::new(triangles.map(|i| moment.corners(i)).collect())
    }

    /// The closest hit: least exact `t`, then least index. A ray that is not valid misses.
    #[must_use]
    pub fn closest(&self, ray: &Ray) -> Option<ExactHit> {
        let mut bound = f64::INFINITY;
        let mut maybe = Vec::new();
        self.judged(ray, |triangle, verdict| {
            match verdict {
                Verdict::Miss => {}
                Verdict::Maybe(span) => maybe.push((triangle, span.low)),
                Verdict::Hit(span) => {
                    bound = bound.min(span.high);
                    maybe.push((triangle, span.low));
                }
            }
            bound
        });
        maybe.retain(|&(_, low)| low <= bound);
        let hits = self.settle(ray, maybe.into_iter().map(|m| m.0));
        hits.into_iter().next()
    }

    /// Every triangle hit, by exact `t`, then by index.
    #[must_use]
    pub fn all(&self, ray: &Ray) -> Vec<ExactHit> {
        let mut maybe = Vec::new();
        self.judged(ray, |triangle, verdict| {
            if verdict != Verdict::Miss {
                maybe.push(triangle);
            }
            f64::INFINITY
        });
        self.settle(ray, maybe.into_iter())
    }

    /// The hit of one triangle by itself, if it is hit; `tie` is then `false`.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn hit_of(&self, ray: &Ray, triangle: u32) -> Option<ExactHit> {
        let possible = is_active(&self.corners[triangle as usize]) && ray.is_valid();
        let hits = self.settle(ray, possible.then_some(triangle).into_iter());
        hits.into_iter().next()
    }

    /// Every triangle whose box the ray may meet, with what double precision says of it, as far as `visit` asks
    /// (see [`Boxes::near`]).
    fn judged(&self, ray: &Ray, mut visit: impl FnMut(u32, Verdict) -> f64) {
        if ray.is_valid() {
            let corners = &self.corners;
            self.boxes
                .near(ray, |i| visit(i, judge(ray, &corners[i as usize])));
        }
    }

    /// Settles candidates in whole numbers.
    fn settle(&self, ray: &Ray, candidates: impl Iterator<Item = u32>) -> Vec<ExactHit> {
        let mut hits: Vec<(u32, Crossing)> = candidates
            .filter_map(|i| Some((i, cross(ray, &self.corners[i as usize])?)))
            .collect();
        hits.sort_by(|(i, a), (j, b)| a.t.cmp(&b.t).then(i.cmp(j)));
        let same = |i: usize, j: usize| hits.get(j).is_some_and(|h| h.1.t == hits[i].1.t);
        (0..hits.len())
            .map(|i| ExactHit {
                triangle: hits[i].0,
                t: to_f64(&hits[i].1),
                edge: hits[i].1.edge,
                tie: same(i, i + 1) || (i > 0 && same(i, i - 1)),
            })
            .collect()
    }
}

fn is_active(corners: &Triangle) -> bool {
    corners.iter().flatten().all(|x| x.is_finite())
}

/// The nearest `f64`, ties to even.
fn to_f64(crossing: &Crossing) -> f64 {
    crossing.t.to_f64().expect("a distance is a number")
}

#[cfg(test)]
#[path = "tests/mod.rs"]
mod tests;
