//! Scenes of one family with exact answers, and the comparison of backends with them.

use crate::crossings::crossings;
use crate::oracle::Oracle;
use crate::stability::scenes::{StabilityScene, scenes};
use crate::stability::{Family, Measure, MeasuredRate, Plan, StabilityCell};
use crate::stage::{interpolate_and_refit, open, trace_and_wait, triangles};
use backend::{Backend, Intersector, QueryKind, Rays, Result};
use geom::Hit;
use rayon::prelude::*;

/// Scenes and rays of a family, with exact answers.
#[derive(Clone, Debug)]
pub struct StabilityTest {
    family: Family,
    scenes: Vec<AnsweredScene>,
}

/// A scene with the triangles that its rays hit exactly.
#[derive(Clone, Debug)]
struct AnsweredScene {
    scene: StabilityScene,
    exact: Vec<Option<u32>>,
}

impl StabilityTest {
    /// Generates the rays of a family and computes their exact hits.
    pub fn new(family: Family, plan: &Plan) -> Self {
        let scenes = scenes(family, plan).into_par_iter();
        let scenes = scenes.map(AnsweredScene::new).collect();
        Self { family, scenes }
    }

    /// Traces all rays on a backend, and counts wrong answers.
    ///
    /// # Errors
    /// The subject failed.
    pub fn run(
        &self,
        subject: &mut dyn Backend,
        intersector: Intersector,
    ) -> Result<StabilityCell> {
        let mut sum: Vec<MeasuredRate> = Vec::new();
        for scene in &self.scenes {
            let counts = scene.count(subject, intersector)?;
            if sum.is_empty() {
                sum = counts;
                continue;
            }
            for (sum, one) in sum.iter_mut().zip(counts) {
                sum.count += one.count;
                sum.of += one.of;
            }
        }
        let arithmetic = subject.device().arithmetic;
        Ok(StabilityCell::new(
            self.family,
            intersector,
            sum,
            arithmetic,
        ))
    }
}

impl AnsweredScene {
    /// Computes the exact hits, in parallel.
    fn new(scene: StabilityScene) -> Self {
        let oracle = Oracle::new(triangles(&scene.animation, scene.time));
        let rays = scene.rays.par_iter();
        let exact = rays.map(|r| oracle.closest_triangle(r)).collect();
        Self { scene, exact }
    }

    /// Returns the count of each event, with its number of rays.
    fn count(
        &self,
        subject: &mut dyn Backend,
        intersector: Intersector,
    ) -> Result<Vec<MeasuredRate>> {
        let scene = &self.scene;
        open(subject, &scene.animation, scene.built, intersector)?;
        interpolate_and_refit(subject, &scene.animation, scene.time)?;
        let traced = trace_and_wait(subject, Rays::List(&scene.rays), QueryKind::Closest)?;
        let found = traced.hits.closest;
        let share = |measure, of: usize, is_so: &dyn Fn(usize) -> bool| {
            let count = (0..found.len()).filter(|&i| is_so(i)).count();
            MeasuredRate::new(measure, count as u64, of as u64)
        };
        let differs = |i: usize| self.exact[i].unwrap_or(Hit::MISS.triangle) != found[i].triangle;
        let mut counts = vec![share(Measure::Wrong, found.len(), &differs)];
        let Some(inside) = &scene.inside else {
            return Ok(counts);
        };
        let of = inside.iter().filter(|&&i| i).count();
        let leaks = |i: usize| inside[i] && !found[i].is_hit();
        counts.push(share(Measure::Leaks, of, &leaks));
        // Double hits of `exact` are not counted: its triangles include their edges, so a ray may hit two triangles
        // at a shared edge.
        if intersector != Intersector::Exact {
            let crossed = crossings(subject, intersector, &scene.animation, &scene.rays)?;
            let is_double = |i: usize| (crossed[i] % 2 == 1) != inside[i];
            counts.push(share(Measure::DoubleHits, found.len(), &is_double));
        }
        Ok(counts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use backend::Arithmetic;
    use cpu_ref::CpuBackend;

    /// Returns a test of every family.
    fn stability_tests(plan: &Plan) -> Vec<StabilityTest> {
        let all = Family::ALL.into_iter();
        all.map(|family| StabilityTest::new(family, plan)).collect()
    }

    /// Traces with `asked`, but compares with the bounds of `named`.
    fn cells(
        tests: &[StabilityTest],
        asked: Intersector,
        named: Intersector,
    ) -> Vec<StabilityCell> {
        let mut cpu = CpuBackend::new(Some(2)).unwrap();
        let cell = |test: &StabilityTest| {
            let cell = test.run(&mut cpu, asked).unwrap();
            StabilityCell::new(cell.family, named, cell.measured, Arithmetic::IEEE)
        };
        tests.iter().map(cell).collect()
    }

    fn out_of_bounds(cells: &[StabilityCell]) -> Vec<&StabilityCell> {
        cells.iter().filter(|c| !c.is_ok()).collect()
    }

    #[test]
    fn host_rates_are_within_bounds() {
        let mut all = Vec::new();
        let is_full = std::env::var("ABVH_FULL").is_ok_and(|full| full == "1");
        let many = if is_full { 8192 } else { 1024 };
        for (seed, rays) in [(1, many), (77, 500), (78, 33)] {
            let tests = stability_tests(&Plan { seed, rays });
            for by in Intersector::ALL {
                all.extend(cells(&tests, by, by));
            }
        }
        let measured = all.iter().flat_map(|c| &c.measured);
        assert!(measured.clone().all(|m| m.of > 0 && m.bound.is_some()));
        let out_of_bounds = out_of_bounds(&all);
        assert!(out_of_bounds.is_empty(), "{out_of_bounds:#?}");
    }

    #[test]
    fn detects_swapped_intersectors() {
        use Intersector::{Exact, MollerTrumbore, Watertight, Woop};
        let (seed, rays) = (5, 2048);
        let tests = stability_tests(&Plan { seed, rays });
        for (asked, named) in [
            (Woop, Exact),
            (Watertight, Exact),
            (MollerTrumbore, Watertight),
            (Exact, Woop),
            (Watertight, MollerTrumbore),
        ] {
            let cells = cells(&tests, asked, named);
            let out_of_bounds = out_of_bounds(&cells);
            assert!(
                out_of_bounds.len() >= 5,
                "{asked} for {named}: {out_of_bounds:#?}"
            );
        }
    }
}
