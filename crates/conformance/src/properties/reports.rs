//! Properties of frame reports, of results that are fetched later, and of scenes that replace one another.

use super::Check;
use crate::compare::same_results;
use crate::stage::{fetch, interpolate_and_refit, open, start};
use anyhow::{Result, bail, ensure};
use backend::{FRAMES_IN_FLIGHT, FrameReport, Hits, QueryKind};
use geom::Animation;
use std::sync::Arc;

/// Tests the times in reports: present for recorded stages and absent for others, and equal when read again.
pub(super) fn stages(c: &mut Check<'_>) -> Result<()> {
    let rays = c.rays();
    c.open(c.case.times[0])?;
    c.interpolate_and_refit(c.case.times[1])?;
    let whole = start(c.subject, rays, QueryKind::Closest)?;
    let traced = start(c.subject, rays, QueryKind::Any)?;
    let first = c.subject.wait(whole)?;
    let second = c.subject.wait(traced)?;
    let same = c.subject.wait(whole)? == first;
    ensure!(same, "a report changed when it was read again");
    same_stages("the whole frame", &first, [true, true, true, true, false])?;
    let traced = [false, false, false, true, false];
    same_stages("the second trace", &second, traced)
}

/// Checks the times of the stages that were `done`.
///
/// A backend without a clock may omit all times. No backend may report a time for a stage that is not `done`. The time
/// of `interpolate` may be included in that of `preprocess`.
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
    ensure!(
        holds,
        "{what} has times {t:?}, expected interpolate, preprocess, refit, primary, shadow: {done:?}"
    );
    Ok(())
}

/// Tests that tickets increase, and that results are kept for as many traces as may be in flight.
pub(super) fn tickets(c: &mut Check<'_>) -> Result<()> {
    let (case, rays) = (c.case, c.rays());
    let times = &case.times[..FRAMES_IN_FLIGHT];
    c.open(times[0])?;
    let mut expected = Vec::new();
    for &time in times {
        c.interpolate_and_refit(time)?;
        expected.push(c.closest()?);
    }
    let mut tickets = Vec::new();
    for &time in times {
        c.interpolate_and_refit(time)?;
        tickets.push(start(c.subject, rays, QueryKind::Closest)?);
    }
    // Neither submissions without a trace nor an unfinished recording may discard results.
    for &time in &case.times {
        c.interpolate_and_refit(time)?;
        tickets.push(c.subject.submit()?);
    }
    c.interpolate_and_refit(case.times[0])?;
    let rise = tickets.is_sorted_by(|a, b| a < b);
    ensure!(rise, "tickets do not increase: {tickets:?}");
    // In descending order of tickets.
    for ((&ticket, expected), &time) in tickets.iter().zip(&expected).zip(times).rev() {
        same_results(case, time, rays, &fetch(c.subject, ticket)?.hits, expected)?;
    }
    Ok(())
}

/// Tests that a scene loaded after another gives the same results as if loaded first, whatever was in flight.
pub(super) fn reload(c: &mut Check<'_>) -> Result<()> {
    let (case, rays, now) = (c.case, c.rays(), c.case.times[1]);
    let once = |c: &mut Check<'_>| -> Result<Hits> {
        c.open(case.times[0])?;
        c.interpolate_and_refit(now)?;
        Ok(c.closest()?)
    };
    let first = once(c)?;
    let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let other = Arc::new(Animation::new(vec![corners], vec![[0, 1, 2]])?);
    open(c.subject, &other, 0.0, c.intersector)?;
    same_results(case, now, rays, &once(c)?, &first)?;
    // Requested positions and unfinished traces of the old scene must not appear in the new one.
    open(c.subject, &other, 0.0, c.intersector)?;
    interpolate_and_refit(c.subject, &other, 0.0)?;
    c.subject.request_positions()?;
    start(c.subject, rays, QueryKind::Closest)?;
    interpolate_and_refit(c.subject, &other, 0.0)?;
    same_results(case, now, rays, &once(c)?, &first)?;
    match c.subject.take_positions()? {
        None => Ok(()),
        Some((ticket, _)) => bail!("positions of {ticket:?} outlived their scene"),
    }
}
