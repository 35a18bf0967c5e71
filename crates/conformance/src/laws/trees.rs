//! Trees come and go; answers stay.

use crate::Case;
use crate::compare::answers;
use crate::stage::{
    ask, boxes_anew, fetch, methods, open, open_with, plainly, stand, start, tree_at,
};
use crate::topologies::{self, Split, foreign, live, record};
use backend::{Backend, BackendError, Generation, Hits, QueryKind, Rays};
use bvh_layout::Topology;

/// A tree built at one time and refitted to another answers as a fresh one does, whatever the method.
pub(crate) fn age(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let (rays, now) = (Rays::List(&case.rays), case.times[1]);
    for method in methods(subject)? {
        let mut seen: Vec<Hits> = Vec::new();
        for built in [now, case.times[0], case.times[2]] {
            open_with(subject, &case.animation, built, method).map_err(plainly)?;
            stand(subject, &case.animation, now)?;
            seen.push(ask(subject, rays, QueryKind::Closest)?);
        }
        for aged in &seen[1..] {
            answers(case, now, rays, aged, &seen[0]).map_err(|e| format!("{method:?}: {e}"))?;
        }
    }
    Ok(())
}

/// Chains as deep as trees may be, and trees at random, answer as a built one does.
pub(crate) fn shape(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let (rays, now) = (Rays::List(&case.rays), case.times[1]);
    let live = live(&case.animation, case.chance);
    for method in methods(subject)? {
        open_with(subject, &case.animation, now, method).map_err(plainly)?;
        stand(subject, &case.animation, now)?;
        let built = ask(subject, rays, QueryKind::Closest)?;
        let any = ask(subject, rays, QueryKind::Any)?;
        for (split, generation) in Split::ALL.into_iter().zip(2..) {
            let words = record(case.animation.triangle_count(), &live, split, case.chance);
            let tree = Topology::from_words(words).map_err(|e| e.to_string())?;
            let say = |e: String| format!("{split:?}, {method:?}: {e}");
            subject
                .adopt(&tree, Generation(generation))
                .map_err(plainly)
                .map_err(say)?;
            boxes_anew(subject)?;
            let seen = ask(subject, rays, QueryKind::Closest)?;
            answers(case, now, rays, &seen, &built).map_err(say)?;
            let seen = ask(subject, rays, QueryKind::Any)?;
            answers(case, now, rays, &seen, &any).map_err(say)?;
        }
    }
    Ok(())
}

/// Swapping the tree between two frames at rest changes nothing, with the first frame still under way.
pub(crate) fn swap(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let (rays, now) = (Rays::List(&case.rays), case.times[1]);
    open(subject, &case.animation, case.times[0])?;
    stand(subject, &case.animation, now)?;
    let alone = ask(subject, rays, QueryKind::Closest)?;
    stand(subject, &case.animation, now)?;
    let before = start(subject, rays, QueryKind::Closest)?;
    for generation in 2..5 {
        let tree = tree_at(&case.animation, case.times[generation as usize % 3]);
        subject
            .adopt(&tree, Generation(generation))
            .map_err(plainly)?;
    }
    boxes_anew(subject)?;
    let after = ask(subject, rays, QueryKind::Closest)?;
    let during = fetch(subject, before)?;
    answers(case, now, rays, &during, &alone).map_err(|e| format!("the frame under way: {e}"))?;
    answers(case, now, rays, &after, &alone).map_err(|e| format!("the frame after: {e}"))
}

/// A sound tree of another scene is refused with a reason, and the old one goes on.
pub(crate) fn wrong(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let (rays, now) = (Rays::List(&case.rays), case.times[1]);
    open(subject, &case.animation, now)?;
    stand(subject, &case.animation, now)?;
    let before = ask(subject, rays, QueryKind::Closest)?;
    for (what, words) in foreign(&case.animation, case.chance) {
        let tree = Topology::from_words(words).map_err(|e| format!("{what}: {e}"))?;
        match subject.adopt(&tree, Generation(2)) {
            Err(BackendError::WrongTree(why)) if !why.is_empty() => {}
            other => return Err(format!("{what}, expected to be refused, got {other:?}")),
        }
    }
    // Refused trees leave records and boxes as they were.
    answers(
        case,
        now,
        rays,
        &ask(subject, rays, QueryKind::Closest)?,
        &before,
    )?;
    stand(subject, &case.animation, now)?;
    answers(
        case,
        now,
        rays,
        &ask(subject, rays, QueryKind::Closest)?,
        &before,
    )
}

/// No record with anything wrong becomes a topology, so that no backend ever sees one.
pub(crate) fn damaged(case: &Case, _: &mut dyn Backend, _: &mut dyn Backend) -> Result<(), String> {
    let built = tree_at(&case.animation, case.times[0]);
    let leaves = live(&case.animation, case.chance);
    let odd = record(
        case.animation.triangle_count(),
        &leaves,
        Split::Random,
        case.chance,
    );
    if Topology::from_words(odd.clone()).is_err() {
        return Err("a sound record is refused".to_owned());
    }
    if leaves.len() < 2 {
        return Ok(());
    }
    for words in [built.words(), &odd] {
        for (what, words) in topologies::damaged(words) {
            if Topology::from_words(words).is_ok() {
                return Err(format!("a record is taken in spite of {what}"));
            }
        }
    }
    let mut bytes = built.to_le_bytes();
    bytes.pop();
    match Topology::from_le_bytes(&bytes) {
        Err(_) => Ok(()),
        Ok(_) => Err("a record is taken in spite of a byte too few".to_owned()),
    }
}
