//! Tests of trees for future times, and of trees that are rejected because they are no better.

use super::*;
use crate::driver::next_tree::NextTreeState;
use crate::tree_builder::BuildStrategy;

const ASYNC_PREDICTED: Config = (Policy::Async, true);

/// The fake delivers positions only for the first tree. No later frame requests any.
#[test]
fn predicted_trees_need_no_readback() {
    for update in [Policy::Async, Policy::Lockstep(4)] {
        let run = run_scene(&drifting(60), 50, (update, true), None);
        assert_eq!(run.log.position_requests, 1);
        assert!(run.builder_started && run.log.adopted.len() > 3);
    }
}

#[test]
fn lockstep_builds_for_middle_of_use() {
    let animation = shuffled(30, 64);
    let run = run_scene(&animation, 29, (Policy::Lockstep(3), true), None);
    let tree_at = |time| tree_at(&animation, time, None);
    // Trees are requested in frames 1, 4 and so on. Each is used from the 3rd to the 5th frame after its request.
    for (i, tree) in run.log.adopted_trees[1..].iter().enumerate() {
        let middle = (1 + 3 * i + 4) as f64;
        assert!(*tree == tree_at(middle), "tree {i}");
        assert!(*tree != tree_at(middle - 4.0));
    }
    assert!(run.log.adopted_trees.len() > 8);
}

/// Returns the time that a frame's tree was built for.
fn moment(frame: &PlayedFrame) -> f64 {
    f64::from(frame.built_for.key) + f64::from(frame.built_for.alpha)
}

/// Renders five frames, one per half key frame. The tree requested in frame `from` has an expected latency of `latency`
/// frames. But each tree arrives before the next frame, so for later requests the predictor expects one frame.
fn early(from: u64, latency: u64) -> Run {
    let scene = shuffled(65, 1 << 13);
    let mut driver = driver(Fake::new(None), &scene, ASYNC_PREDICTED).unwrap();
    let frame = |index: u64| {
        if index == from {
            let predictor = &mut driver.predictor;
            predictor.observe_latency(latency, BuildStrategy::Scratch);
        }
        let time = index as f64 * 0.5;
        let begun = begin(&mut driver, Frame { index, time });
        while matches!(
            driver.trees.next,
            NextTreeState::Requested(..) | NextTreeState::Building(_)
        ) {
            driver.poll_builder().unwrap();
        }
        finish(&mut driver, begun)
    };
    let records = (0..5).map(frame).collect();
    end(driver, records)
}

#[test]
fn early_tree_waits_for_its_time() {
    let records = early(1, 2).records;
    assert!(records[1].requested.is_some());
    for waiting in &records[2..4] {
        assert!(!waiting.tree.adopted && !waiting.tree.rejected);
    }
    // The first tree's target is 0.5, so the tree for 1.75 is nearer from time 1.125 on: in frame 3. The fake evaluates
    // no trees, so the next frame adopts the tree.
    assert!(records[4].tree.adopted);
    assert_eq!(moment(&records[4]), 1.75);
}

#[test]
fn distant_tree_yields_to_newer_request() {
    let run = early(1, 20);
    assert!(run.records[2].rejected.is_some() && run.records[2].requested.is_some());
    assert!(run.records[4].tree.adopted);
    assert_eq!(moment(&run.records[4]), 1.5);
    // A run without the rejected tree builds the same one, from subtrees of the current tree.
    assert!(run.log.adopted_trees[1] == early(2, 1).log.adopted_trees[1]);
}

#[test]
fn first_tree_spans_a_key_interval() {
    let animation = shuffled(30, 64);
    let swept_poses = [0.25, 0.75].map(|time| animation.pose(time));
    let own = BuildInput {
        swept_poses: Some(swept_poses),
        ..BuildInput::of(at(&animation, 0.0))
    };
    let swept = binary(TreeBuilder::default().build(&animation, own, &Cancel::new()));
    let plain = tree_at(&animation, 0.0, None);
    assert_ne!(swept, plain);
    let first = |policy| run_scene(&animation, 5, policy, Some(1)).log.adopted_trees[0].clone();
    assert_eq!(first(ASYNC_PREDICTED), swept);
    let others = [Policy::Lockstep(2), Policy::Rebuild, Policy::Refit].map(|update| (update, true));
    for policy in others.into_iter().chain([(Policy::Async, false)]) {
        assert_eq!(first(policy), plain, "{policy:?}");
    }
}

