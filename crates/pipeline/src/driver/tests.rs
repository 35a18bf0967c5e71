//! Tests of the driver with a backend that only checks the contract.

mod ahead;
mod allocations;
pub(super) mod fake;

use super::*;
use crate::tree_builder::tests::{apart, row};
use crate::tree_builder::{BuildInput, Built, TreeBuilder, Vertices};
use backend::{QueryKind, Rays};
use bvh_build::{BinaryTree, BuildError, Cancel};
use fake::{Fake, Log};
use geom::{Camera, CameraPose};
use std::any::Any;
use std::ops::Deref;
use std::sync::mpsc::channel;
use std::sync::{LazyLock, Mutex};
use std::time::Duration;

/// Two triangles that drift apart over `keys` key frames.
pub(super) fn drifting(keys: usize) -> Arc<Animation> {
    Arc::new(row(2, keys, |k, i| (k as u32 * i) as f32))
}

/// Returns `n` triangles in a row, in another order in each key frame. `n` is a power of two.
fn shuffled(keys: usize, n: u32) -> Arc<Animation> {
    let odd = |k: usize| 2 * (k * k * 7 % 29) as u32 + 1;
    Arc::new(row(n, keys, |k, i| (i * odd(k) % n) as f32))
}

/// Returns a tree for one time, for rays that end at `toward`.
fn tree_at(animation: &Animation, time: f64, toward: Option<Point>) -> Arc<BinaryTree> {
    let input = BuildInput {
        toward,
        ..BuildInput::of(at(animation, time))
    };
    binary(TreeBuilder::default().build(animation, input, &Cancel::new()))
}

fn at(animation: &Animation, time: f64) -> Vertices {
    Vertices::AtPose(animation.pose(time))
}

fn binary(built: Result<Built, BuildError>) -> Arc<BinaryTree> {
    Arc::clone(built.unwrap().topology.binary())
}

/// Update policy, and whether trees are built ahead.
pub(super) type Config = (Policy, bool);

/// Creates a driver of `animation` with the fake backend and one builder thread.
pub(super) fn driver(
    fake: Fake,
    animation: &Arc<Animation>,
    (update, predict): Config,
) -> Result<Driver, PipelineError> {
    let options = DriverOptions {
        intersector: Intersector::Watertight,
        update,
        time_range: [0.0, animation.end()],
        predict,
    };
    let threads = BuilderThreads::new(1)?;
    Driver::new(Box::new(fake), Arc::clone(animation), options, threads)
}

/// Returns a query of four pixels.
pub(super) fn query(kind: QueryKind) -> Query<'static> {
    static CAMERA: LazyLock<Camera> = LazyLock::new(|| {
        Camera::look_at(CameraPose::new([0.0, 0.0, 9.0], [0.0; 3]), [2, 2]).unwrap()
    });
    let rays = Rays::Camera(&CAMERA);
    Query { rays, kind }
}

/// Returns the log of a driver's fake.
pub(super) fn log_of(driver: Driver) -> Log {
    let fake: Box<dyn Any> = driver.into_backend();
    fake.downcast::<Fake>().unwrap().log
}

/// A finished frame, and the trees that it requested, rejected and used.
struct PlayedFrame {
    record: FrameRecord,
    requested: Option<Generation>,
    rejected: Option<Generation>,
    /// Pose for which the frame's tree was built.
    built_for: Pose,
}

impl Deref for PlayedFrame {
    type Target = FrameRecord;

    fn deref(&self) -> &FrameRecord {
        &self.record
    }
}

struct Run {
    records: Vec<PlayedFrame>,
    log: Log,
    builder_started: bool,
}

/// Renders frames of two triangles that drift apart over `keys` key frames.
fn run(keys: usize, frames: u64, update: Policy, polls: Option<u32>) -> Run {
    run_scene(&drifting(keys), frames, (update, false), polls)
}

/// Renders frames of an animation.
fn run_scene(animation: &Arc<Animation>, frames: u64, by: Config, polls: Option<u32>) -> Run {
    let driver = driver(Fake::new(polls), animation, by).unwrap();
    render(driver, evenly(frames, animation))
}

/// Returns the times of `frames` frames, evenly distributed over the animation.
fn evenly(frames: u64, animation: &Animation) -> impl Iterator<Item = f64> + use<> {
    let step = animation.end() / frames as f64;
    (0..frames).map(move |index| index as f64 * step)
}

