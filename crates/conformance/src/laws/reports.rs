//! What a backend says of its own work.

use crate::Case;
use crate::stage::{open, open_with, plainly, robust_methods, stand, start};
use backend::{Backend, FrameReport, Intersector, Method, QueryKind, Rays};
use geom::Point;

/// Inactive and degenerate triangles, hits and blocked hits are counted alike. How many rays `exact` settles depends
/// on how close its rounded arithmetic comes, which is a backend's own affair; `watertight` settles extreme rays alone.
pub(crate) fn counts(
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
) -> Result<(), String> {
    let list = Rays::List(&case.rays);
    let shadow = QueryKind::ClosestAndShadow { light: case.light };
    let camera = Rays::Camera(&case.camera);
    for [method, usual] in robust_methods([&*subject, &*reference])? {
        for query in [
            (camera, shadow),
            (list, QueryKind::Closest),
            (list, QueryKind::Any),
        ] {
            let seen = counted(case, subject, method, query)?;
            let expected = counted(case, reference, usual, query)?;
            if seen != expected {
                let kind = query.1;
                return Err(format!(
                    "inactive, degenerate, hits, blocked are {seen:?} for {kind:?} by {method:?}, expected {expected:?}"
                ));
            }
        }
    }
    Ok(())
}

/// Whether any ray is answered in exact arithmetic, whatever the backend: see [`geom::Range`].
fn has_extremes(case: &Case, time: f64, rays: Rays<'_>) -> bool {
    let animation = &case.animation;
    let range = animation.range(animation.pose(time));
    let unit = f64::from(-animation.scale_exponent()).exp2();
    let is_extreme = |o: Point| range.is_extreme(o.map(|x| (f64::from(x) * unit) as f32));
    match rays {
        Rays::List(list) => list.iter().any(|r| is_extreme(r.origin)),
        Rays::Camera(camera) => is_extreme(camera.eye),
    }
}

fn counted(
    case: &Case,
    backend: &mut dyn Backend,
    method: Method,
    (rays, kind): (Rays<'_>, QueryKind),
) -> Result<Vec<[u64; 4]>, String> {
    open_with(backend, &case.animation, case.times[0], method).map_err(plainly)?;
    let mut all = Vec::new();
    for &time in &case.times {
        stand(backend, &case.animation, time)?;
        let ticket = start(backend, rays, kind)?;
        let r = backend.wait(ticket).map_err(plainly)?;
        let may_settle = match method.intersector {
            Intersector::Exact => true,
            Intersector::Watertight => has_extremes(case, time, rays),
            _ => false,
        };
        if !may_settle && r.settled != 0 {
            return Err(format!("{} rays are settled by {method:?}", r.settled));
        }
        all.push([r.inactive, r.degenerate, r.hits, r.blocked]);
    }
    Ok(all)
}

/// Times are there for stages done and missing for stages left out; a
/// device's clock never runs backwards; asked again, a report is the same.
pub(crate) fn stages(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let rays = Rays::List(&case.rays);
    open(subject, &case.animation, case.times[0])?;
    stand(subject, &case.animation, case.times[1])?;
    let whole = start(subject, rays, QueryKind::Closest)?;
    let traced = start(subject, rays, QueryKind::Any)?;
    let first = subject.wait(whole).map_err(plainly)?;
    let second = subject.wait(traced).map_err(plainly)?;
    if subject.wait(whole).map_err(plainly)? != first {
        return Err("a report changed between two looks at it".to_owned());
    }
    same_stages("the whole frame", &first, [true, true, true, true, false])?;
    same_stages(
        "the second trace",
        &second,
        [false, false, false, true, false],
    )?;
    match (first.times.begun_ms, second.times.begun_ms) {
        (Some(a), Some(b)) if a > b => Err(format!("the clock went from {a} ms to {b} ms")),
        (Some(_), None) | (None, Some(_)) => Err("the clock comes and goes".to_owned()),
        _ => Ok(()),
    }
}

/// A backend without a clock may leave all times out, but none that tells may tell of what was not done. What both
/// `interpolate` and `preprocess` took may be told as the latter's.
fn same_stages(what: &str, report: &FrameReport, done: [bool; 5]) -> Result<(), String> {
    let t = &report.times;
    let told = [
        t.interpolate_ms,
        t.preprocess_ms,
        t.refit_ms,
        t.trace_primary_ms,
        t.trace_shadow_ms,
    ];
    let timed = told.iter().any(Option::is_some);
    let together = done[1] && t.interpolate_ms.is_none() && t.preprocess_ms.is_some();
    let done = [done[0] && !together, done[1], done[2], done[3], done[4]];
    let fits = |(ms, done): (&Option<f64>, bool)| ms.is_some() == (done && timed);
    let sound = |ms: f64| ms.is_finite() && ms >= 0.0;
    let all = told.iter().flatten().chain([&t.device_ms]);
    if told.iter().zip(done).all(fits) && all.copied().all(sound) {
        return Ok(());
    }
    Err(format!("{what} has times {t:?}, done was {done:?}"))
}
