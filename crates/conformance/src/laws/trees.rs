//! Trees come and go; answers stay.

use crate::Case;
use crate::compare::answers;
use crate::stage::{ask, boxes_anew, open, plainly, stand, tree_at};
use backend::{Backend, BackendError, Generation, Hits, Query, Rays, Seek};
use bvh_layout::Topology;

/// A tree built at one time and refitted to another answers as a fresh one does.
pub(crate) fn age(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let now = case.times[1];
    let mut seen: Vec<Hits> = Vec::new();
    for built in [now, case.times[0], case.times[2]] {
        open(subject, &case.animation, built)?;
        stand(subject, &case.animation, now)?;
        seen.push(ask(subject, Rays::List(&case.rays), Seek::Closest)?);
    }
    answers(&seen[1], &seen[0])?;
    answers(&seen[2], &seen[0])
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
    subject
        .trace(Query {
            rays,
            seek: Seek::Closest,
        })
        .map_err(plainly)?;
    let before = subject.submit().map_err(plainly)?;
    for generation in 2..5 {
        let tree = tree_at(&case.animation, case.times[generation as usize % 3]);
        subject
            .adopt(&tree, Generation(generation))
            .map_err(plainly)?;
    }
    boxes_anew(subject)?;
    let after = ask(subject, rays, Seek::Closest)?;
    let mut first = Hits::default();
    subject.hits(before, &mut first).map_err(plainly)?;
    answers(&after, &first)
}

/// A tree of another scene is refused with a reason, and the old one goes on.
pub(crate) fn wrong(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let (rays, now) = (Rays::List(&case.rays), case.times[1]);
    open(subject, &case.animation, now)?;
    stand(subject, &case.animation, now)?;
    let before = ask(subject, rays, Seek::Closest)?;
    for wrong in wrong_trees(case) {
        match subject.adopt(&wrong, Generation(2)) {
            Err(BackendError::WrongTree(_)) => {}
            other => {
                return Err(format!(
                    "a wrong tree of {} leaves: {other:?}",
                    wrong.leaf_count()
                ));
            }
        }
    }
    stand(subject, &case.animation, now)?;
    answers(&ask(subject, rays, Seek::Closest)?, &before)
}

/// Records that are sound in themselves but not this scene's.
fn wrong_trees(case: &Case) -> Vec<Topology> {
    let right = tree_at(&case.animation, case.times[0]);
    let count = right.triangle_count() as u32;
    let mut wrong = Vec::new();
    // One leaf names a triangle that the scene does not have.
    let mut words = right.words().to_vec();
    if let Some(last) = words.last_mut().filter(|_| right.leaf_count() > 0) {
        *last = count;
        words[2] = count + 1;
        wrong.extend(Topology::from_words(words));
    }
    // One leaf too many or too few.
    let header = [Topology::MAGIC, Topology::VERSION, count + 1];
    let single: Vec<u32> = header
        .into_iter()
        .chain([1, 1, 0, 0, 0, 0, 1, 0, 0])
        .collect();
    if right.leaf_count() != 1 {
        wrong.extend(Topology::from_words(single));
    }
    wrong
}