/// Renders frames at these times. Returns the log with the frames.
fn render(mut driver: Driver, times: impl Iterator<Item = f64>) -> Run {
    let records = play(&mut driver, times, || ());
    end(driver, records)
}

/// Drops the driver. Returns its log with the frames.
fn end(driver: Driver, records: Vec<PlayedFrame>) -> Run {
    Run {
        records,
        builder_started: driver.builder.thread.is_started(),
        log: log_of(driver),
    }
}

/// Begins a frame. Its statistics follow when it is finished.
fn begin(driver: &mut Driver, frame: Frame) -> PlayedFrame {
    let newest = driver.trees.newest;
    driver.begin(frame, &[query(QueryKind::Closest)]).unwrap();
    let is_rejected = driver.recording.record.tree.rejected;
    PlayedFrame {
        record: FrameRecord::default(),
        requested: Some(driver.trees.newest).filter(|&now| now > newest),
        rejected: is_rejected.then_some(newest),
        built_for: driver.trees.current.as_ref().unwrap().request.pose,
    }
}

fn finish(driver: &mut Driver, begun: PlayedFrame) -> PlayedFrame {
    let finished = driver.finish(OutputSelection::HITS, &mut FrameOutputs::default());
    let record = finished.unwrap().unwrap();
    PlayedFrame { record, ..begun }
}

