//! Submissions, answers that wait to be fetched, and scenes that follow one another.

use crate::Case;
use crate::compare::answers;
use crate::stage::{ask, boxes_anew, fetch, open, plainly, stand, start};
use backend::{Backend, FRAMES_IN_FLIGHT, QueryKind, Rays};
use geom::Animation;
use std::sync::Arc;

/// Tickets rise; a later one done means the earlier are; answers are kept for as many traces as may be under way.
pub(crate) fn tickets(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let rays = Rays::List(&case.rays);
    let times = &case.times[..FRAMES_IN_FLIGHT];
    open(subject, &case.animation, times[0])?;
    let mut expected = Vec::new();
    for &time in times {
        stand(subject, &case.animation, time)?;
        expected.push(ask(subject, rays, QueryKind::Closest)?);
    }
    let mut tickets = Vec::new();
    for &time in times {
        stand(subject, &case.animation, time)?;
        tickets.push(start(subject, rays, QueryKind::Closest)?);
    }
    // A submission without a trace takes no answer away.
    stand(subject, &case.animation, case.times[2])?;
    tickets.push(subject.submit().map_err(plainly)?);
    if !tickets.is_sorted_by(|a, b| a < b) {
        return Err(format!("tickets do not rise: {tickets:?}"));
    }
    // Each twice, the later ones first.
    for _ in 0..2 {
        for ((&ticket, expected), &time) in tickets.iter().zip(&expected).zip(times).rev() {
            answers(case, time, rays, &fetch(subject, ticket)?, expected)?;
        }
    }
    Ok(())
}

/// Stages whose input did not change may be left out, or be done again.
pub(crate) fn at_rest(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let (rays, now) = (Rays::List(&case.rays), case.times[1]);
    open(subject, &case.animation, case.times[0])?;
    stand(subject, &case.animation, now)?;
    let first = ask(subject, rays, QueryKind::Closest)?;
    let again = ask(subject, rays, QueryKind::Closest)?;
    answers(case, now, rays, &again, &first)?;
    boxes_anew(subject)?;
    answers(
        case,
        now,
        rays,
        &ask(subject, rays, QueryKind::Closest)?,
        &first,
    )?;
    // Each stage in a submission of its own.
    subject
        .interpolate(case.animation.pose(now))
        .map_err(plainly)?;
    subject.submit().map_err(plainly)?;
    subject.preprocess().map_err(plainly)?;
    subject.submit().map_err(plainly)?;
    subject.refit().map_err(plainly)?;
    subject.submit().map_err(plainly)?;
    answers(
        case,
        now,
        rays,
        &ask(subject, rays, QueryKind::Closest)?,
        &first,
    )
}

/// A scene loaded after another answers as if it were the first, whatever was under way.
pub(crate) fn reload(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let (rays, now) = (Rays::List(&case.rays), case.times[1]);
    let once = |subject: &mut dyn Backend| {
        open(subject, &case.animation, case.times[0])?;
        stand(subject, &case.animation, now)?;
        ask(subject, rays, QueryKind::Closest)
    };
    let first = once(subject)?;
    let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let other = Animation::new(vec![corners], vec![[0, 1, 2]]).map_err(|e| e.to_string())?;
    let other = Arc::new(other);
    open(subject, &other, 0.0)?;
    answers(case, now, rays, &once(subject)?, &first)?;
    // Positions asked for and a trace not waited for are the old scene's and must not show up in the new one.
    open(subject, &other, 0.0)?;
    stand(subject, &other, 0.0)?;
    subject.request_positions().map_err(plainly)?;
    start(subject, rays, QueryKind::Closest)?;
    stand(subject, &other, 0.0)?;
    answers(case, now, rays, &once(subject)?, &first)?;
    match subject.take_positions().map_err(plainly)? {
        None => Ok(()),
        Some((ticket, _)) => Err(format!("positions of {ticket:?} outlived their scene")),
    }
}
