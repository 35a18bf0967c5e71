//! Properties of hits.

use super::Check;
use crate::Case;
use crate::compare::{named_ray, same_counts, same_results};
use crate::crossings::crossings;
use crate::stage::{Traced, interpolate_and_refit, is_extreme, open, trace_and_wait};
use anyhow::{Context, Result, bail, ensure};
use backend::{Hits, Intersector, Query, QueryKind, Rays};
use geom::{Camera, Ray};

/// Traces a query at each of the case's times, and verifies the result.
fn trace_and_verify(c: &mut Check<'_>, rays: Rays<'_>, kind: QueryKind) -> Result<()> {
    c.open(c.case.times[0])?;
    for &time in &c.case.times {
        c.interpolate_and_refit(time)?;
        let found = trace_and_wait(c.subject, rays, kind)?;
        verify(c, time, Query { rays, kind }, &found)?;
    }
    Ok(())
}

/// Checks that triangle, `t`, `u` and `v` equal the reference's, bit for bit, and that triangles and hits are counted
/// alike.
pub(super) fn verify(c: &mut Check<'_>, time: f64, query: Query<'_>, found: &Traced) -> Result<()> {
    let expected = c.reference.trace(c.case, c.intersector, time, query)?;
    same_results(c.case, time, query.rays, &found.hits, &expected.hits)?;
    same_counts(&found.report, &expected.report).with_context(|| format!("at time {time:?}"))?;
    // With `exact`, a backend may test any ray in exact arithmetic. With `watertight`, only extreme rays.
    let may_be_exact =
        c.intersector == Intersector::Exact || has_extremes(c.case, time, query.rays);
    let exact_rays = found.report.exact_rays;
    ensure!(
        may_be_exact || exact_rays == 0,
        "{exact_rays} rays needed exact arithmetic, expected 0"
    );
    Ok(())
}

fn has_extremes(case: &Case, time: f64, rays: Rays<'_>) -> bool {
    let is_extreme = |origin| is_extreme(&case.animation, time, origin);
    match rays {
        Rays::List(list) => list.iter().any(|r| is_extreme(r.origin)),
        Rays::Camera(camera) => is_extreme(camera.eye),
        Rays::OnDevice(_) => true,
    }
}

/// Tests the closest hits of listed rays, and whether they hit anything.
pub(super) fn listed(c: &mut Check<'_>) -> Result<()> {
    trace_and_verify(c, c.rays(), QueryKind::Closest)?;
    trace_and_verify(c, c.rays(), QueryKind::Any)
}

/// Tests rays that the device generates from a camera, with shadows, and the shadows of listed rays.
pub(super) fn shadows(c: &mut Check<'_>) -> Result<()> {
    let (case, light) = (c.case, c.case.light);
    for rays in [Rays::Camera(&case.camera), c.rays()] {
        trace_and_verify(c, rays, QueryKind::ClosestAndShadow { light })?;
    }
    Ok(())
}

/// Tests that rays generated from a camera have the same hits as the same rays in a list, for every intersector.
pub(super) fn camera_is_rays(c: &mut Check<'_>) -> Result<()> {
    let (case, now, light) = (c.case, c.case.times[1], c.case.light);
    let list: Vec<Ray> = case.camera.rays().collect();
    let camera = Rays::Camera(&case.camera);
    c.open(case.times[0])?;
    c.interpolate_and_refit(now)?;
    for kind in [
        QueryKind::Closest,
        QueryKind::Any,
        QueryKind::ClosestAndShadow { light },
    ] {
        let given = c.trace_and_wait(Rays::List(&list), kind)?;
        let made = c.trace_and_wait(camera, kind)?;
        same_results(case, now, camera, &made, &given)?;
    }
    Ok(())
}

/// Tests that any-hit reports a hit exactly if closest-hit does, for every intersector.
pub(super) fn any_is_closest(c: &mut Check<'_>) -> Result<()> {
    c.open(c.case.times[0])?;
    c.interpolate_and_refit(c.case.times[1])?;
    let closest = c.closest()?.closest;
    let any = c.trace_and_wait(c.rays(), QueryKind::Any)?.blocked;
    let [a, b] = [closest.len(), any.len()];
    ensure!(a == b, "{a} closest hits, but {b} any-hit results");
    let mut pairs = closest.iter().zip(&any).enumerate();
    if let Some((i, (hit, any))) = pairs.find(|(_, (hit, any))| hit.is_hit() != (**any == 1)) {
        let ray = named_ray(c.rays(), i);
        bail!("closest hit {hit:?}, any hit {any}: {ray}");
    }
    Ok(())
}

/// Tests that queries traced in one submission have the same hits as separate queries, if the backend supports it.
pub(super) fn together(c: &mut Check<'_>) -> Result<()> {
    let case = c.case;
    let half = Camera {
        width: case.camera.width.div_ceil(2),
        ..case.camera
    };
    let [all, half, list] = [Rays::Camera(&case.camera), Rays::Camera(&half), c.rays()];
    let queries = [
        (all, QueryKind::Closest),
        (list, QueryKind::Any),
        (half, QueryKind::Closest),
        (half, QueryKind::Any),
        (list, QueryKind::Closest),
    ];
    let queries = queries.map(|(rays, kind)| Query { rays, kind });
    c.open(case.times[0])?;
    let capabilities = &c.subject.device().capabilities;
    if !capabilities.can_batch(c.intersector, &queries) {
        return Ok(());
    }
    for &time in &case.times {
        c.interpolate_and_refit(time)?;
        c.subject.trace(&queries)?;
        let ticket = c.subject.submit()?;
        let (counted_hits, mut sum) = (c.subject.wait(ticket)?.hits, 0);
        let mut found = vec![Hits::default(); queries.len()];
        for (index, hits) in found.iter_mut().enumerate() {
            c.subject.take_hits(ticket, index, hits)?;
        }
        for (place, (query, found)) in queries.into_iter().zip(&found).enumerate() {
            let alone = trace_and_wait(c.subject, query.rays, query.kind)?;
            let answered = same_results(case, time, query.rays, found, &alone.hits);
            answered.with_context(|| format!("query {place}"))?;
            sum += alone.report.hits;
        }
        ensure!(
            counted_hits == sum,
            "the report counts {counted_hits} hits, expected {sum}"
        );
    }
    Ok(())
}

/// Tests that no ray leaves a closed body without a hit. Rays from inside must cross the body an odd number of times,
/// rays from outside an even number of times.
pub(super) fn leaks(c: &mut Check<'_>) -> Result<()> {
    let (placed, described) = (&c.case.body, &c.case.body_rays);
    let animation = placed.animation();
    let rays: Vec<Ray> = described.iter().map(|ray| placed.ray(ray)).collect();
    open(c.subject, &animation, 0.0, c.intersector)?;
    interpolate_and_refit(c.subject, &animation, 0.0)?;
    let hits = c
        .trace_and_wait(Rays::List(&rays), QueryKind::Closest)?
        .closest;
    let crossings = crossings(c.subject, c.intersector, &animation, &rays)?;
    for (i, ray) in described.iter().enumerate() {
        let (is_hit, count) = (hits[i].is_hit(), crossings[i]);
        let is_right = (count > 0) == is_hit && (count % 2 == 1) == ray.kind.is_inside;
        ensure!(
            is_right,
            "{}: {:?}, hit: {is_hit}, crossings: {count}; {}",
            placed.body.name,
            ray.kind,
            named_ray(Rays::List(&rays), i),
        );
    }
    Ok(())
}
