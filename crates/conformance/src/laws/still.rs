//! What never moves may be passed over, and nothing else.

use super::Check;
use crate::Case;
use crate::compare::{answers, lists, same_counts, same_point};
use crate::generate::topologies::{Split, live, odd};
use crate::reference::Answer;
use crate::stage::{boxes_anew, tree_at, vertices};
use anyhow::{Context, Result, ensure};
use backend::Generation;
use bvh_layout::Topology;

/// Frames that are looked at.
const FRAMES: usize = 7;
/// By how much, relatively, costs of trees may differ: sums in single precision, taken in any order.
pub(super) const COST_TOLERANCE: f64 = 1e-4;

/// A tree that comes with lists of what moves gives the positions, boxes, counts, cost and hits of one that comes without,
/// frame after frame and tree after tree, whichever stages were done before. The case's chance decides what happens.
pub(super) fn passed_over(c: &mut Check<'_>) -> Result<()> {
    let case = c.case;
    let mut rng = fastrand::Rng::with_seed(case.chance);
    let mut tree = tree_at(&case.animation, case.times[0]);
    let mut now = case.times[0];
    c.open(now)?;
    c.stand(now)?;
    for frame in 0..FRAMES {
        same(c, &tree, now).with_context(|| format!("frame {frame}"))?;
        if rng.u8(..3) == 0 {
            tree = another_tree(case, &mut rng);
            c.subject.adopt(&tree, Generation(2 + frame as u64))?;
        }
        // Stages that nothing follows must not be taken for more than they were.
        for _ in 0..rng.u8(..3) {
            now = case.times[rng.usize(..3)];
            c.interpolate(now)?;
            if rng.bool() {
                c.subject.preprocess()?;
            }
            c.subject.submit()?;
        }
        if rng.bool() {
            now = case.times[rng.usize(..3)];
            c.stand(now)?;
        }
        boxes_anew(c.subject)?;
        if rng.bool() {
            c.subject.submit()?;
        }
    }
    Ok(())
}

/// Built or odd, with lists or without.
fn another_tree(case: &Case, rng: &mut fastrand::Rng) -> Topology {
    let animation = &case.animation;
    let built = tree_at(animation, case.times[rng.usize(..3)]);
    match rng.u8(..3) {
        0 => built,
        1 => without_lists(&built),
        _ => {
            let leaves = live(animation, rng.u64(..));
            let count = animation.triangle_count();
            let odd = odd(count, &leaves, Split::Random, rng.u64(..));
            odd.with_moving(animation.static_parts())
        }
    }
}

fn without_lists(tree: &Topology) -> Topology {
    Topology::from_words(tree.words().to_vec()).expect("it was sound before")
}

/// Traces what was recorded, and holds all that the subject shows to what the reference does with the tree without lists.
fn same(c: &mut Check<'_>, tree: &Topology, now: f64) -> Result<()> {
    let case = c.case;
    let seen = Answer::of(c.subject, case)?;
    let positions = c.subject.inspect().positions()?;
    let formula = vertices(&case.animation, now);
    lists("position of vertex", &positions, &formula, same_point)?;
    let expected = c.reference.by_tree(case, &without_lists(tree), now)?;
    lists("box of node", &seen.boxes, &expected.boxes, PartialEq::eq)?;
    same_counts(&seen.report, &expected.report)?;
    // Where areas neither overflow nor vanish in single precision, a cost that is told is right.
    let right = expected.report.sah_cost;
    let is_right =
        |cost: f64| right.is_some_and(|right| (cost / right - 1.0).abs() <= COST_TOLERANCE);
    let told = (seen.report.sah_cost).filter(|_| case.animation.scale_exponent() == 0);
    ensure!(
        told.is_none_or(is_right),
        "the tree's cost is {told:?}, expected {right:?}"
    );
    answers(case, now, c.rays(), &seen.hits, &expected.hits)
}
