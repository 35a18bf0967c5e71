//! What a backend says of its own work.

use super::Check;
use crate::Case;
use crate::stage::{ask, start};
use anyhow::{Result, bail, ensure};
use backend::{FrameReport, Intersector, QueryKind, Rays};
use geom::Point;

/// Inactive and degenerate triangles, hits and blocked hits are counted alike. How many rays `exact` settles depends
/// on how close its rounded arithmetic comes, which is a backend's own affair; `watertight` settles extreme rays alone.
pub(super) fn counts(c: &mut Check<'_>) -> Result<()> {
    let case = c.case;
    let shadow = QueryKind::ClosestAndShadow { light: case.light };
    for method in c.robust_methods()? {
        c.open_by(method, case.times[0])?;
        for &time in &case.times {
            c.stand(time)?;
            for (rays, kind) in [
                (Rays::Camera(&case.camera), shadow),
                (c.rays(), QueryKind::Closest),
                (c.rays(), QueryKind::Any),
            ] {
                let (_, seen) = ask(c.subject, rays, kind)?;
                let may_settle =
                    method.intersector == Intersector::Exact || has_extremes(case, time, rays);
                ensure!(
                    may_settle || seen.settled == 0,
                    "{} rays are settled by {method:?}",
                    seen.settled
                );
                let expected = c.reference.answer(case, (method, time), rays, kind)?;
                let counts = |r: &FrameReport| [r.inactive, r.degenerate, r.hits, r.blocked];
                let [seen, right] = [&seen, &expected.report].map(counts);
                ensure!(
                    seen == right,
                    "inactive, degenerate, hits, blocked are {seen:?} for {kind:?} by {method:?} at time {time:?}, expected {right:?}"
                );
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

/// Times are there for stages done and missing for stages left out; a
/// device's clock never runs backwards; asked again, a report is the same.
pub(super) fn stages(c: &mut Check<'_>) -> Result<()> {
    let rays = c.rays();
    c.open(c.case.times[0])?;
    c.stand(c.case.times[1])?;
    let whole = start(c.subject, rays, QueryKind::Closest)?;
    let traced = start(c.subject, rays, QueryKind::Any)?;
    let first = c.subject.wait(whole)?;
    let second = c.subject.wait(traced)?;
    let same = c.subject.wait(whole)? == first;
    ensure!(same, "a report changed between two looks at it");
    same_stages("the whole frame", &first, [true, true, true, true, false])?;
    let traced = [false, false, false, true, false];
    same_stages("the second trace", &second, traced)?;
    match (first.times.begun_ms, second.times.begun_ms) {
        (Some(a), Some(b)) if a > b => bail!("the clock went from {a} ms to {b} ms"),
        (Some(_), None) | (None, Some(_)) => bail!("the clock comes and goes"),
        _ => Ok(()),
    }
}

/// A backend without a clock may leave all times out, but none may report one of what was not done. What both
/// `interpolate` and `preprocess` took may be reported as the latter's.
fn same_stages(what: &str, report: &FrameReport, done: [bool; 5]) -> Result<()> {
    let t = &report.times;
    let stages = [
        t.interpolate_ms,
        t.preprocess_ms,
        t.refit_ms,
        t.trace_primary_ms,
        t.trace_shadow_ms,
    ];
    let timed = stages.iter().any(Option::is_some);
    let together = done[1] && t.interpolate_ms.is_none() && t.preprocess_ms.is_some();
    let done = [done[0] && !together, done[1], done[2], done[3], done[4]];
    let fits = |(ms, done): (&Option<f64>, bool)| ms.is_some() == (done && timed);
    let sound = |ms: f64| ms.is_finite() && ms >= 0.0;
    let all = stages.iter().flatten().chain([&t.device_ms]);
    let holds = stages.iter().zip(done).all(fits) && all.copied().all(sound);
    ensure!(holds, "{what} has times {t:?}, done was {done:?}");
    Ok(())
}
