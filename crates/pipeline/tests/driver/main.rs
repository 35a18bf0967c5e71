//! The driver against a backend that does nothing but check the contract.

mod ahead;
mod allocations;
mod fake;
mod moments;
mod occluder_first;
mod own;
mod warm_up;

use backend::{Generation, Method, Query, QueryKind, Rays};
use fake::{Fake, Gate, Log};
use geom::{Animation, Camera};
use pipeline::{
    BuilderThreads, Driver, DriverOptions, Frame, FrameRecord, Pace, PipelineError, Update, Wanted,
};
use std::sync::{Arc, LazyLock, Mutex};

/// Two triangles that drift apart over `keys` key frames.
fn drifting(keys: usize) -> Arc<Animation> {
    let frame = |k: usize| {
        let far = k as f32;
        let near = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        [near, near.map(|[x, y, z]| [x + far, y, z + far])].concat()
    };
    let triangles = vec![[0, 1, 2], [3, 4, 5]];
    Arc::new(Animation::new((0..keys).map(frame).collect(), triangles).unwrap())
}

/// A driver of `animation` by the fake, with one thread that builds.
fn driver(
    fake: Fake,
    animation: &Arc<Animation>,
    (update, predict): (Update, bool),
) -> Result<Driver, PipelineError> {
    let options = DriverOptions {
        method: Method::default(),
        update,
        time_range: [0.0, animation.end()],
        predict,
    };
    let threads = BuilderThreads::new(1)?;
    Driver::new(Box::new(fake), Arc::clone(animation), options, threads)
}

/// A query of four pixels: what they see, the fake makes up.
fn query(kind: QueryKind) -> Query<'static> {
    static CAMERA: LazyLock<Camera> = LazyLock::new(|| {
        Camera::look_at([0.0, 0.0, 9.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, [2, 2]).unwrap()
    });
    let rays = Rays::Camera(&CAMERA);
    Query { rays, kind }
}

/// What a fake wrote that is gone with its driver.
fn read(log: Arc<Mutex<Log>>) -> Log {
    Arc::into_inner(log).unwrap().into_inner().unwrap()
}

fn run(keys: usize, frames: u64, update: Update, polls: Option<u32>) -> Run {
    run_scene(&drifting(keys), frames, (update, false), polls)
}

/// Each frame is followed by a millisecond: the builder is a real thread, and needs time to be heard.
fn run_scene(
    animation: &Arc<Animation>,
    frames: u64,
    by: (Update, bool),
    polls: Option<u32>,
) -> Run {
    run_paced(animation, (frames, |_| 1), by, (polls, None))
}

/// Each frame is followed by a rest of so many milliseconds.
fn run_paced(
    animation: &Arc<Animation>,
    (frames, rest): (u64, fn(u64) -> u64),
    (update, predict): (Update, bool),
    (polls, gate): (Option<u32>, Option<Arc<Gate>>),
) -> Run {
    let (fake, log) = Fake::new(polls, gate.clone());
    let mut driver = driver(fake, animation, (update, predict)).unwrap();
    let step = animation.end() / frames as f64;
    let times = (0..frames).map(|index| index as f64 * step);
    let records = play(&mut driver, times, |index| {
        gate.iter().for_each(|g| g.step(1));
        rest(index)
    });
    let built = driver.has_builder();
    gate.iter().for_each(|g| g.open());
    drop(driver);
    let log = read(log);
    Run {
        records,
        log,
        built,
    }
}

/// Frames at these times, each followed by a rest of so many milliseconds.
fn play(
    driver: &mut Driver,
    times: impl Iterator<Item = f64>,
    rest: impl Fn(u64) -> u64,
) -> Vec<FrameRecord> {
    let mut records = Vec::new();
    let frames = (0..).zip(times).map(|(index, time)| Frame { index, time });
    let query = query(QueryKind::Closest);
    let run = driver.run(frames, query, Wanted::HITS, |record, _| {
        records.push(record.clone());
        let rest = std::time::Duration::from_millis(rest(record.frame.index));
        // Not even for nothing: who sleeps is woken late.
        if !rest.is_zero() {
            std::thread::sleep(rest);
        }
        Ok::<(), PipelineError>(())
    });
    run.unwrap();
    records
}

