//! Submissions, answers that wait to be fetched, and scenes that follow one another.

use super::Check;
use crate::compare::answers;
use crate::stage::{boxes_anew, fetch, open, stand, start};
use anyhow::{Result, bail, ensure};
use backend::{FRAMES_IN_FLIGHT, Hits, QueryKind};
use geom::Animation;
use std::sync::Arc;

/// Tickets rise; a later one done means the earlier are; answers are kept for as many traces as may be under way.
pub(super) fn tickets(c: &mut Check<'_>) -> Result<()> {
    let (case, rays) = (c.case, c.rays());
    let times = &case.times[..FRAMES_IN_FLIGHT];
    c.open(times[0])?;
    let mut expected = Vec::new();
    for &time in times {
        c.stand(time)?;
        expected.push(c.closest()?);
    }
    let mut tickets = Vec::new();
    for &time in times {
        c.stand(time)?;
        tickets.push(start(c.subject, rays, QueryKind::Closest)?);
    }
    // A submission without a trace takes no answer away.
    c.stand(case.times[2])?;
    tickets.push(c.subject.submit()?);
    let rise = tickets.is_sorted_by(|a, b| a < b);
    ensure!(rise, "tickets do not rise: {tickets:?}");
    // Each twice, the later ones first.
    for _ in 0..2 {
        for ((&ticket, expected), &time) in tickets.iter().zip(&expected).zip(times).rev() {
            answers(case, time, rays, &fetch(c.subject, ticket)?.0, expected)?;
        }
    }
    Ok(())
}

/// Stages whose input did not change may be left out, or be done again.
pub(super) fn at_rest(c: &mut Check<'_>) -> Result<()> {
    let now = c.case.times[1];
    c.open(c.case.times[0])?;
    c.stand(now)?;
    let first = c.closest()?;
    let again = |c: &mut Check<'_>| answers(c.case, now, c.rays(), &c.closest()?, &first);
    again(c)?;
    boxes_anew(c.subject)?;
    again(c)?;
    // Each stage in a submission of its own.
    c.interpolate(now)?;
    c.subject.submit()?;
    c.subject.preprocess()?;
    c.subject.submit()?;
    c.subject.refit()?;
    c.subject.submit()?;
    again(c)
}

/// A scene loaded after another answers as if it were the first, whatever was under way.
pub(super) fn reload(c: &mut Check<'_>) -> Result<()> {
    let (case, rays, now) = (c.case, c.rays(), c.case.times[1]);
    let once = |c: &mut Check<'_>| -> Result<Hits> {
        c.open(case.times[0])?;
        c.stand(now)?;
        Ok(c.closest()?)
    };
    let first = once(c)?;
    let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let other = Arc::new(Animation::new(vec![corners], vec![[0, 1, 2]])?);
    open(c.subject, &other, 0.0, c.method)?;
    answers(case, now, rays, &once(c)?, &first)?;
    // Positions requested and a trace not waited for are the old scene's and must not show up in the new one.
    open(c.subject, &other, 0.0, c.method)?;
    stand(c.subject, &other, 0.0)?;
    c.subject.request_positions()?;
    start(c.subject, rays, QueryKind::Closest)?;
    stand(c.subject, &other, 0.0)?;
    answers(case, now, rays, &once(c)?, &first)?;
    match c.subject.take_positions()? {
        None => Ok(()),
        Some((ticket, _)) => bail!("positions of {ticket:?} outlived their scene"),
    }
}
