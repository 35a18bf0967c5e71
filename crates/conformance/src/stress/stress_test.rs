//! Scenes of one family with their exact answers, and what a backend makes of them.

use crate::crossings::crossings;
use crate::oracle::{ExactHit, Oracle};
use crate::stage::{ask, moment, open, stand};
use crate::stress::scenes::{StressScene, scenes};
use crate::stress::{Cell, Family, Measure, Plan};
use backend::{Backend, FrameReport, Hits, Intersector, Method, QueryKind, Rays, Result};
use geom::Hit;
use rayon::prelude::*;

/// A family's scenes and rays, answered exactly.
#[derive(Clone, Debug)]
pub struct StressTest {
    family: Family,
    scenes: Vec<Answered>,
}

/// A scene with what its rays hit.
#[derive(Clone, Debug)]
pub(super) struct Answered {
    pub(super) scene: StressScene,
    pub(super) exact: Vec<Option<ExactHit>>,
}

impl StressTest {
    /// Makes and answers the rays of a family.
    #[must_use]
    pub fn new(family: Family, plan: &Plan) -> Self {
        let scenes = scenes(family, plan).into_par_iter();
        Self {
            family,
            scenes: scenes.map(Answered::new).collect(),
        }
    }

    /// The family.
    #[must_use]
    pub fn family(&self) -> Family {
        self.family
    }

    /// Asks a backend everything; `None` if it does not support the intersector.
    ///
    /// # Errors
    /// The subject failed.
    pub fn ask(&self, subject: &mut dyn Backend, intersector: Intersector) -> Result<Option<Cell>> {
        let method = Method {
            intersector,
            ..Method::default()
        };
        if !subject.supports(method) {
            return Ok(None);
        }
        let mut sum: Vec<(Measure, u64, u64)> = Vec::new();
        for scene in &self.scenes {
            for (i, (measure, count, of)) in scene.count(subject, method)?.into_iter().enumerate() {
                if i == sum.len() {
                    sum.push((measure, 0, 0));
                }
                sum[i].1 += count;
                sum[i].2 += of;
            }
        }
        let arithmetic = subject.device().arithmetic;
        Ok(Some(Cell::new(self.family, intersector, &sum, arithmetic)))
    }
}

impl Answered {
    /// Asks the oracle, on as many threads as there are.
    pub(super) fn new(scene: StressScene) -> Self {
        let oracle = Oracle::at(&moment(&scene.animation, scene.time));
        let exact = scene.rays.par_iter().map(|r| oracle.closest(r)).collect();
        Self { scene, exact }
    }

    /// What a ray hits, or the triangle of [`Hit::MISS`].
    pub(super) fn triangle(&self, ray: usize) -> u32 {
        self.exact[ray].map_or(Hit::MISS.triangle, |e| e.triangle)
    }

    /// How often each thing happened, and of how many rays.
    fn count(&self, subject: &mut dyn Backend, method: Method) -> Result<Vec<(Measure, u64, u64)>> {
        let scene = &self.scene;
        let (hits, _) = scene.trace(subject, method)?;
        let found = hits.closest;
        let share = |measure, of: usize, is_so: &dyn Fn(usize) -> bool| {
            let count = (0..found.len()).filter(|&i| is_so(i)).count();
            (measure, count as u64, of as u64)
        };
        let differs = |i: usize| found[i].triangle != self.triangle(i);
        let mut counts = vec![share(Measure::Wrong, found.len(), &differs)];
        let Some(inside) = &scene.inside else {
            return Ok(counts);
        };
        let of = inside.iter().filter(|&&i| i).count();
        let leaks = |i: usize| inside[i] && !found[i].is_hit();
        counts.push(share(Measure::Leaks, of, &leaks));
        // Triangles of `exact` are closed: two that share an edge may both be hit there.
        if method.intersector != Intersector::Exact {
            let crossed = crossings(subject, method, &scene.animation, &scene.rays)?;
            let is_double = |i: usize| (crossed[i] % 2 == 1) != inside[i];
            counts.push(share(Measure::DoubleHits, found.len(), &is_double));
        }
        Ok(counts)
    }
}

impl StressScene {
    /// What the scene's rays hit first.
    pub(super) fn trace(
        &self,
        subject: &mut dyn Backend,
        method: Method,
    ) -> Result<(Hits, FrameReport)> {
        open(subject, &self.animation, self.built, method)?;
        stand(subject, &self.animation, self.time)?;
        ask(subject, Rays::List(&self.rays), QueryKind::Closest)
    }
}
