//! Compares `exact` with the oracle, which shares no code with it, on every ray. Also tests `t_min` and `t_max` with
//! every intersector that rounds.

use backend::{Backend, Intersector, Query, QueryKind, Rays};
use conformance::oracle::{ExactHit, Oracle};
use conformance::stage::{open, triangles};
use conformance::{Target, aimed, nth_case};
use geom::{Aabb, Animation, Hit, Point, Ray, Triangle, is_active, is_degenerate};
use integration::scenes::Source;
use integration::share;
use integration::stage::{camera, closest, host, light, picture_rays, trace};
use rayon::prelude::*;
use std::sync::Arc;

/// Relative error bound of `t`, 32 roundings. Triangles that are seen edge-on may exceed it.
const T_ERROR: f64 = 16.0 * f32::EPSILON as f64;

/// Checks that `exact` equals the oracle for the rays of a picture, and for rays at interiors, edges and vertices from
/// near and far. `watertight` may differ near edges, which a camera ray hits only by chance: a few in a million, so
/// hardly ever more than two of 38,400.
pub(crate) fn rays(source: Source) {
    let animation = source.animation();
    let middle = 0.618 * animation.end();
    let mut host = host();
    for time in [0.0, middle] {
        let rays = picture_rays(&animation);
        let mut all = rays.clone();
        for target in Target::ALL {
            for distance in [0.6, 2.0, 100.0, 1e4] {
                all.extend(aimed(&animation, time, target, distance, share(750)));
            }
        }
        let expected = check(&mut host, &animation, time, &all);
        open(&mut host, &animation, time, Intersector::Watertight).unwrap();
        let found = closest(&mut host, &animation, time, &rays);
        let off = |(hit, expected): &(&Hit, &Option<ExactHit>)| match expected {
            Some(e) => {
                let [found, t] = [hit.t, e.rounded[0]].map(f64::from);
                hit.triangle != e.triangle || (found - t).abs() > T_ERROR * t
            }
            None => hit.is_hit(),
        };
        let count = found.iter().zip(&expected).filter(off).count();
        assert!(count <= 2, "{count} differ at {time}");
    }
}

/// Loads the scene with `exact`, and checks the closest hit and the any-hit answer of every ray. Returns the oracle's
/// answers.
pub(crate) fn check(
    backend: &mut dyn Backend,
    animation: &Arc<Animation>,
    time: f64,
    list: &[Ray],
) -> Vec<Option<ExactHit>> {
    let oracle = Oracle::new(triangles(animation, time));
    open(backend, animation, time, Intersector::Exact).unwrap();
    let closest = closest(backend, animation, time, list);
    let (rays, kind) = (Rays::List(list), QueryKind::Any);
    let any = trace(backend, animation, time, Query { rays, kind }).blocked;
    let bits = |values: [f32; 3]| values.map(f32::to_bits);
    let answered = (0..list.len()).into_par_iter().map(|i| {
        let expected = oracle.closest(&list[i]);
        let miss = (Hit::MISS.triangle, [f32::INFINITY, 0.0, 0.0]);
        let (triangle, values) = expected.map_or(miss, |e| (e.triangle, e.rounded));
        let hit = closest[i];
        let same = hit.triangle == triangle
            && bits([hit.t, hit.u, hit.v]) == bits(values)
            && (any[i] == 1) == expected.is_some();
        let (ray, found, any) = (list[i], closest[i], any[i]);
        assert!(
            same,
            "at {time}: {ray:?} finds {found:?} (any: {any}), expected {expected:?}"
        );
        expected
    });
    answered.collect()
}

/// Tests slivers, stacks, far and tiny scenes, with rays along axes, through edges, and with limits.
pub(crate) fn odd_scenes() {
    let mut host = host();
    for case in (0..share(280) as u32).map(|number| nth_case(7, number)) {
        for &time in &case.times[..2] {
            check(&mut host, &case.animation, time, &case.rays);
        }
    }
}

