//! Trees for what comes: built ahead, built for all times, and left where they are no better.

use crate::{Run, drifting, run_scene};
use backend::Generation;
use bvh_build::Cancel;
use geom::{Animation, Point, Pose};
use pipeline::{FrameRecord, Made, Pace, Update, Vertices, Workbench};
use std::sync::Arc;

/// Triangles in a row whose order is another in every key frame.
fn shuffled(keys: u32) -> Arc<Animation> {
    many_shuffled(keys, 64)
}

/// Likewise, a power of two of them.
fn many_shuffled(keys: u32, n: u32) -> Arc<Animation> {
    let triangle = |place: u32| {
        let x = place as f32;
        [[x, 0.0, 0.0], [x + 0.5, 0.0, 0.0], [x, 0.5, 0.5]]
    };
    let odd = |k: u32| 2 * (k * k * 7 % 29) + 1;
    let key = |k: u32| (0..n).flat_map(|i| triangle(i * odd(k) % n)).collect();
    let triangles = (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Arc::new(Animation::new((0..keys).map(key).collect(), triangles).unwrap())
}

fn positions(animation: &Animation, time: f64) -> Vec<Point> {
    let pose = animation.pose(time);
    let vertices = 0..animation.vertex_count() as u32;
    vertices.map(|v| animation.vertex(pose, v)).collect()
}

/// The record of a tree for one moment.
fn tree_at(animation: &Animation, time: f64) -> Vec<u32> {
    let positions = positions(animation, time);
    let built = Workbench::new().build(animation, &positions, &Cancel::new());
    built.unwrap().topology.into_words()
}

/// Positions never arrive, and nobody asks for them but the first frame.
fn foreseen(update: Update) -> Run {
    let run = run_scene(&drifting(60), 50, (update, true), (None, None));
    assert_eq!(run.log.requested, 1);
    run
}

#[test]
fn trees_built_ahead_read_nothing_back() {
    let run = foreseen(Update::Async(Pace::Free));
    assert!(run.built && run.log.adopted.len() > 3);
    let trees = || run.records.iter().filter_map(|r| r.adopted);
    assert!(trees().skip(1).all(|t| t.snapshot_bytes == 0));
    let run = foreseen(Update::Async(Pace::Lockstep(4)));
    assert_eq!(run.log.adopted.len(), 13);
}

#[test]
fn in_lockstep_a_tree_is_built_for_the_middle_of_its_use() {
    let animation = shuffled(30);
    let run = run_scene(
        &animation,
        29,
        (Update::Async(Pace::Lockstep(3)), true),
        (None, None),
    );
    let tree_at = |time| tree_at(&animation, time);
    // Asked for at frames 1, 4 and so on, each tree is used from the 3rd to the 5th frame after.
    for (i, words) in run.log.trees[1..].iter().enumerate() {
        let middle = (1 + 3 * i + 4) as f64;
        assert!(*words == tree_at(middle), "tree {i}");
        assert!(*words != tree_at(middle - 4.0));
    }
    assert!(run.log.trees.len() > 8);
}

/// Frames at every half key, which come faster than trees.
fn steady() -> (Arc<Animation>, Run) {
    let animation = many_shuffled(65, 1 << 13);
    let run = run_scene(&animation, 128, FREE, (None, None));
    (animation, run)
}

const FREE: (Update, bool) = (Update::Async(Pace::Free), true);

#[test]
fn a_tree_is_built_for_the_middle_of_its_use_as_the_trees_before_it_foretell() {
    let (animation, run) = steady();
    let (mut latency, mut asked, mut checked) = (None::<f64>, (0, None), 0);
    for (i, record) in (0_u32..).zip(&run.records).skip(1) {
        if let (Some(adopted), Some(expected)) = (record.adopted, asked.1) {
            assert_eq!(adopted.built_for, expected, "{:?}", record.frame);
            checked += 1;
        }
        if record.adopted.is_some() || record.rejected.is_some() {
            let seen = f64::from(i - asked.0);
            latency = Some(learned(latency, seen));
        }
        if record.asked.is_some() {
            let time = |l: f64| record.frame.time + 0.5 * (l + (l - 1.0) / 2.0);
            let pose = |l| animation.pose(f64::min(time(l), animation.end()));
            asked = (i, latency.map(pose));
        }
    }
    assert!(checked > 2, "{checked} trees");
}

/// The trees after the first that come of what a driver was to tell its builder in `run`, with the halves of their use or
/// without; `None` if the second one was rejected, so that nobody knows what it was built for.
fn foretold(animation: &Animation, run: &Run, with_halves: bool) -> Option<Vec<Vec<u32>>> {
    let (mut bench, cancel) = (Workbench::new(), Cancel::new());
    let halves = [0.25, 0.75].map(|time| animation.pose(time));
    let first = bench.build_swept(animation, (&positions(animation, 0.0), halves), &cancel);
    first.unwrap();
    let (mut latency, mut asked, mut trees) = (None::<f64>, (0, None), Vec::new());
    for (i, record) in (0_u32..).zip(&run.records).skip(1) {
        if record.adopted.is_some() || record.rejected.is_some() {
            let told = asked.1.or(record.adopted.map(|tree| [tree.built_for; 3]));
            let [early, middle, late]: [Pose; 3] = told?;
            let halves = with_halves.then_some([early, late]);
            let what = (Vertices::KeyFrames(middle), halves);
            let made = bench.build_better(animation, what, Some(middle), &cancel);
            if let Made::Tree(tree) = made.unwrap() {
                trees.push(tree.topology.into_words());
            }
            latency = Some(learned(latency, f64::from(i - asked.0)));
        }
        if record.asked.is_some() {
            let time = |l: f64, share: f64| record.frame.time + 0.5 * (l + share * (l - 1.0));
            let pose = |l, share| animation.pose(f64::min(time(l, share), animation.end()));
            asked = (
                i,
                latency.map(|l| [0.25, 0.5, 0.75].map(|share| pose(l, share))),
            );
        }
    }
    Some(trees)
}

/// What is expected after a tree that took so many frames.
fn learned(latency: Option<f64>, seen: f64) -> f64 {
    match latency {
        None => seen,
        Some(l) if seen < 0.75 * l => seen,
        Some(l) => f64::midpoint(l, seen),
    }
}

#[test]
fn the_builder_is_told_the_halves_of_a_trees_use() {
    let known = (0..9).find_map(|_| {
        let (animation, run) = steady();
        let trees = foretold(&animation, &run, true)?;
        Some((trees, foretold(&animation, &run, false)?, run))
    });
    let (trees, without, run) = known.expect("second trees are taken");
    assert!(trees.len() > 2 && trees == run.log.trees[1..]);
    assert!(trees != without, "no tree faded");
}

#[test]
fn a_first_tree_that_is_used_for_nobody_knows_how_long_is_built_for_a_key_frame() {
    let animation = shuffled(30);
    let halves = [0.25, 0.75].map(|time| animation.pose(time));
    let own = positions(&animation, 0.0);
    let swept = Workbench::new().build_swept(&animation, (&own, halves), &Cancel::new());
    let (swept, plain) = (
        swept.unwrap().topology.into_words(),
        tree_at(&animation, 0.0),
    );
    assert_ne!(swept, plain);
    let first = |policy| run_scene(&animation, 5, policy, (Some(1), None)).log.trees[0].clone();
    assert_eq!(first(FREE), swept);
    for policy in [
        (Update::Async(Pace::Free), false),
        (Update::Async(Pace::Lockstep(2)), true),
        (Update::Rebuild, true),
        (Update::Refit, true),
    ] {
        assert_eq!(first(policy), plain, "{policy:?}");
    }
}

#[test]
fn the_second_tree_is_asked_for_once_the_pace_is_known_and_built_ahead() {
    let (_, run) = steady();
    let asked = run.records[1..].iter().find(|r| r.asked.is_some()).unwrap();
    assert_eq!(asked.frame.index, 3);
    let second = |r: &&FrameRecord| r.tree_generation == Generation(2);
    // It may have been rejected.
    if let Some(tree) = run.records.iter().find(second).and_then(|r| r.adopted) {
        let built_for = f64::from(tree.built_for.key) + f64::from(tree.built_for.alpha);
        assert!(built_for >= asked.frame.time + 0.5, "{built_for}");
    }
    let lockstep = (Update::Async(Pace::Lockstep(3)), true);
    let run = run_scene(&shuffled(30), 29, lockstep, (None, None));
    assert!(run.records[1].asked.is_some());
}

#[test]
fn a_tree_that_is_no_better_is_left_and_its_number_not_used_again() {
    let run = run_scene(
        &shuffled(200),
        199,
        (Update::Async(Pace::Free), false),
        (Some(1), None),
    );
    let rejected: Vec<Generation> = run.records.iter().filter_map(|r| r.rejected).collect();
    assert!(!rejected.is_empty() && rejected.is_sorted());
    assert!(rejected.iter().all(|g| !run.log.adopted.contains(g)));
    assert!(run.log.adopted.len() > 1);
    for record in &run.records {
        assert!(record.rejected.is_none() || record.adopted.is_none());
        assert!(!rejected.contains(&record.tree_generation));
    }
}

#[test]
fn in_lockstep_every_tree_is_taken() {
    let run = run_scene(
        &shuffled(60),
        59,
        (Update::Async(Pace::Lockstep(2)), false),
        (Some(1), None),
    );
    assert!(run.records.iter().all(|r| r.rejected.is_none()));
    assert_eq!(run.log.adopted.len(), 29);
}

#[test]
fn a_tree_for_all_times_is_built_once_without_the_device() {
    let animation = shuffled(8);
    let run = run_scene(&animation, 20, (Update::TSah, true), (None, None));
    assert!(!run.built && run.log.requested == 0);
    assert_eq!(run.log.adopted, [Generation(1)]);
    assert_eq!((run.log.interpolated, run.log.refitted), (20, 20));
    let tree = run.records[0].adopted.unwrap();
    assert_eq!((tree.triangles, tree.snapshot_bytes), (64, 0));
    assert!(run.records[0].build_wait_ms > 0.0 && run.records[19].tree_age_frames == 19);
    let refitted = run_scene(&animation, 20, (Update::Refit, true), (Some(0), None));
    assert_ne!(run.log.trees, refitted.log.trees);
}
