//! `exact` against the oracle, which shares no code with it: every ray, without exception.

use crate::watertight::{Verifier, differing};
use backend::{Intersector, QueryKind, Rays};
use conformance::oracle::Oracle;
use conformance::{Target, aimed, nth_case};
use geom::{Animation, Hit, Point, Ray, Triangle};
use integration::scenes::Source;
use integration::share;
use integration::stage::{Stage, camera, light, pixels};
use rayon::prelude::*;
use std::sync::Arc;

/// Rays of a picture, and rays at insides, edges and vertices from near and far: `exact` finds what the oracle does, and
/// `watertight` differs near edges alone. A camera ray passes near an edge by chance only: a few in a million, so hardly
/// ever two of 38,400.
pub(crate) fn rays(source: Source) {
    let animation = source.animation();
    let middle = 0.618 * animation.end();
    let both = |time: f64, rays: &[Ray]| {
        let verify = Verifier::at(&animation, time);
        let mut stage = Stage::new(&animation, Intersector::Exact, 2);
        check(&mut stage, &verify.oracle, time, rays);
        differing(&verify, &animation, time, rays)
    };
    for time in [0.0, middle] {
        let count = both(time, &pixels(&animation));
        assert!(count <= 2, "{count} differ at {time}");
    }
    for target in Target::ALL {
        for distance in [0.6, 2.0, 100.0, 1e4] {
            let rays = aimed(&animation, middle, target, distance, share(1500));
            both(middle, &rays);
        }
    }
}

/// Closest hits and any hits of all rays, each against the oracle.
pub(crate) fn check(stage: &mut Stage, oracle: &Oracle, time: f64, rays: &[Ray]) {
    stage.plant(time);
    let closest = stage.closest(time, rays).closest;
    let any = stage.trace(time, Rays::List(rays), QueryKind::Any).blocked;
    (0..rays.len()).into_par_iter().for_each(|i| {
        let expected = oracle.closest(&rays[i]);
        let triangle = expected.map_or(Hit::MISS.triangle, |e| e.triangle);
        let same = closest[i].triangle == triangle && (any[i] == 1) == expected.is_some();
        let (ray, found) = (rays[i], closest[i]);
        assert!(
            same,
            "at {time}: {ray:?} finds {found:?} (any: {}), expected {expected:?}",
            any[i]
        );
    });
}

/// Slivers, stacks, far and tiny scenes, with rays along axes, through edges, with limits.
pub(crate) fn odd_scenes() {
    for case in (0..share(280) as u32).map(|number| nth_case(7, number)) {
        let mut stage = Stage::new(&case.animation, Intersector::Exact, 2);
        for &time in &case.times[..2] {
            let oracle = Oracle::at(&case.animation.at(time).unwrap());
            check(&mut stage, &oracle, time, &case.rays);
        }
    }
}

/// The shadow's ray is repeated here, operation for operation, and asked of the oracle.
pub(crate) fn shadows(source: Source) {
    let animation: Arc<Animation> = source.animation();
    assert_eq!(
        animation.scale_exponent(),
        0,
        "the oracle knows no scaled units"
    );
    let rays = camera(&animation, [120, 80]).rays().collect::<Vec<_>>();
    let light = light(&animation);
    let time = 0.618 * animation.end();
    let oracle = Oracle::at(&animation.at(time).unwrap());
    let mut stage = Stage::new(&animation, Intersector::Exact, 2);
    stage.plant(time);
    let hits = stage.trace(
        time,
        Rays::List(&rays),
        QueryKind::ClosestAndShadow { light },
    );
    let corners = |t: u32| animation.at(time).unwrap().corners(t);
    let all = (0..animation.triangle_count() as u32).map(corners);
    let hittable = all
        .filter(|c| geom::is_active(c) && !geom::is_degenerate(c))
        .flatten();
    let bounds = hittable.fold(geom::Aabb::EMPTY, |b, p| b.with_point(p));
    let longest = bounds.extent().into_iter().fold(0.0, f32::max);
    for (i, (hit, &blocked)) in hits.closest.iter().zip(&hits.blocked).enumerate() {
        let ray = hit
            .is_hit()
            .then(|| shadow_ray(hit, &corners(hit.triangle), rays[i].origin, light, longest));
        let blocks = |ray: &Ray| oracle.all(ray).iter().any(|h| h.triangle != hit.triangle);
        let expected = ray.as_ref().is_some_and(blocks);
        assert_eq!(
            blocked == 1,
            expected,
            "ray {i}, {hit:?}: blocked, by {ray:?}"
        );
    }
}

/// "Shadow rays" in `docs/design/hits.md`, for a scene that is not scaled and holds no number too small to count.
fn shadow_ray(hit: &Hit, [v0, v1, v2]: &Triangle, eye: Point, light: Point, longest: f32) -> Ray {
    let minus = |a: Point, b: Point| -> Point { std::array::from_fn(|i| a[i] - b[i]) };
    let (e1, e2) = (minus(*v1, *v0), minus(*v2, *v0));
    let p: Point = std::array::from_fn(|i| v0[i] + (hit.u * e1[i] + hit.v * e2[i]));
    let component = |i: usize, j: usize| e1[i] * e2[j] - e1[j] * e2[i];
    let normal = [component(1, 2), component(2, 0), component(0, 1)];
    let above = |q: Point| {
        let d = minus(q, p);
        sign(normal[0] * d[0] + normal[1] * d[1] + normal[2] * d[2])
    };
    let side = if above(light) == 0.0 {
        above(eye)
    } else {
        above(light)
    };
    let largest = p.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    let unit = f32::EPSILON / 2.0;
    let delta = 4.0 * unit * largest + 32.0 * unit * longest;
    let origin: Point = std::array::from_fn(|i| p[i] + side * sign(normal[i]) * delta);
    Ray {
        t_max: 1.0,
        ..Ray::new(origin, minus(light, origin))
    }
}

fn sign(x: f32) -> f32 {
    f32::from(i8::from(x > 0.0) - i8::from(x < 0.0))
}