#[test]
fn second_tree_awaits_measured_frame_rate() {
    let run = run_scene(&shuffled(65, 1 << 13), 128, ASYNC_PREDICTED, None);
    let asked = run.records[1..]
        .iter()
        .find(|r| r.requested.is_some())
        .unwrap();
    assert_eq!(asked.frame.index, 3);
    let second = |r: &&PlayedFrame| r.tree.generation == Generation(2);
    // It may have been rejected.
    if let Some(found) = run.records.iter().find(second) {
        assert!(moment(found) >= asked.frame.time + 0.5, "{}", moment(found));
    }
    let run = run_scene(&shuffled(30, 64), 29, (Policy::Lockstep(3), true), None);
    assert!(run.records[1].requested.is_some());
}

/// Returns a fake that measures the costs of trees.
fn measuring() -> Fake {
    let mut fake = Fake::new(Some(1));
    fake.measures = true;
    fake
}

/// Renders frames of a shuffled row with a fake that measures costs. The driver may know the key frames.
fn play_measured(by: Config, frames: u64, knows_key_frames: bool) -> Run {
    let mut driver = driver(measuring(), &shuffled(200, 64), by).unwrap();
    if !knows_key_frames {
        driver.forget_key_frames();
    }
    render(driver, (0..frames).map(|index| index as f64))
}

#[test]
fn only_cheaper_trees_are_adopted() {
    for (predict, knows_key_frames) in [(false, true), (true, true), (false, false), (true, false)]
    {
        let run = play_measured((Policy::Async, predict), 199, knows_key_frames);
        let rejected: Vec<Generation> = run.records.iter().filter_map(|r| r.rejected).collect();
        // With prediction from known key frames, trees are built from the exact positions at a future time, so all may be
        // better.
        let may_all_be_better = predict && knows_key_frames;
        assert!(
            may_all_be_better || !rejected.is_empty(),
            "{predict} {knows_key_frames}"
        );
        assert!(rejected.is_sorted() && run.log.adopted.len() > 1);
        for record in &run.records {
            assert!(!record.tree.rejected || !record.tree.adopted);
            assert!(!rejected.contains(&record.tree.generation));
        }
        // The last evaluation decides.
        for (generation, [candidate, current]) in &run.log.evaluated {
            let last = run.log.evaluated.iter().rfind(|(g, _)| g == generation);
            let [last, _] = last.map(|(_, costs)| *costs).unwrap();
            if last == *candidate && run.log.adopted.contains(generation) {
                assert!(candidate < current, "{generation:?}");
            }
            if rejected.contains(generation) {
                assert!(candidate >= current, "{generation:?}");
            }
        }
    }
}

#[test]
fn lockstep_adopts_trees_without_evaluation() {
    for knows_key_frames in [true, false] {
        let run = play_measured((Policy::Lockstep(2), false), 59, knows_key_frames);
        assert!(run.records.iter().all(|r| r.rejected.is_none()));
        assert_eq!(run.log.adopted.len(), 29);
        assert!(run.log.evaluated.is_empty());
        assert_eq!(
            play_measured((Policy::Lockstep(2), false), 59, knows_key_frames)
                .log
                .adopted_trees,
            run.log.adopted_trees
        );
    }
}

