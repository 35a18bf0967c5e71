//! Trees come and go; answers stay.

use super::Check;
use crate::compare::answers;
use crate::generate::topologies::{self, Split, foreign, live, record};
use crate::stage::{boxes_anew, fetch, start, tree_at};
use anyhow::{Context, Result, bail, ensure};
use backend::{BackendError, Generation, QueryKind};
use bvh_layout::Topology;

/// A tree built at one time and refitted to another answers as a fresh one does, whatever the method.
pub(super) fn age(c: &mut Check<'_>) -> Result<()> {
    let (case, now) = (c.case, c.case.times[1]);
    for method in c.methods()? {
        c.open_by(method, now)?;
        c.stand(now)?;
        let fresh = c.closest()?;
        for (built, generation) in [case.times[0], case.times[2]].into_iter().zip(2..) {
            let tree = tree_at(&case.animation, built);
            c.subject.adopt(&tree, Generation(generation))?;
            c.stand(now)?;
            answers(case, now, c.rays(), &c.closest()?, &fresh)
                .with_context(|| format!("{method:?}"))?;
        }
    }
    Ok(())
}

/// Chains as deep as trees may be, and trees at random, answer as a built one does.
pub(super) fn shape(c: &mut Check<'_>) -> Result<()> {
    let (case, rays, now) = (c.case, c.rays(), c.case.times[1]);
    let live = live(&case.animation, case.chance);
    let mut odd = Vec::new();
    for split in Split::ALL {
        let words = record(case.animation.triangle_count(), &live, split, case.chance);
        odd.push((split, Topology::from_words(words)?));
    }
    for method in c.methods()? {
        c.open_by(method, now)?;
        c.stand(now)?;
        let built = c.closest()?;
        let any = c.ask(rays, QueryKind::Any)?;
        for ((split, tree), generation) in odd.iter().zip(2..) {
            let about = || format!("{split:?}, {method:?}");
            let adopted = c.subject.adopt(tree, Generation(generation));
            adopted.with_context(about)?;
            boxes_anew(c.subject)?;
            answers(case, now, rays, &c.closest()?, &built).with_context(about)?;
            let seen = c.ask(rays, QueryKind::Any)?;
            answers(case, now, rays, &seen, &any).with_context(about)?;
        }
    }
    Ok(())
}

/// Swapping the tree between two frames at rest changes nothing, with the first frame still under way.
pub(super) fn swap(c: &mut Check<'_>) -> Result<()> {
    let (case, rays, now) = (c.case, c.rays(), c.case.times[1]);
    c.open(case.times[0])?;
    c.stand(now)?;
    let alone = c.closest()?;
    c.stand(now)?;
    let before = start(c.subject, rays, QueryKind::Closest)?;
    for generation in 2..5 {
        let tree = tree_at(&case.animation, case.times[generation as usize % 3]);
        c.subject.adopt(&tree, Generation(generation))?;
    }
    boxes_anew(c.subject)?;
    let after = c.closest()?;
    let (during, _) = fetch(c.subject, before)?;
    answers(case, now, rays, &during, &alone).context("the frame under way")?;
    answers(case, now, rays, &after, &alone).context("the frame after")
}

/// A sound tree of another scene is refused with a reason, and the old one goes on.
pub(super) fn wrong(c: &mut Check<'_>) -> Result<()> {
    let (case, now) = (c.case, c.case.times[1]);
    c.open(now)?;
    c.stand(now)?;
    let before = c.closest()?;
    for (what, words) in foreign(&case.animation, case.chance) {
        let tree = Topology::from_words(words).context(what)?;
        match c.subject.adopt(&tree, Generation(2)) {
            Err(BackendError::WrongTree(why)) if !why.is_empty() => {}
            other => bail!("{what}, expected to be refused, got {other:?}"),
        }
    }
    // Refused trees leave records and boxes as they were.
    answers(case, now, c.rays(), &c.closest()?, &before)?;
    c.stand(now)?;
    answers(case, now, c.rays(), &c.closest()?, &before)
}

/// No record with anything wrong becomes a topology, so that no backend ever sees one.
pub(super) fn damaged(c: &mut Check<'_>) -> Result<()> {
    let case = c.case;
    let built = tree_at(&case.animation, case.times[0]);
    let leaves = live(&case.animation, case.chance);
    let count = case.animation.triangle_count();
    let odd = record(count, &leaves, Split::Random, case.chance);
    Topology::from_words(odd.clone()).context("a sound record is refused")?;
    if leaves.len() < 2 {
        return Ok(());
    }
    for words in [built.words(), &odd] {
        for (what, words) in topologies::damaged(words) {
            let refused = Topology::from_words(words).is_err();
            ensure!(refused, "a record is taken in spite of {what}");
        }
    }
    Ok(())
}
