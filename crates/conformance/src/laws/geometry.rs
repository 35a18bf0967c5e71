//! What comes before any ray: positions and boxes.

use crate::Case;
use crate::compare::{lists, same_box, same_point};
use crate::stage::{ask, open, plainly, stand, vertices};
use backend::{Backend, QueryKind, Rays, Snapshot, Ticket};
use geom::Aabb;
use std::time::{Duration, Instant};

/// How long a copy of positions may take, its submission being done.
const PATIENCE: Duration = Duration::from_secs(30);

/// Interpolated positions have the bits of `geom`'s formula.
pub(crate) fn positions(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    open(subject, &case.animation, case.times[0])?;
    for &time in &case.times {
        stand(subject, &case.animation, time)?;
        subject.submit().map_err(plainly)?;
        let seen = subject.inspect().positions().map_err(plainly)?;
        let expected = vertices(&case.animation, time);
        lists("position of vertex", &seen, &expected, same_point)
            .map_err(|e| format!("at time {time:?}: {e}"))?;
    }
    Ok(())
}

/// Refitted boxes are the reference's, every one.
pub(crate) fn boxes(
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
) -> Result<(), String> {
    open(subject, &case.animation, case.times[0])?;
    open(reference, &case.animation, case.times[0])?;
    for &time in &case.times {
        let seen = boxes_at(subject, case, time)?;
        let expected = boxes_at(reference, case, time)?;
        lists("box of node", &seen, &expected, same_box)
            .map_err(|e| format!("at time {time:?}: {e}"))?;
    }
    Ok(())
}

fn boxes_at(backend: &mut dyn Backend, case: &Case, time: f64) -> Result<Vec<Aabb>, String> {
    stand(backend, &case.animation, time)?;
    backend.submit().map_err(plainly)?;
    backend.inspect().boxes().map_err(plainly)
}

/// Requested copies hold the positions of the submissions that asked, oldest first, whatever came after.
pub(crate) fn read_back(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    open(subject, &case.animation, case.times[0])?;
    let mut asked = Vec::new();
    // The second time nothing is made of them.
    for (&time, made) in case.times[1..3].iter().zip([true, false]) {
        let pose = case.animation.pose(time);
        match made {
            true => stand(subject, &case.animation, time)?,
            false => subject.interpolate(pose).map_err(plainly)?,
        }
        subject.request_positions().map_err(plainly)?;
        asked.push((subject.submit().map_err(plainly)?, time));
    }
    for &time in &case.times {
        stand(subject, &case.animation, time)?;
        ask(subject, Rays::List(&case.rays), QueryKind::Closest)?;
    }
    for (expected, time) in asked {
        let (ticket, snapshot) = next_positions(subject)?;
        if ticket != expected {
            return Err(format!(
                "the copy belongs to {ticket:?}, expected {expected:?}"
            ));
        }
        let formula = vertices(&case.animation, time);
        lists("copied vertex", &snapshot, &formula, same_point)
            .map_err(|e| format!("at time {time:?}: {e}"))?;
    }
    match subject.take_positions().map_err(plainly)? {
        None => Ok(()),
        Some((ticket, _)) => Err(format!("positions of {ticket:?} came, nobody asked")),
    }
}

fn next_positions(backend: &mut dyn Backend) -> Result<(Ticket, Snapshot), String> {
    let begun = Instant::now();
    while begun.elapsed() < PATIENCE {
        if let Some(arrived) = backend.take_positions().map_err(plainly)? {
            return Ok(arrived);
        }
        std::thread::yield_now();
    }
    Err(format!("no positions came in {PATIENCE:?}"))
}