struct Run {
    records: Vec<FrameRecord>,
    log: Log,
    built: bool,
}

#[test]
fn a_scene_at_rest_starts_no_builder_and_does_no_geometry_work() {
    for update in [Update::Rebuild, Update::Refit, Update::Async(Pace::Free)] {
        let r = run(1, 5, update, Some(0));
        assert!(!r.built);
        assert_eq!((r.log.interpolated, r.log.refitted), (1, 1), "{update:?}");
        assert_eq!(r.records.len(), 5);
        assert_eq!(r.records[4].tree_age_frames, 4);
        assert_eq!(r.records[4].sah_ratio, Some(1.0));
    }
}

#[test]
fn rebuild_traces_each_frame_with_its_own_tree() {
    for update in [Update::Rebuild, Update::Async(Pace::Lockstep(0))] {
        let r = run(9, 8, update, Some(3));
        assert!(!r.built);
        let own = |f: &FrameRecord| f.tree_age_frames == 0 && f.adopted.is_some();
        assert!(r.records.iter().all(own));
        let generations: Vec<_> = r.records.iter().map(|f| f.tree_generation.0).collect();
        assert_eq!(generations, [1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(r.log.interpolated, 8, "once a frame");
    }
}

#[test]
fn device_rebuild_has_each_frame_make_its_own_tree_and_nobody_builds() {
    let r = run(9, 8, Update::DeviceRebuild, Some(0));
    assert!(!r.built && r.log.adopted.is_empty() && r.log.requested == 0);
    assert_eq!(r.log.made, (1..9).map(Generation).collect::<Vec<_>>());
    assert_eq!(r.log.interpolated, 8);
    let own = |f: &FrameRecord| f.made && f.tree_age_frames == 0 && f.sah_ratio == Some(1.0);
    assert!(r.records.iter().all(own));
    let r = run(1, 5, Update::DeviceRebuild, Some(0));
    assert_eq!((r.log.made.len(), r.log.interpolated), (1, 1));
    assert!(r.records[0].made && !r.records[1].made);
}

#[test]
fn refit_keeps_the_first_tree() {
    let r = run(9, 8, Update::Refit, Some(0));
    assert!(!r.built && r.log.adopted == [Generation(1)]);
    assert_eq!(r.records[7].tree_age_frames, 7);
    assert_eq!(r.log.refitted, 8);
}

#[test]
fn lockstep_swaps_k_frames_after_asking() {
    for k in [1_u64, 3, 7] {
        let r = run(30, 24, Update::Async(Pace::Lockstep(k as u32)), Some(5));
        for (n, f) in (0..).zip(&r.records) {
            // The first frame builds its own tree; the next asks, and so on every k frames.
            let expected = match u64::saturating_sub(n, 1) / k {
                0 => (1, n),
                cycle => (1 + cycle, n - (1 + (cycle - 1) * k)),
            };
            let found = (f.tree_generation.0, f.tree_age_frames);
            assert_eq!(found, expected, "k {k} frame {n}");
        }
    }
}

#[test]
fn a_free_builder_is_heard_and_frames_go_on_while_vertices_are_under_way_for_ever() {
    let r = run(60, 50, Update::Async(Pace::Free), Some(2));
    let generations = r.records.iter().map(|f| f.tree_generation);
    assert!(r.built && generations.is_sorted());
    assert!(r.records[49].tree_generation > Generation(3));
    assert!(r.records.iter().filter(|f| f.adopted.is_some()).count() > 3);
    let r = run(60, 50, Update::Async(Pace::Free), None);
    assert_eq!(r.records.len(), 50);
    assert!(!r.built && r.log.adopted == [Generation(1)]);
}
