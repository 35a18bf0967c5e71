//! Submissions, answers that wait to be fetched, and scenes that follow one another.

use crate::Case;
use crate::compare::answers;
use crate::stage::{ask, open, plainly, stand};
use backend::{Backend, FRAMES_IN_FLIGHT, Hits, Query, Rays, Seek};

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
        expected.push(ask(subject, rays, Seek::Closest)?);
    }
    let mut tickets = Vec::new();
    for &time in times {
        stand(subject, &case.animation, time)?;
        subject
            .trace(Query {
                rays,
                seek: Seek::Closest,
            })
            .map_err(plainly)?;
        tickets.push(subject.submit().map_err(plainly)?);
    }
    if !tickets.is_sorted_by(|a, b| a < b) {
        return Err(format!("tickets do not rise: {tickets:?}"));
    }
    for (ticket, expected) in tickets.iter().zip(&expected).rev() {
        subject.wait(*ticket).map_err(plainly)?;
        let mut hits = Hits::default();
        subject.hits(*ticket, &mut hits).map_err(plainly)?;
        answers(&hits, expected)?;
    }
    Ok(())
}

/// A scene loaded after another answers as if it were the first.
pub(crate) fn reload(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let rays = Rays::List(&case.rays);
    let once = |subject: &mut dyn Backend| {
        open(subject, &case.animation, case.times[0])?;
        stand(subject, &case.animation, case.times[1])?;
        ask(subject, rays, Seek::Closest)
    };
    let first = once(subject)?;
    // Another scene in between: its own first key frame alone, as a single triangle.
    let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let other = geom::Animation::new(vec![corners], vec![[0, 1, 2]]).map_err(|e| e.to_string())?;
    open(subject, &std::sync::Arc::new(other), 0.0)?;
    answers(&once(subject)?, &first)
}