#[test]
fn unsubmitted_evaluation_is_recorded_again() {
    let scene = shuffled(200, 64);
    let mut driver = driver(measuring(), &scene, (Policy::Async, false)).unwrap();
    play(&mut driver, (0..60).map(|index| index as f64), || ());
    let mut fails = 0;
    for index in 60..160 {
        driver.poll_builder().unwrap();
        let is_due = |driver: &Driver| matches!(driver.trees.next, NextTreeState::Due(_));
        let time = index as f64;
        let frame = Frame { index, time };
        if driver.review_next().is_ok() && is_due(&driver) && fails == 0 {
            fails += 1;
            driver.record_evaluation().unwrap();
            driver.trees.next.advance(Event::FrameFailed);
        }
        driver.begin(frame, &[query(QueryKind::Closest)]).unwrap();
        let finished = driver.finish(OutputSelection::default(), &mut FrameOutputs::default());
        finished.unwrap();
        std::thread::sleep(Duration::from_millis(1));
    }
    let evaluated = log_of(driver).evaluated;
    let twice = |pair: &[(Generation, [f64; 2])]| pair[0].0 == pair[1].0;
    assert!(fails == 1 && evaluated.windows(2).any(twice));
}

#[test]
fn failed_wait_leaves_the_frame_in_flight() {
    let fake = measuring().failing("wait for an evaluation", 0);
    let mut driver = driver(fake, &shuffled(200, 64), (Policy::Async, false)).unwrap();
    let failures = count_failures(&mut driver, 199, 1.0);
    assert!(failures == 1 && log_of(driver).adopted.len() > 1);
}

/// Returns triangles at random positions with random motion.
fn scattered(seed: u32) -> Arc<Animation> {
    let mut state = seed;
    let mut number = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let mut point = |size: f32| [0; 3].map(|_| size * number());
    let first: Vec<Point> = (0..3 * 40).map(|_| point(1.0)).collect();
    let later = first.iter().map(|p| {
        let by = point(0.3);
        [0, 1, 2].map(|i| p[i] + by[i])
    });
    let keys = vec![first.clone(), later.collect()];
    Arc::new(Animation::new(keys, apart(40)).unwrap())
}

#[test]
fn resting_scene_stops_requesting_trees() {
    let mut rejected_at_rest = 0;
    for seed in 0..24 {
        let driver = driver(measuring(), &scattered(seed), (Policy::Async, false)).unwrap();
        let times = (0..45).map(|index| 0.07 * index.min(10) as f64);
        let records = render(driver, times).records;
        let last = records.iter().rposition(|r| r.rejected.is_some());
        rejected_at_rest += u32::from(last.is_some_and(|frame| frame > 12));
        // A slow builder may work on an earlier pose when the scene comes to rest.
        let at_rest = records[11..].iter().filter(|r| r.requested.is_some());
        assert!(at_rest.count() <= 2, "{seed}");
    }
    assert!(rejected_at_rest > 0);
}

/// Renders frames of a scene whose positions only the backend has. It moves in the first `moving` frames.
fn unknown(by: Config, frames: u64, moving: u64) -> Run {
    let mut driver = driver(Fake::new(Some(1)), &shuffled(65, 64), by).unwrap();
    driver.forget_key_frames();
    let times = (0..frames).map(|index| index.min(moving) as f64 * 0.25);
    render(driver, times)
}

#[test]
fn device_only_vertices_need_two_readbacks() {
    let Run { records, log, .. } = unknown(ASYNC_PREDICTED, 60, 60);
    assert!(log.adopted.len() > 3);
    // The first tree uses only its own frame's vertices.
    let asked = records[1..]
        .iter()
        .filter(|r| r.requested.is_some())
        .count();
    assert!((2 * asked..=2 * asked + 1).contains(&log.position_requests));
    // Later trees are built for a time after their requests.
    for adopted in records[1..].iter().filter(|r| r.tree.adopted) {
        let is_request = |r: &&PlayedFrame| r.requested == Some(adopted.tree.generation);
        let request = records.iter().find(is_request).unwrap();
        assert!(moment(adopted) > request.frame.time);
    }
}

#[test]
fn failed_second_readback_is_repeated() {
    // The first two read-backs are those of the first tree and of the frame that requests the second tree.
    let fake = Fake::new(Some(1)).failing("request_positions", 2);
    let mut driver = driver(fake, &shuffled(65, 64), ASYNC_PREDICTED).unwrap();
    driver.forget_key_frames();
    let failures = count_failures(&mut driver, 200, 0.25);
    assert!(failures == 1 && log_of(driver).adopted.len() > 1);
}

