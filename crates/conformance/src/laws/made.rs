//! Trees that a backend makes on its device. One that makes none keeps these laws.

use super::Check;
use crate::compare::{answers, lists, same_box, same_counts};
use crate::stage::{boxes_anew, fetch, stand, start, tree_at};
use anyhow::{Context, Result};
use backend::{Backend, BackendError, Generation, Hits, QueryKind, check_tree};
use std::sync::Arc;

/// Records a tree made on the device from the positions at hand; `false` if the backend makes none for this scene's method.
fn rebuild(backend: &mut dyn Backend, generation: u64) -> Result<bool> {
    match backend.rebuild(Generation(generation)) {
        Ok(()) => Ok(true),
        Err(BackendError::Unsupported { .. }) => Ok(false),
        Err(e) => Err(e.into()),
    }
}

/// Read back it is a sound tree of this scene, whose boxes, counts and cost are those that the reference finds for it.
pub(super) fn whole(c: &mut Check<'_>) -> Result<()> {
    let (animation, rays) = (&c.case.animation, c.rays());
    c.subject.load(Arc::clone(animation), c.method)?;
    for (&time, generation) in c.case.times.iter().zip(1..) {
        c.interpolate(time)?;
        if !rebuild(c.subject, generation)? {
            return Ok(());
        }
        let ticket = start(c.subject, rays, QueryKind::Closest)?;
        let seen = c.subject.wait(ticket)?;
        let tree = c.subject.inspect().rebuilt()?;
        check_tree(&tree, animation)?;
        let boxes = c.subject.inspect().boxes()?;
        let reference = c.reference.backend();
        reference.load(Arc::clone(animation), Default::default())?;
        reference.adopt(&tree, Generation(1))?;
        stand(reference, animation, time)?;
        let ticket = start(reference, rays, QueryKind::Closest)?;
        let expected = reference.wait(ticket)?;
        let right = reference.inspect().boxes()?;
        same_counts(&seen, &expected)
            .and_then(|()| lists("box of node", &boxes, &right, same_box))
            .with_context(|| format!("at time {time:?}"))?;
    }
    Ok(())
}

/// It answers as a tree from the host does, before which and after which it may come.
pub(super) fn same_hits(c: &mut Check<'_>) -> Result<()> {
    let (case, rays, now) = (c.case, c.rays(), c.case.times[1]);
    let both = |c: &mut Check<'_>| -> Result<[Hits; 2]> {
        Ok([c.closest()?, c.ask(rays, QueryKind::Any)?])
    };
    for method in c.methods()? {
        c.open_by(method, case.times[0])?;
        c.stand(now)?;
        let host = both(c)?;
        if !rebuild(c.subject, 2)? {
            continue;
        }
        let made = both(c)?;
        // There is nothing left to preprocess nor to refit, but it may be requested.
        boxes_anew(c.subject)?;
        // Another one while a frame with the first is under way.
        let under_way = start(c.subject, rays, QueryKind::Closest)?;
        c.interpolate(case.times[2])?;
        rebuild(c.subject, 3)?;
        c.closest()?;
        let (before, _) = fetch(c.subject, under_way)?;
        let tree = tree_at(&case.animation, now);
        c.interpolate(now)?;
        c.subject.submit()?;
        c.subject.adopt(&tree, Generation(4))?;
        boxes_anew(c.subject)?;
        let after = both(c)?;
        let pairs = [&made[0], &made[1], &before, &after[0], &after[1]];
        let expected = [&host[0], &host[1], &host[0], &host[0], &host[1]];
        for (seen, expected) in pairs.into_iter().zip(expected) {
            answers(case, now, rays, seen, expected).with_context(|| format!("{method:?}"))?;
        }
    }
    Ok(())
}
