//! A batch of rays with exact answers, and the comparison of backends with them.

use super::BatchSpec;
use crate::compare::{ray_text, triangle_text};
use crate::oracle::ExactHit;
use crate::stage::{ask, is_extreme, triangles};
use crate::stress::scenes::StressScene;
use crate::stress::stress_test::AnsweredScene;
use backend::{Backend, Intersector, QueryKind, Rays, Result};
use geom::{Aabb, Hit, Ray, Triangle};
use serde::Serialize;
use std::ops::AddAssign;

/// Maximum number of wrong rays of a batch that are described.
const KEPT: usize = 4;

/// A scene with rays and their exact hits.
#[derive(Clone, Debug)]
pub struct AuditBatch {
    /// Specification of the batch.
    pub spec: BatchSpec,
    pub(super) answered: AnsweredScene,
}

/// Counts of rays and wrong answers.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct AuditCounts {
    /// Number of rays, each traced for the closest hit and for any hit.
    pub rays: u64,
    /// Number of rays that hit.
    pub hits: u64,
    /// Number of rays that hit another triangle at exactly the same distance.
    pub ties: u64,
    /// Number of rays whose closest hit is exactly on an edge or a vertex.
    pub edges: u64,
    /// Number of rays that the backend did not decide by rounded arithmetic.
    pub settled: u64,
    /// Number of rays whose triangle or miss differs from the exact one.
    pub wrong: u64,
    /// Number of rays whose `t` is outside their limits, or has a larger error than documented. With `exact`, number of
    /// rays whose `t`, `u` or `v` is not the exact number rounded once.
    pub wrong_t: u64,
    /// Number of rays with a wrong any-hit answer.
    pub wrong_any: u64,
    /// Descriptions of the first rays that are wrong in any of these ways.
    #[serde(skip)]
    pub first: Vec<String>,
}

impl AuditBatch {
    /// Traces all rays on a backend, for the closest hit and for any hit, and counts wrong answers.
    ///
    /// # Errors
    /// The subject failed.
    pub fn ask(&self, subject: &mut dyn Backend, intersector: Intersector) -> Result<AuditCounts> {
        let scene = &self.answered.scene;
        let closest = scene.trace(subject, intersector)?;
        let any = ask(subject, Rays::List(&scene.rays), QueryKind::Any)?.hits;
        let mut tally = AuditCounts {
            settled: closest.report.settled,
            ..AuditCounts::default()
        };
        let bounds = TBounds::of(scene);
        let found = closest.hits.closest.iter().zip(&any.blocked);
        for (number, (expected, (hit, &any))) in self.answered.exact.iter().zip(found).enumerate() {
            let wrong = hit.triangle != self.answered.triangle(number);
            let wrong_any = (any == 1) != expected.is_some();
            let right_t = |e: ExactHit| match intersector {
                Intersector::Exact => {
                    [hit.t, hit.u, hit.v].map(f32::to_bits) == e.rounded.map(f32::to_bits)
                }
                _ => bounds.allow(&scene.rays[number], &e, hit.t),
            };
            let wrong_t = !wrong && !expected.is_none_or(right_t);
            tally.rays += 1;
            tally.hits += u64::from(expected.is_some());
            tally.ties += u64::from(expected.is_some_and(|e| e.tie));
            tally.edges += u64::from(expected.is_some_and(|e| e.edge));
            tally.wrong += u64::from(wrong);
            tally.wrong_any += u64::from(wrong_any);
            tally.wrong_t += u64::from(wrong_t);
            if (wrong || wrong_any || wrong_t) && tally.first.len() < KEPT {
                tally.first.push(self.wrong(number, *hit, any == 1));
            }
        }
        Ok(tally)
    }

    /// Describes a wrong ray, with both answers and the corners of their triangles.
    fn wrong(&self, number: usize, found: Hit, any: bool) -> String {
        let scene = &self.answered.scene;
        let name = |t| triangle_text(&scene.animation, scene.time, t);
        format!(
            "ray {number} of batch {}, {}: hits {} at t, u, v = {:?} (any: {any}), exactly {} at {:?}",
            self.spec.number,
            ray_text(&scene.rays[number]),
            name(found.triangle),
            [found.t, found.u, found.v],
            name(self.answered.triangle(number)),
            self.answered.exact[number].map(|e| (e.t, e.rounded)),
        )
    }
}

impl AddAssign for AuditCounts {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.hits += other.hits;
        self.ties += other.ties;
        self.edges += other.edges;
        self.settled += other.settled;
        self.wrong += other.wrong;
        self.wrong_any += other.wrong_any;
        self.wrong_t += other.wrong_t;
        let room = KEPT.saturating_sub(self.first.len());
        self.first.extend(other.first.into_iter().take(room));
    }
}

/// `64 * 2^-24`, which exceeds the padding of boxes plus the rounding of their test.
const PADDING: f64 = 64.0 / 16_777_216.0;

/// Permitted errors of `t` for intersectors that round (`docs/design/hits.md`, "Hit").
struct TBounds<'a> {
    scene: &'a StressScene,
    corners: Vec<Triangle>,
}

impl<'a> TBounds<'a> {
    fn of(scene: &'a StressScene) -> Self {
        Self {
            scene,
            corners: triangles(&scene.animation, scene.time),
        }
    }

    /// Returns whether an intersector that rounds may report `t` for an exact hit.
    ///
    /// `t` must be within the ray's limits, if they contain a float. If the ray is extreme, `t` must be rounded once,
    /// else it must be within the padded box of the triangle.
    fn allow(&self, ray: &Ray, hit: &ExactHit, t: f32) -> bool {
        let (least, most) = (ray.t_min.next_up(), ray.t_max.next_down());
        if least <= most && !(least..=most).contains(&t) {
            return false;
        }
        // A subnormal `t` is rounded once more from scaled units.
        let [below, above] = [t.next_down(), t.next_up()].map(f64::from);
        if is_extreme(&self.scene.animation, self.scene.time, ray.origin) {
            return (below..=above).contains(&hit.t) || t == least || t == most;
        }
        let [near, far] = self.own_span(ray, hit.triangle);
        near.min(most.into()) <= above && below <= far.max(least.into())
    }

    /// Returns the interval in which the ray may be inside the triangle's padded box.
    fn own_span(&self, ray: &Ray, triangle: u32) -> [f64; 2] {
        let d = ray.direction.map(f64::from);
        let longest = d.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let axis = d.iter().position(|x| x.abs() == longest).unwrap_or(0);
        let way = |i: usize, x: f32| f64::from(x) - f64::from(ray.origin[i]);
        let own = Aabb::of_triangle(&self.corners[triangle as usize]);
        let ends = |i: usize| [own.min[i], own.max[i]].map(|x| way(i, x).abs());
        let reach = (0..3).flat_map(ends);
        let padding = PADDING * reach.fold(0.0, f64::max) / longest;
        let [a, b] = [own.min[axis], own.max[axis]].map(|x| way(axis, x) / d[axis]);
        [a.min(b) - padding, a.max(b) + padding]
    }
}
