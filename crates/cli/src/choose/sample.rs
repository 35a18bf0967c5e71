//! How many rays of a run an intersector answers wrongly: a sample against exact arithmetic.

use super::{ReusedBackend, Run};
use crate::session::trace_lists;
use crate::stop::Stop;
use backend::{Hits, Intersector, Method, QueryKind, Rays};
use fastrand::Rng;
use geom::Ray;
use pipeline::Update;

/// Frames of the run whose rays are asked.
const MOMENTS: usize = 3;
/// The most rays of a sample.
const MOST: f64 = (1 << 20) as f64;
/// Rays of a run and what exact arithmetic says of them. A ray is wrong where
/// another triangle is named, or another shadow.
pub(super) struct Sample {
    /// Times and rays.
    sheets: Vec<(f64, Vec<Ray>)>,
    kind: QueryKind,
    exact: Vec<Hits>,
}

/// Rays that it takes to show that at most `tolerance` a million are wrong, if none is seen to be (the rule of three);
/// with half as many again for a few that are. `None` if they are too many.
pub(super) fn needed(tolerance: f64) -> Option<usize> {
    let rays = 1.5 * 3.0 * 1e6 / tolerance;
    (rays <= MOST).then_some(rays.ceil() as usize)
}

impl Sample {
    /// About `count` rays of the run, answered by `exact`.
    pub(super) fn take(
        backend: &mut ReusedBackend<'_>,
        run: &Run<'_>,
        count: usize,
    ) -> Result<Self, Stop> {
        let mut rng = Rng::with_seed(0);
        let len = run.frames.len();
        let sheets = (0..MOMENTS).map(|i| {
            let time = run.frames[(2 * i + 1) * len / (2 * MOMENTS)].time;
            let rays = (0..count.div_ceil(MOMENTS)).filter_map(|_| draw(run.query.rays, &mut rng));
            (time, rays.collect())
        });
        let mut sample = Self {
            sheets: sheets.collect(),
            kind: run.query.kind,
            exact: Vec::new(),
        };
        sample.exact = sample.ask(backend, Intersector::Exact)?;
        Ok(sample)
    }

    /// How many of them, of how many, an intersector answers wrongly.
    pub(super) fn wrong(
        &self,
        backend: &mut ReusedBackend<'_>,
        intersector: Intersector,
    ) -> Result<[u64; 2], Stop> {
        let answers = self.ask(backend, intersector)?;
        let pairs = self.exact.iter().zip(&answers);
        let wrong = pairs.map(|(exact, found)| differing(exact, found)).sum();
        let rays = self.sheets.iter().map(|(_, rays)| rays.len() as u64).sum();
        Ok([wrong, rays])
    }

    fn ask(
        &self,
        backend: &mut ReusedBackend<'_>,
        intersector: Intersector,
    ) -> Result<Vec<Hits>, Stop> {
        let method = Method {
            intersector,
            ..Method::default()
        };
        let mut driver = backend.driver(method, Update::Refit)?;
        let lists = self.sheets.iter().map(|(time, rays)| (*time, &rays[..]));
        let answers: Result<_, _> = trace_lists(&mut driver, self.kind, lists).collect();
        backend.put_back(driver);
        answers
    }
}

/// A ray at random.
fn draw(rays: Rays<'_>, rng: &mut Rng) -> Option<Ray> {
    match rays {
        Rays::Camera(camera) => Some(camera.ray(rng.u32(..camera.width), rng.u32(..camera.height))),
        Rays::List(rays) => rng.choice(rays).copied(),
        Rays::OnDevice(_) => None,
    }
}

/// Rays of which two traces say different things.
fn differing(a: &Hits, b: &Hits) -> u64 {
    let at = |of: &Hits, i: usize| {
        let triangle = of.closest.get(i).map(|hit| hit.triangle);
        (triangle, of.blocked.get(i).copied())
    };
    let rays = a.closest.len().max(a.blocked.len());
    (0..rays).filter(|&i| at(a, i) != at(b, i)).count() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use geom::Hit;

    #[test]
    fn none_wrong_shows_less_the_more_is_tolerated() {
        for tolerance in [5.0, 10.0, 1000.0] {
            let rays = needed(tolerance).unwrap() as u64;
            let most = output::plot::Rate::of(0, rays).unwrap().high;
            assert!(most < tolerance, "{tolerance}: {rays} rays");
        }
        assert_eq!(needed(1.0), None, "more rays than are asked");
        assert_eq!(needed(0.0), None);
    }

    #[test]
    fn a_ray_is_wrong_once_by_its_triangle_or_its_shadow() {
        let hits = |all: [(u32, u8); 4]| Hits {
            closest: all
                .map(|(triangle, _)| Hit {
                    triangle,
                    ..Hit::MISS
                })
                .to_vec(),
            blocked: all.map(|(_, blocked)| blocked).to_vec(),
        };
        let exact = hits([(1, 0), (2, 1), (3, 0), (4, 0)]);
        let found = hits([(1, 0), (2, 0), (9, 0), (9, 1)]);
        assert_eq!(differing(&exact, &found), 3);
        assert_eq!(differing(&exact, &exact.clone()), 0);
    }
}