/// A frame reads positions back twice: for the coordinate range, and for its own tree.
#[test]
fn device_time_includes_separate_readbacks() {
    let keys = shuffled(2, 64);
    let key = |key: usize| keys.key(key).unwrap().to_vec();
    let streamed = Animation::streamed(key(0), &[false; 3 * 64], apart(64)).unwrap();
    let by = (Policy::Rebuild, false);
    let mut driver = driver(Fake::new(Some(1)), &Arc::new(streamed), by).unwrap();
    driver.forget_key_frames();
    let time = driver.animation.push(key(1)).unwrap();
    let light = [0.0, 9.0, 0.0];
    let query = query(QueryKind::ClosestAndShadow { light });
    driver.begin(Frame { index: 0, time }, &[query]).unwrap();
    let finished = driver.finish(OutputSelection::HITS, &mut FrameOutputs::default());
    // One millisecond for each submission.
    assert_eq!(finished.unwrap().unwrap().report.times.device_ms, 3.0);
}

/// The builder starts only after the animation has dropped a key frame of the request.
#[test]
fn lockstep_builds_from_key_frames_of_the_request() {
    let keys = shuffled(8, 64);
    let key = |key: usize| keys.key(key).unwrap().to_vec();
    let streamed = Animation::streamed(key(0), &[false; 3 * 64], apart(64)).unwrap();
    let (animation, fake) = (Arc::new(streamed), Fake::new(None));
    let threads = BuilderThreads::new(1).unwrap();
    let options = DriverOptions {
        intersector: Intersector::Watertight,
        update: Policy::Lockstep(6),
        time_range: [0.0, f64::MAX],
        predict: true,
    };
    let (scene, builders) = (Arc::clone(&animation), threads.clone());
    let mut driver = Driver::new(Box::new(fake), scene, options, builders).unwrap();
    let mut render = |number: usize| {
        let time = match number {
            0 => 0.0,
            _ => animation.push(key(number)).unwrap(),
        };
        let index = number as u64;
        let begun = begin(&mut driver, Frame { index, time });
        finish(&mut driver, begun);
    };
    render(0);
    let (release, released) = channel::<()>();
    let (blocked, is_blocked) = channel();
    let blocker = std::thread::spawn(move || {
        threads.install(move || {
            blocked.send(()).unwrap();
            // Returns an error once `release` is dropped.
            let _ = released.recv();
        });
    });
    is_blocked.recv().unwrap();
    // Frame 1 requests a tree, and frame 7 waits for it.
    (1..7).for_each(&mut render);
    drop(release);
    render(7);
    blocker.join().unwrap();
    let requested = Animation::new(vec![key(0), key(1)], apart(64)).unwrap();
    // The tree is used from the 6th to the 11th frame after its request, so for times around 9.5.
    let (key, alpha) = (0, 9.5);
    let input = BuildInput::of(Vertices::AtPose(Pose { key, alpha }));
    let expected = binary(TreeBuilder::default().build(&requested, input, &Cancel::new()));
    assert_eq!(log_of(driver).adopted_trees[1], expected);
}

#[test]
fn lockstep_needs_one_readback_per_tree() {
    for (k, moving) in [(1, 60), (3, 60), (3, 5)] {
        let Run { records, log, .. } = unknown((Policy::Lockstep(k), true), 20, moving);
        let asked = records[1..]
            .iter()
            .filter(|r| r.requested.is_some())
            .count();
        assert!(
            log.adopted.len() > 1 && log.position_requests == 1 + asked,
            "{k}"
        );
    }
}

#[test]
fn resting_device_scene_gets_final_tree() {
    let records = unknown(ASYNC_PREDICTED, 120, 5).records;
    assert_eq!(moment(&records[119]), 1.25);
    assert!(records[80..].iter().all(|r| r.requested.is_none()));
}
