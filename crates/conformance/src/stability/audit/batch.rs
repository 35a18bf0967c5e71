//! A batch of rays with exact answers, and the comparison of backends with them.

use super::BatchSpec;
use crate::compare::{ray_text, triangle_text};
use crate::oracle::ExactHit;
use crate::stability::stability_test::AnsweredScene;
use crate::stage::trace_and_wait;
use backend::{Backend, Intersector, QueryKind, Rays, Result};
use geom::Hit;
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
    /// Number of rays that the backend tested in exact arithmetic.
    pub settled: u64,
    /// Number of rays whose triangle or miss differs from the exact one.
    pub wrong: u64,
    /// Number of rays with the right triangle whose `t`, `u` or `v` is not the exact number rounded once.
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
    pub fn run(&self, subject: &mut dyn Backend, intersector: Intersector) -> Result<AuditCounts> {
        let scene = &self.answered.scene;
        let closest = scene.trace(subject, intersector)?;
        let any = trace_and_wait(subject, Rays::List(&scene.rays), QueryKind::Any)?.hits;
        let mut tally = AuditCounts {
            settled: closest.report.settled,
            ..AuditCounts::default()
        };
        let found = closest.hits.closest.iter().zip(&any.blocked);
        for (number, (expected, (hit, &any))) in self.answered.exact.iter().zip(found).enumerate() {
            let wrong = hit.triangle != self.answered.triangle(number);
            let wrong_any = (any == 1) != expected.is_some();
            let is_exact = |e: ExactHit| {
                [hit.t, hit.u, hit.v].map(f32::to_bits) == e.rounded.map(f32::to_bits)
            };
            let wrong_t = !wrong && !expected.is_none_or(is_exact);
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
