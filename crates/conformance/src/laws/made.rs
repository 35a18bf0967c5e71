//! Trees that a backend makes on its device. One that makes none keeps these laws.

use crate::Case;
use crate::compare::{answers, lists, same_box};
use crate::stage::{ask, boxes_anew, fetch, methods, open_with, plainly, stand, start, tree_at};
use backend::{
    Backend, BackendError, FrameReport, Generation, Hits, Method, QueryKind, Rays, check_tree,
};
use std::sync::Arc;

/// Records a tree made on the device from the positions at hand; `false` if the backend makes none for this scene's method.
fn rebuild(backend: &mut dyn Backend, generation: u64) -> Result<bool, String> {
    match backend.rebuild(Generation(generation)) {
        Ok(()) => Ok(true),
        Err(BackendError::Unsupported { .. }) => Ok(false),
        Err(e) => Err(plainly(e)),
    }
}

/// Read back it is a sound tree of this scene, whose boxes, counts and cost are those that the reference finds for it.
pub(crate) fn whole(
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
) -> Result<(), String> {
    let animation = &case.animation;
    let load = |b: &mut dyn Backend| b.load(Arc::clone(animation), Method::default());
    load(subject).map_err(plainly)?;
    for (&time, generation) in case.times.iter().zip(1..) {
        subject.interpolate(animation.pose(time)).map_err(plainly)?;
        if !rebuild(subject, generation)? {
            return Ok(());
        }
        let ticket = start(subject, Rays::List(&case.rays), QueryKind::Closest)?;
        let seen = subject.wait(ticket).map_err(plainly)?;
        let tree = subject.inspect().rebuilt().map_err(plainly)?;
        check_tree(&tree, animation).map_err(plainly)?;
        let boxes = subject.inspect().boxes().map_err(plainly)?;
        load(reference).map_err(plainly)?;
        reference.adopt(&tree, Generation(1)).map_err(plainly)?;
        stand(reference, animation, time)?;
        let ticket = start(reference, Rays::List(&case.rays), QueryKind::Closest)?;
        let expected = reference.wait(ticket).map_err(plainly)?;
        let say = |e: String| format!("at time {time:?}: {e}");
        same_counts(&seen, &expected).map_err(say)?;
        let expected = reference.inspect().boxes().map_err(plainly)?;
        lists("box of node", &boxes, &expected, same_box).map_err(say)?;
    }
    Ok(())
}

fn same_counts(seen: &FrameReport, expected: &FrameReport) -> Result<(), String> {
    let counts = |r: &FrameReport| [r.inactive, r.degenerate, r.hits];
    let (found, right) = (counts(seen), counts(expected));
    if found != right {
        return Err(format!(
            "inactive, degenerate, hits are {found:?}, expected {right:?}"
        ));
    }
    Ok(())
}

/// It answers as a tree from the host does, before which and after which it may come.
pub(crate) fn same_hits(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let (rays, now) = (Rays::List(&case.rays), case.times[1]);
    let both = |subject: &mut dyn Backend| -> Result<[Hits; 2], String> {
        Ok([
            ask(subject, rays, QueryKind::Closest)?,
            ask(subject, rays, QueryKind::Any)?,
        ])
    };
    for method in methods(subject)? {
        open_with(subject, &case.animation, case.times[0], method).map_err(plainly)?;
        stand(subject, &case.animation, now)?;
        let host = both(subject)?;
        if !rebuild(subject, 2)? {
            continue;
        }
        let made = both(subject)?;
        // There is nothing left to preprocess nor to refit, but it may be asked for.
        boxes_anew(subject)?;
        // Another one while a frame with the first is under way.
        let under_way = start(subject, rays, QueryKind::Closest)?;
        subject
            .interpolate(case.animation.pose(case.times[2]))
            .map_err(plainly)?;
        rebuild(subject, 3)?;
        ask(subject, rays, QueryKind::Closest)?;
        let before = fetch(subject, under_way)?;
        let tree = tree_at(&case.animation, now);
        subject
            .interpolate(case.animation.pose(now))
            .map_err(plainly)?;
        subject.submit().map_err(plainly)?;
        subject.adopt(&tree, Generation(4)).map_err(plainly)?;
        boxes_anew(subject)?;
        let after = both(subject)?;
        let pairs = [&made[0], &made[1], &before, &after[0], &after[1]];
        let expected = [&host[0], &host[1], &host[0], &host[0], &host[1]];
        for (seen, expected) in pairs.into_iter().zip(expected) {
            answers(case, now, rays, seen, expected).map_err(|e| format!("{method:?}: {e}"))?;
        }
    }
    Ok(())
}
