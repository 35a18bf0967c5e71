//! Of which moment boxes are: a backend may make them from key frames, beside positions or before those are there.

use crate::Case;
use crate::compare::{lists, same_box};
use crate::stage::{boxes_anew, open_with, plainly, robust_methods, stand_on, tree_at};
use backend::{Backend, Generation};
use geom::{Aabb, Pose};

/// Two moments of a case, the later of which is to be seen, and how to get there.
type Way = fn(&Case, &mut dyn Backend, [Pose; 2]) -> backend::Result<()>;

const WAYS: [(&str, Way); 6] = [
    ("another moment was interpolated before", interpolated_twice),
    ("another moment was preprocessed before", preprocessed_twice),
    ("preprocessed again", preprocessed_again),
    ("preprocessed by itself", preprocessed_by_itself),
    ("positions were asked for", asked_for),
    ("a tree came between", another_tree),
];

/// Boxes are of the moment interpolated last, whatever was recorded besides; so are the counts of triangles.
pub(crate) fn last(
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
) -> Result<(), String> {
    let poses = [case.times[1], case.times[2]].map(|time| case.animation.pose(time));
    for [method, usual] in robust_methods([&*subject, &*reference])? {
        let first = case.times[0];
        open_with(reference, &case.animation, first, usual).map_err(plainly)?;
        stand_on(reference, &case.animation, case.times[2])?;
        let expected = seen(reference).map_err(plainly)?;
        // Two a case.
        let begin = case.chance as usize % WAYS.len();
        for (about, way) in WAYS.iter().cycle().skip(begin).take(2) {
            open_with(subject, &case.animation, first, method).map_err(plainly)?;
            way(case, subject, poses).map_err(plainly)?;
            boxes_anew(subject)?;
            let seen = seen(subject).map_err(plainly)?;
            lists("box of node", &seen.0, &expected.0, same_box)
                .map_err(|e| format!("{about}, by {method:?}: {e}"))?;
            if seen.1 != expected.1 {
                let ([seen, expected], e) = ([seen.1, expected.1], "inactive and degenerate");
                return Err(format!("{about}: {e} are {seen:?}, expected {expected:?}"));
            }
        }
    }
    Ok(())
}

/// Boxes, and how many triangles are inactive and degenerate.
fn seen(backend: &mut dyn Backend) -> backend::Result<(Vec<Aabb>, [u64; 2])> {
    let ticket = backend.submit()?;
    let report = backend.wait(ticket)?;
    let boxes = backend.inspect().boxes()?;
    Ok((boxes, [report.inactive, report.degenerate]))
}

fn interpolated_twice(
    _: &Case,
    backend: &mut dyn Backend,
    poses: [Pose; 2],
) -> backend::Result<()> {
    poses.into_iter().try_for_each(|p| backend.interpolate(p))
}

fn preprocessed_twice(
    _: &Case,
    backend: &mut dyn Backend,
    [a, b]: [Pose; 2],
) -> backend::Result<()> {
    backend.interpolate(a)?;
    backend.preprocess()?;
    backend.interpolate(b)
}

fn preprocessed_again(
    _: &Case,
    backend: &mut dyn Backend,
    [_, b]: [Pose; 2],
) -> backend::Result<()> {
    backend.interpolate(b)?;
    backend.preprocess()
}

fn preprocessed_by_itself(
    _: &Case,
    backend: &mut dyn Backend,
    [a, b]: [Pose; 2],
) -> backend::Result<()> {
    backend.interpolate(a)?;
    backend.submit()?;
    backend.interpolate(b)?;
    backend.submit()?;
    Ok(())
}

fn asked_for(_: &Case, backend: &mut dyn Backend, [_, b]: [Pose; 2]) -> backend::Result<()> {
    backend.interpolate(b)?;
    backend.request_positions()
}

fn another_tree(case: &Case, backend: &mut dyn Backend, [a, b]: [Pose; 2]) -> backend::Result<()> {
    backend.interpolate(a)?;
    backend.preprocess()?;
    backend.interpolate(b)?;
    backend.submit()?;
    backend.adopt(&tree_at(&case.animation, case.times[0]), Generation(2))
}