/// Tests shadow rays. They are recomputed here, operation by operation, and traced by the oracle.
pub(crate) fn shadows(source: Source) {
    let animation: Arc<Animation> = source.animation();
    let scale = animation.scale_exponent();
    assert_eq!(scale, 0, "`shadow_ray` supports only unscaled scenes");
    let list = camera(&animation, [120, 80]).rays().collect::<Vec<_>>();
    let light = light(&animation);
    let time = 0.618 * animation.end();
    let corners = triangles(&animation, time);
    let oracle = Oracle::new(corners.clone());
    let mut host = host();
    open(&mut host, &animation, time, Intersector::Exact).unwrap();
    let kind = QueryKind::ClosestAndShadow { light };
    let rays = Rays::List(&list);
    let hits = trace(&mut host, &animation, time, Query { rays, kind });
    let all = corners.iter().filter(|c| is_active(c) && !is_degenerate(c));
    let bounds = all.map(Aabb::of_triangle).fold(Aabb::EMPTY, Aabb::union);
    let longest = bounds.extent().into_iter().fold(0.0, f32::max);
    for (i, (hit, &blocked)) in hits.closest.iter().zip(&hits.blocked).enumerate() {
        let corners = corners.get(hit.triangle as usize);
        let ray = corners.map(|c| shadow_ray(hit, c, list[i].origin, light, longest));
        let blocks = |ray: &Ray| oracle.all(ray).iter().any(|h| h.triangle != hit.triangle);
        let expected = ray.as_ref().is_some_and(blocks);
        let same = (blocked == 1) == expected;
        assert!(same, "ray {i}, {hit:?}: blocked {blocked}, by {ray:?}");
    }
}

/// Computes the shadow ray by "Shadow rays" in `docs/design/hits.md`, for an unscaled scene in which
/// no number is flushed to zero.
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
    let sides = [above(light), above(eye)];
    let side = sides.into_iter().find(|side| *side != 0.0).unwrap_or(0.0);
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

/// Runs [`check_limits_of`] with every intersector that rounds.
pub(crate) fn check_ray_limits(source: Source) {
    use Intersector::{MollerTrumbore, Watertight, Woop};
    let animation = source.animation();
    for by in [Watertight, Woop, MollerTrumbore] {
        check_limits_of(&animation, by);
    }
}

/// Checks that a ray that ends at its hit misses. A ray that starts just before and ends just behind its hit keeps it.
/// Any-hit must agree with closest-hit.
fn check_limits_of(animation: &Arc<Animation>, by: Intersector) {
    let time = 0.5 * animation.end();
    let mut host = host();
    open(&mut host, animation, time, by).unwrap();
    let mut list = camera(animation, [64, 48]).rays().collect::<Vec<_>>();
    for target in Target::ALL {
        list.extend(aimed(animation, time, target, 1.5, 333));
        list.extend(aimed(animation, time, target, 30.0, 333));
    }
    let hits = closest(&mut host, animation, time, &list);
    let met: Vec<u8> = hits.iter().map(|h| u8::from(h.is_hit())).collect();
    let count = met.iter().filter(|&&m| m == 1).count();
    assert!(count * 50 >= list.len(), "{by}: only {count} rays hit");
    let (rays, kind) = (Rays::List(&list), QueryKind::Any);
    let any = trace(&mut host, animation, time, Query { rays, kind }).blocked;
    assert!(any == met, "{by}: any-hit disagrees with closest-hit");
    let mut changed = |change: fn(&mut Ray, f32)| {
        let mut cut = list.clone();
        let hit = cut.iter_mut().zip(&hits).filter(|(_, h)| h.is_hit());
        hit.for_each(|(ray, hit)| change(ray, hit.t));
        closest(&mut host, animation, time, &cut)
    };
    let before = changed(|ray, t| ray.t_max = t);
    let none = !before.iter().any(Hit::is_hit);
    assert!(none, "{by}: a ray that ends at its closest hit still hits");
    let around = changed(|ray, t| (ray.t_min, ray.t_max) = (t.next_down(), t.next_up()));
    let bits = |h: &Hit| (h.triangle, [h.t, h.u, h.v].map(f32::to_bits));
    let mut pairs = hits.iter().zip(&around).enumerate();
    let other = pairs.find(|(_, (a, b))| bits(a) != bits(b));
    assert!(other.is_none(), "{by}: limits around the hit: {other:?}");
}
