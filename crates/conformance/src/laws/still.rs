//! Skipping of static geometry, which must not change any result.

use super::Check;
use crate::Case;
use crate::compare::{answers, lists, same_counts, same_point};
use crate::generate::topologies::{Split, live, odd};
use crate::reference::Answer;
use crate::stage::{boxes_anew, tree_at, vertices};
use anyhow::{Context, Result, ensure};
use backend::Generation;
use bvh_layout::Topology;

/// Number of frames that are compared.
const FRAMES: usize = 7;
/// Relative tolerance of tree costs, which are sums in single precision and in any order.
pub(super) const COST_TOLERANCE: f64 = 1e-4;

/// Tests that a tree with lists of moving elements gives the same positions, boxes, counts, cost and hits as one
/// without.
///
/// Compares over several frames and trees, with random stages recorded before. The case's random bits determine them.
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
        // Stages without the stages that usually follow must not confuse the backend.
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

/// Returns a built tree or a random one, with or without lists.
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

/// Traces the recorded frame, and compares all results with the reference's for the same tree without lists.
fn same(c: &mut Check<'_>, tree: &Topology, now: f64) -> Result<()> {
    let case = c.case;
    let seen = Answer::of(c.subject, case)?;
    let positions = c.subject.inspect().positions()?;
    let formula = vertices(&case.animation, now);
    lists("position of vertex", &positions, &formula, same_point)?;
    let expected = c.reference.by_tree(case, &without_lists(tree), now)?;
    lists("box of node", &seen.boxes, &expected.boxes, PartialEq::eq)?;
    same_counts(&seen.report, &expected.report)?;
    // A reported cost must be right, if areas neither overflow nor underflow in single precision.
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
