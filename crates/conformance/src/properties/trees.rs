//! Changes of the tree, which must not change any result.
//!
//! Backends that build no trees on the device pass the tests of such trees.

use super::Check;
use crate::compare::{same_cost, same_counts, same_lists, same_results};
use crate::generate::topologies::foreign;
use crate::reference::FrameResults;
use crate::stage::{Traced, fetch, preprocess_and_refit, start, trace_and_wait, tree_at};
use anyhow::{Context, Result, bail};
use backend::{Backend, BackendError, Generation, Hits, QueryKind, check_tree};
use bvh_layout::Topology;
use std::sync::Arc;

/// Tests that a tree built at one time and refitted to another has the same hits as a new tree, for every intersector.
pub(super) fn age(c: &mut Check<'_>) -> Result<()> {
    let (case, now) = (c.case, c.case.times[1]);
    c.open(now)?;
    c.interpolate_and_refit(now)?;
    let fresh = c.closest()?;
    for (built, generation) in [case.times[0], case.times[2]].into_iter().zip(2..) {
        let tree = tree_at(&case.animation, built);
        c.subject.adopt(&tree, Generation(generation))?;
        c.interpolate_and_refit(now)?;
        same_results(case, now, c.rays(), &c.closest()?, &fresh)?;
    }
    Ok(())
}

/// Tests that chains of maximum depth and random trees have the same hits as a built tree.
pub(super) fn shape(c: &mut Check<'_>) -> Result<()> {
    let (case, now) = (c.case, c.case.times[1]);
    c.open(now)?;
    c.interpolate_and_refit(now)?;
    let built = both(c)?;
    for (description, generation) in case.trees.iter().zip(2..) {
        let about = || format!("{:?}", description.split);
        let tree = description.tree(&case.animation);
        let adopted = c.subject.adopt(&tree, Generation(generation));
        adopted.with_context(about)?;
        preprocess_and_refit(c.subject)?;
        for (seen, built) in both(c)?.iter().zip(&built) {
            same_results(case, now, c.rays(), seen, built).with_context(about)?;
        }
    }
    Ok(())
}

/// Returns closest hits and any-hit results of the case's rays.
fn both(c: &mut Check<'_>) -> Result<[Hits; 2]> {
    Ok([c.closest()?, c.trace_and_wait(c.rays(), QueryKind::Any)?])
}

/// Tests that adopting other trees while a frame is in flight changes neither its hits nor those of the next frame. Both
/// frames show the same time of the animation.
pub(super) fn swap(c: &mut Check<'_>) -> Result<()> {
    let (case, rays, now) = (c.case, c.rays(), c.case.times[1]);
    c.open(case.times[0])?;
    c.interpolate_and_refit(now)?;
    let alone = c.closest()?;
    c.interpolate_and_refit(now)?;
    let before = start(c.subject, rays, QueryKind::Closest)?;
    for generation in 2..5 {
        let tree = tree_at(&case.animation, case.times[generation as usize % 3]);
        c.subject.adopt(&tree, Generation(generation))?;
    }
    preprocess_and_refit(c.subject)?;
    let after = c.closest()?;
    let during = fetch(c.subject, before)?.hits;
    same_results(case, now, rays, &during, &alone).context("the frame under way")?;
    same_results(case, now, rays, &after, &alone).context("the frame after")
}

/// Tests that a tree uploaded in advance is the one adopted, and that an abandoned upload has no effect.
pub(super) fn uploaded(c: &mut Check<'_>) -> Result<()> {
    let (case, rays, now) = (c.case, c.rays(), c.case.times[1]);
    let animation = &case.animation;
    let [abandoned, next, last] = [0, 1, 2].map(|i| tree_at(animation, case.times[i]));
    c.open(now)?;
    c.interpolate_and_refit(now)?;
    let fresh = c.closest()?;
    prepare_upload(c, &abandoned, 2)?;
    c.subject.upload_tree(&abandoned, Generation(2))?;
    for (tree, generation) in [(&next, 3), (&last, 4), (&abandoned, 5)] {
        prepare_upload(c, tree, generation)?;
        while !c.subject.upload_tree(tree, Generation(generation))? {
            std::thread::yield_now();
        }
        c.subject.adopt(tree, Generation(generation))?;
        preprocess_and_refit(c.subject)?;
        same_results(case, now, rays, &c.closest()?, &fresh)?;
        let boxes = c.subject.boxes()?;
        let right = c.reference.by_tree(case, c.intersector, tree, now)?.boxes;
        same_lists("box of node", &boxes, &right, PartialEq::eq)?;
    }
    Ok(())
}