/// Renders frames at these times. After each, calls `after` and sleeps for a millisecond, because the builder is a real
/// thread and needs time.
fn play(
    driver: &mut Driver,
    times: impl Iterator<Item = f64>,
    after: impl Fn(),
) -> Vec<PlayedFrame> {
    let mut frames = (0..).zip(times).map(|(index, time)| Frame { index, time });
    let (mut begun, mut finished) = (VecDeque::new(), Vec::new());
    let most = driver.max_in_flight(&[query(QueryKind::Closest)]);
    loop {
        let next = frames.next();
        begun.extend(next.map(|frame| begin(driver, frame)));
        if next.is_some() && begun.len() < most {
            continue;
        }
        let Some(oldest) = begun.pop_front() else {
            return finished;
        };
        finished.push(finish(driver, oldest));
        after();
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Renders frames that are `step` key frames apart, and repeats failed waits. Returns the number of failed calls.
fn count_failures(driver: &mut Driver, frames: u64, step: f64) -> usize {
    let (mut failures, mut outputs) = (0, FrameOutputs::default());
    for index in 0..frames {
        let time = index as f64 * step;
        let begun = driver.begin(Frame { index, time }, &[query(QueryKind::Closest)]);
        failures += usize::from(begun.is_err());
        let finished = loop {
            match driver.finish(OutputSelection::HITS, &mut outputs) {
                Ok(finished) => break finished,
                Err(_) => failures += 1,
            }
        };
        assert_eq!(finished.is_some(), begun.is_ok());
        std::thread::sleep(Duration::from_millis(1));
    }
    failures
}

#[test]
fn static_scene_needs_no_builder() {
    for update in [Policy::Rebuild, Policy::Refit, Policy::Async] {
        let r = run(1, 5, update, Some(0));
        assert!(!r.builder_started);
        assert_eq!((r.log.interpolated, r.log.refitted), (1, 1), "{update:?}");
        assert_eq!(r.records.len(), 5);
        assert_eq!(r.records[4].tree.age_frames, 4);
        assert_eq!(r.records[4].tree.sah_ratio, Some(1.0));
    }
}

#[test]
fn frames_continue_after_a_failed_stage() {
    let animation = drifting(40);
    for failing in 0..20 {
        let fake = Fake::new(Some(0)).failing("preprocess", failing);
        let mut driver = driver(fake, &animation, (Policy::Async, false)).unwrap();
        assert_eq!(count_failures(&mut driver, 40, 0.5), 1);
    }
}

#[test]
fn first_tree_gets_a_new_generation_if_its_adoption_failed() {
    let fake = Fake::new(Some(0)).failing("adopt", 0);
    let mut driver = driver(fake, &drifting(9), (Policy::Refit, false)).unwrap();
    let failed = [0, 1].map(|index| {
        let time = index as f64;
        let begun = driver.begin(Frame { index, time }, &[query(QueryKind::Closest)]);
        begun.is_err()
    });
    assert_eq!(failed, [true, false]);
    assert_eq!(log_of(driver).adopted, [Generation(2)]);
}

/// Renders 200 frames. Trees after the first may fail.
fn play_with_failing_trees(fake: Fake, by: Config) -> Run {
    let scene = drifting(60);
    render(driver(fake, &scene, by).unwrap(), evenly(200, &scene))
}

#[test]
fn tree_is_built_if_its_writer_fails() {
    for by in [
        (Policy::Async, false),
        (Policy::Async, true),
        (Policy::Lockstep(2), false),
        (Policy::Lockstep(2), true),
    ] {
        let fake = Fake::new(Some(0)).failing("tree_writer", 0);
        let r = play_with_failing_trees(fake, by);
        // A predicted tree may be superseded.
        let rejected = r.records.iter().filter_map(|f| f.rejected);
        let mut built = r.log.adopted.iter().copied().chain(rejected);
        assert!(built.any(|tree| tree == Generation(2)), "{by:?}");
    }
}

#[test]
fn trees_without_memory_are_rejected() {
    for update in [Policy::Async, Policy::Lockstep(2)] {
        let mut fake = Fake::new(Some(0));
        fake.lacks_memory = true;
        let r = play_with_failing_trees(fake, (update, false));
        assert_eq!(r.log.adopted, [Generation(1)], "{update:?}");
        assert!(r.records.iter().any(|f| f.tree.rejected), "{update:?}");
    }
}

#[test]
fn rebuild_uses_one_tree_per_frame() {
    for update in [Policy::Rebuild, Policy::Lockstep(0)] {
        let r = run(9, 8, update, Some(3));
        assert!(!r.builder_started);
        let own = |f: &PlayedFrame| f.tree.age_frames == 0 && f.tree.adopted;
        assert!(r.records.iter().all(own));
        let generations: Vec<_> = r.records.iter().map(|f| f.tree.generation.0).collect();
        assert_eq!(generations, [1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(r.log.interpolated, 8, "once a frame");
    }
}

#[test]
fn device_rebuild_needs_no_host_builder() {
    let r = run(9, 8, Policy::DeviceRebuild, Some(0));
    assert!(!r.builder_started && r.log.adopted.is_empty() && r.log.position_requests == 0);
    assert_eq!(r.log.rebuilt, (1..9).map(Generation).collect::<Vec<_>>());
    assert_eq!(r.log.interpolated, 8);
    let own =
        |f: &PlayedFrame| f.tree.adopted && f.tree.age_frames == 0 && f.tree.sah_ratio == Some(1.0);
    assert!(r.records.iter().all(own));
    let r = run(1, 5, Policy::DeviceRebuild, Some(0));
    assert_eq!((r.log.rebuilt.len(), r.log.interpolated), (1, 1));
    assert!(r.records[0].tree.adopted && !r.records[1].tree.adopted);
}

#[test]
fn lockstep_adopts_after_k_frames() {
    for k in [1_u64, 3, 7] {
        let r = run(30, 24, Policy::Lockstep(k as u32), Some(5));
        for (n, f) in (0..).zip(&r.records) {
            // The first frame builds its own tree. From the next frame on, a tree is requested every k frames.
            let expected = match u64::saturating_sub(n, 1) / k {
                0 => (1, n),
                cycle => (1 + cycle, n - (1 + (cycle - 1) * k)),
            };
            let found = (f.tree.generation.0, f.tree.age_frames);
            assert_eq!(found, expected, "k {k} frame {n}");
        }
    }
}

#[test]
fn async_frames_never_wait_for_vertices() {
    // On busy cores the builder needs many frames.
    let r = run(60, 200, Policy::Async, Some(2));
    let generations = r.records.iter().map(|f| f.tree.generation);
    assert!(r.builder_started && generations.is_sorted());
    assert!(r.records[199].tree.generation > Generation(3));
    assert!(r.records.iter().filter(|f| f.tree.adopted).count() > 3);
    let r = run(60, 50, Policy::Async, None);
    assert_eq!(r.records.len(), 50);
    assert!(!r.builder_started && r.log.adopted == [Generation(1)]);
}

/// Returns the trees adopted in frames at times 0 to 5, whose queries have the given kinds.
fn trees_for(by: Config, kind: impl Fn(u64) -> QueryKind) -> Vec<Arc<BinaryTree>> {
    let mut driver = driver(Fake::new(Some(0)), &shuffled(6, 256), by).unwrap();
    for index in 0..6 {
        let time = index as f64;
        driver
            .begin(Frame { index, time }, &[query(kind(index))])
            .unwrap();
        driver
            .finish(OutputSelection::default(), &mut FrameOutputs::default())
            .unwrap();
    }
    log_of(driver).adopted_trees
}

#[test]
fn trees_are_ordered_toward_requested_light() {
    let animation = shuffled(6, 256);
    // One light, and another from frame 3 on, at opposite ends of the row.
    let lights = [[300.0, 40.0, 10.0], [-40.0, 40.0, 10.0]];
    let light = |index: u64| lights[usize::from(index >= 3)];
    let ordered = |time: u64, of: u64| tree_at(&animation, time as f64, Some(light(of)));
    assert_ne!(ordered(0, 0), tree_at(&animation, 0.0, None));
    assert_ne!(ordered(5, 5), ordered(5, 0));
    let kind = |index| QueryKind::ClosestAndShadow {
        light: light(index),
    };
    let rebuilt = trees_for((Policy::Rebuild, false), kind);
    assert_eq!((&rebuilt[0], &rebuilt[5]), (&ordered(0, 0), &ordered(5, 5)));
    assert_eq!(trees_for((Policy::Refit, false), kind), [ordered(0, 0)]);
    // A tree requested in one frame is used from the next one on. If predicted, it is built for that frame.
    for (predict, ahead) in [(false, 0), (true, 1)] {
        let found = trees_for((Policy::Lockstep(1), predict), kind);
        for (tree, asked) in found[1..].iter().zip(1..) {
            assert_eq!(*tree, ordered(asked + ahead, asked), "{predict} {asked}");
        }
        assert!(found.len() > 4, "{}", found.len());
    }
    // Trees for other rays are not ordered for a light.
    for kind in [QueryKind::Closest, QueryKind::Any] {
        let found = trees_for((Policy::Rebuild, false), |_| kind);
        assert_eq!(found[3], tree_at(&animation, 3.0, None));
    }
}

/// The builder waits for 20 frames. If a frame waited for the builder too, both would wait until the build fails.
#[test]
fn frames_continue_during_slow_builds() {
    let (sender, receiver) = channel();
    let (scene, mut fake) = (drifting(200), Fake::new(Some(1)));
    fake.rendered = Some(Arc::new(Mutex::new(receiver)));
    let mut driver = driver(fake, &scene, (Policy::Async, false)).unwrap();
    let after = move || sender.send(()).unwrap();
    let records = play(&mut driver, evenly(100, &scene), after);
    assert_eq!(records.len(), 100);
    let adopted = records[1..].iter().filter(|r| r.tree.adopted);
    let ages: Vec<u64> = adopted.map(|r| r.tree.age_frames).collect();
    assert!(
        ages.len() >= 2 && ages.iter().all(|&age| age >= 20),
        "{ages:?}"
    );
    assert!(records[0].build_wait_ms > 0.0);
    assert!(records[1..].iter().all(|r| r.build_wait_ms == 0.0));
}

#[test]
fn only_rebuild_and_lockstep_wait() {
    let refit = run(30, 20, Policy::Refit, Some(0));
    assert!(!refit.builder_started && refit.log.adopted == [Generation(1)]);
    assert_eq!(
        (refit.records[19].tree.age_frames, refit.log.refitted),
        (19, 20)
    );
    assert!(refit.records[1..].iter().all(|r| r.build_wait_ms == 0.0));
    let rebuild = run(30, 20, Policy::Rebuild, Some(0)).records;
    let waits = |r: &PlayedFrame| 0.0 < r.build_wait_ms && r.build_wait_ms <= r.wall_ms;
    assert!(rebuild.iter().all(waits));
    // Vertices arrive later than their tree is due.
    let lockstep = run(30, 24, Policy::Lockstep(2), Some(9)).records;
    for r in lockstep {
        assert_eq!(r.build_wait_ms > 0.0, r.tree.adopted, "{:?}", r.record);
        assert!(r.build_wait_ms <= r.wall_ms);
    }
}
