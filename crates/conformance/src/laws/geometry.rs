//! What comes before any ray: positions, boxes, counts.

use crate::Case;
use crate::compare::{lists, same_box, same_point};
use crate::stage::{ask, open, plainly, stand, vertices};
use backend::{Backend, Query, Rays, Seek};
use geom::Aabb;

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
        lists(
            "position of vertex",
            &seen,
            &vertices(&case.animation, time),
            same_point,
        )?;
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
        lists("box of node", &seen, &expected, same_box)?;
    }
    Ok(())
}

fn boxes_at(backend: &mut dyn Backend, case: &Case, time: f64) -> Result<Vec<Aabb>, String> {
    stand(backend, &case.animation, time)?;
    backend.submit().map_err(plainly)?;
    backend.inspect().boxes().map_err(plainly)
}

/// Inactive and degenerate triangles, and hits, are counted alike.
pub(crate) fn counts(
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
) -> Result<(), String> {
    let (seen, expected) = (counted(case, subject)?, counted(case, reference)?);
    if seen == expected {
        return Ok(());
    }
    Err(format!(
        "inactive, degenerate, hits, blocked are {seen:?}, expected {expected:?}"
    ))
}

fn counted(case: &Case, backend: &mut dyn Backend) -> Result<[u64; 4], String> {
    open(backend, &case.animation, case.times[0])?;
    stand(backend, &case.animation, case.times[1])?;
    let seek = Seek::ClosestAndShadow { light: case.light };
    backend
        .trace(Query {
            rays: Rays::Camera(&case.camera),
            seek,
        })
        .map_err(plainly)?;
    let ticket = backend.submit().map_err(plainly)?;
    let report = backend.wait(ticket).map_err(plainly)?;
    Ok([
        report.inactive,
        report.degenerate,
        report.hits,
        report.blocked,
    ])
}

/// A requested copy holds the positions of the submission that asked, whatever came after.
pub(crate) fn read_back(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    open(subject, &case.animation, case.times[0])?;
    stand(subject, &case.animation, case.times[1])?;
    subject.request_positions().map_err(plainly)?;
    let asked = subject.submit().map_err(plainly)?;
    for &time in &case.times {
        stand(subject, &case.animation, time)?;
        ask(subject, Rays::List(&case.rays), Seek::Closest)?;
    }
    let (ticket, snapshot) = loop {
        if let Some(arrived) = subject.take_positions().map_err(plainly)? {
            break arrived;
        }
        std::thread::yield_now();
    };
    if ticket != asked {
        return Err(format!(
            "the copy belongs to {ticket:?}, expected {asked:?}"
        ));
    }
    lists(
        "copied vertex",
        &snapshot,
        &vertices(&case.animation, case.times[1]),
        same_point,
    )
}