/// Tests that [`Backend::evaluate`], which refits a second tree and measures its cost, changes no result and no count.
///
/// The measured cost must equal the cost of this tree after it is adopted. An evaluated tree must give the same hits as
/// any other, also at another time.
pub(super) fn evaluated(c: &mut Check<'_>) -> Result<()> {
    let (case, rays) = (c.case, c.rays());
    let [then, now] = [0, 1].map(|i| case.times[i]);
    c.open(then)?;
    c.interpolate_and_refit(then)?;
    let fresh_then = c.closest()?;
    c.interpolate_and_refit(now)?;
    let fresh = trace_and_wait(c.subject, rays, QueryKind::Closest)?;
    let same_frame = |found: &Traced, about| {
        same_results(case, now, rays, &found.hits, &fresh.hits).context(about)?;
        same_counts(&found.report, &fresh.report)
    };
    for (&time, generation) in case.times.iter().zip(2..) {
        let tree = tree_at(&case.animation, time);
        prepare_upload(c, &tree, generation)?;
        while !c.subject.upload_tree(&tree, Generation(generation))? {
            std::thread::yield_now();
        }
        for at in [then, now] {
            c.interpolate(at)?;
            if !c.subject.evaluate(&tree, Generation(generation))? {
                return Ok(());
            }
            preprocess_and_refit(c.subject)?;
            if at == then {
                same_results(case, then, rays, &c.closest()?, &fresh_then)?;
            }
        }
        let evaluated = trace_and_wait(c.subject, rays, QueryKind::Closest)?;
        same_frame(&evaluated, "during an evaluation")?;
        c.subject.adopt(&tree, Generation(generation))?;
        preprocess_and_refit(c.subject)?;
        let adopted = trace_and_wait(c.subject, rays, QueryKind::Closest)?;
        same_frame(&adopted, "adopted")?;
        same_cost(evaluated.report.candidate_cost, adopted.report.sah_cost)?;
        c.interpolate_and_refit(then)?;
        same_results(case, then, rays, &c.closest()?, &fresh_then).context("at another time")?;
        c.interpolate_and_refit(now)?;
        // Adoption exchanges the buffers of the tree and the candidate, so check the cost once more.
        let again = trace_and_wait(c.subject, rays, QueryKind::Closest)?;
        same_cost(again.report.sah_cost, adopted.report.sah_cost)?;
    }
    Ok(())
}

/// Writes the tree in the device's format, as the builder thread would, if the backend needs that
/// ([`Backend::tree_writer`]).
fn prepare_upload(c: &mut Check<'_>, tree: &Topology, generation: u64) -> Result<()> {
    let writer = c.subject.tree_writer(Generation(generation))?;
    writer.into_iter().for_each(|write| write(tree));
    Ok(())
}

/// Tests that a valid tree of another scene is refused with a reason, and that the current tree stays in use.
pub(super) fn of_other_scenes(c: &mut Check<'_>) -> Result<()> {
    let (case, now) = (c.case, c.case.times[1]);
    c.open(now)?;
    c.interpolate_and_refit(now)?;
    let before = c.closest()?;
    for (what, tree) in foreign(&case.animation, case.random_bits) {
        match c.subject.adopt(&tree, Generation(2)) {
            Err(BackendError::WrongTree(why)) if !why.is_empty() => {}
            other => bail!("{what}: expected an error, got {other:?}"),
        }
    }
    // Refused trees must not change the tree or its boxes.
    same_results(case, now, c.rays(), &c.closest()?, &before)?;
    c.interpolate_and_refit(now)?;
    same_results(case, now, c.rays(), &c.closest()?, &before)
}

/// Records a tree built on the device from the current positions. Returns `false` if the backend cannot build one for
/// this intersector.
fn rebuild(backend: &mut dyn Backend, generation: u64) -> Result<bool> {
    match backend.rebuild(Generation(generation)) {
        Ok(()) => Ok(true),
        Err(BackendError::Unsupported { .. }) => Ok(false),
        Err(e) => Err(e.into()),
    }
}

/// Tests that a tree made on the device is valid when read back. Its boxes and counts must equal the reference's for
/// this tree.
pub(super) fn device_built(c: &mut Check<'_>) -> Result<()> {
    let case = c.case;
    c.subject.load(Arc::clone(&case.animation), c.intersector)?;
    for (&time, generation) in case.times.iter().zip(1..) {
        c.interpolate(time)?;
        if !rebuild(c.subject, generation)? {
            return Ok(());
        }
        let seen = FrameResults::of(c.subject, case)?;
        let tree = c.subject.rebuilt()?;
        check_tree(&tree, &case.animation)?;
        let expected = c.reference.by_tree(case, c.intersector, &tree, time)?;
        same_counts(&seen.traced.report, &expected.traced.report)
            .and_then(|()| same_lists("box of node", &seen.boxes, &expected.boxes, PartialEq::eq))
            .with_context(|| format!("at time {time:?}"))?;
    }
    Ok(())
}

/// Tests that a tree made on the device has the same hits as a tree from the host, which may precede or follow it.
pub(super) fn same_hits(c: &mut Check<'_>) -> Result<()> {
    let (case, rays, now) = (c.case, c.rays(), c.case.times[1]);
    c.open(case.times[0])?;
    c.interpolate_and_refit(now)?;
    let host = both(c)?;
    if !rebuild(c.subject, 2)? {
        return Ok(());
    }
    let made = both(c)?;
    // The build includes these stages, but recording them is allowed.
    preprocess_and_refit(c.subject)?;
    // Make another tree while a frame with the first one is in flight.
    let under_way = start(c.subject, rays, QueryKind::Closest)?;
    c.interpolate(case.times[2])?;
    rebuild(c.subject, 3)?;
    c.closest()?;
    let before = fetch(c.subject, under_way)?.hits;
    let tree = tree_at(&case.animation, now);
    c.interpolate(now)?;
    c.subject.submit()?;
    c.subject.adopt(&tree, Generation(4))?;
    preprocess_and_refit(c.subject)?;
    let after = both(c)?;
    let pairs = [&made[0], &made[1], &before, &after[0], &after[1]];
    let expected = [&host[0], &host[1], &host[0], &host[0], &host[1]];
    let mut all = pairs.into_iter().zip(expected);
    all.try_for_each(|(seen, expected)| same_results(case, now, rays, seen, expected))
}
