//! Far geometry: a hit depends only on the ray, the triangle and the intersector, not on the rest of the scene.

use super::Check;
use crate::compare::same_results;
use crate::stage::{interpolate_and_refit, open, trace_and_wait, vertices, with_triangle};
use anyhow::{Context, Result, ensure};
use backend::{Hits, Query, QueryKind, Rays};
use geom::{Animation, Hit, Point, Ray, Triangle};
use std::sync::Arc;

/// Distances of the stray triangle from the origin. With a triangle at any of these distances, a scene of unit size has
/// scale exponent 0.
const DISTANCES: [f32; 5] = [1e3, 1e5, 1e6, 1e8, 1e9];

/// Traces a scene, a stray triangle, and a scene of both. Tests that each ray's hit in the scene of both is, bit for
/// bit, the closer of its two separate hits.
pub(super) fn apart(c: &mut Check<'_>) -> Result<()> {
    let case = c.case;
    let points = vertices(&case.animation, case.times[1]);
    let near = StaticScene::new(points, case.animation.triangles().to_vec())?;
    let stray = Stray::of(case.random_bits);
    let far = StaticScene::new(stray.corners.to_vec(), vec![[0, 1, 2]])?;
    let both = StaticScene(Arc::new(with_triangle(&near.0, stray.corners)));
    let range = near.0.range(near.0.pose(0.0));
    let is_scaled = near.0.scale_exponent() != 0 || both.0.scale_exponent() != 0;
    if is_scaled || range.extreme || range.tiny {
        // The test does not apply, because the scenes may have different units or rays are tested in exact arithmetic.
        return Ok(());
    }
    let mut rays = case.rays.clone();
    rays.extend(stray.rays());
    let light = case.light;
    let list = |kind| Query {
        rays: Rays::List(&rays),
        kind,
    };
    let queries = [
        list(QueryKind::Closest),
        list(QueryKind::Any),
        Query {
            rays: Rays::Camera(&case.camera),
            kind: QueryKind::ClosestAndShadow { light },
        },
    ];
    let [near_found, far_found, found] = [&near, &far, &both].map(|s| s.trace_all(c, &queries));
    let (near_found, far_found, found) = (near_found?, far_found?, found?);
    let mut aimed = far_found[0].closest[case.rays.len()..].iter();
    let hits_all = aimed.all(Hit::is_hit);
    ensure!(hits_all, "a ray aimed at {stray:?} misses it");
    let count = near.0.triangle_count() as u32;
    for (i, query) in queries.iter().enumerate() {
        let alone = near_found[i].closest.iter().zip(&far_found[i].closest);
        let expected: Vec<Hit> = alone.map(|(a, b)| closer(a, b, count)).collect();
        let expected = Hits {
            closest: expected,
            ..found[i].clone()
        };
        let same = same_results(case, case.times[1], query.rays, &found[i], &expected);
        same.with_context(|| format!("with {stray:?}"))?;
    }
    let pairs = near_found[1].blocked.iter().zip(&far_found[1].blocked);
    let expected_blocked: Vec<u8> = pairs.map(|(a, b)| a | b).collect();
    let same = found[1].blocked == expected_blocked;
    ensure!(same, "any-hit results differ with {stray:?}");
    Ok(())
}

/// Returns the closer of a scene's hit and the stray triangle's, whose index is `count`.
fn closer(near: &Hit, far: &Hit, count: u32) -> Hit {
    let triangle = if far.is_hit() { count } else { far.triangle };
    let far = Hit { triangle, ..*far };
    if far.is_before(near) { far } else { *near }
}

struct StaticScene(Arc<Animation>);

impl StaticScene {
    fn new(points: Vec<Point>, triangles: Vec<[u32; 3]>) -> Result<Self> {
        Ok(Self(Arc::new(Animation::new(vec![points], triangles)?)))
    }

    fn trace_all(&self, c: &mut Check<'_>, queries: &[Query<'_>]) -> Result<Vec<Hits>> {
        open(c.subject, &self.0, 0.0, c.intersector)?;
        interpolate_and_refit(c.subject, &self.0, 0.0)?;
        let answer =
            |query: &Query<'_>| Ok(trace_and_wait(c.subject, query.rays, query.kind)?.hits);
        queries.iter().map(answer).collect()
    }
}

/// A triangle far from the origin.
#[derive(Debug)]
struct Stray {
    distance: f32,
    corners: Triangle,
}

impl Stray {
    fn of(random_bits: u64) -> Self {
        let distance = DISTANCES[random_bits as usize % DISTANCES.len()];
        let corner = |p: Point| p.map(|x| x * distance);
        let all = [[1.0, 0.1, -0.2], [0.9, 0.3, 0.1], [0.95, -0.1, 0.2]];
        Self {
            distance,
            corners: all.map(corner),
        }
    }

    /// Returns rays to the centre of the triangle, from the scene, from half way and from behind.
    fn rays(&self) -> impl Iterator<Item = Ray> {
        let [a, b, c] = self.corners;
        let middle: Point = std::array::from_fn(|i| (a[i] + b[i] + c[i]) / 3.0);
        let starts = [0.0, 0.5, 2.0].map(|x| [0.3 + x * self.distance, 0.1, -0.2]);
        let to_middle = move |from: Point| std::array::from_fn(|i| middle[i] - from[i]);
        starts
            .into_iter()
            .map(move |from| Ray::new(from, to_middle(from)))
    }
}
