//! Tests the library inside the caller's own threads: rayon's, and readers of key frames.

use crate::{demo, hits_at, scene_of};
use abvh::{Camera, CameraPose, Device, Mesh, Point, Query, Ray, Source, Tracer};
use integration::is_full;
use rayon::ThreadPool;
use rayon::prelude::*;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Barrier, Mutex};
use std::thread;
use std::time::Duration;

const TRIANGLE: [Point; 3] = [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 0.0, 1.0]];

/// Returns downward rays that alternately hit and miss the triangle.
fn down(count: usize) -> Vec<Ray> {
    let ray = |i: usize| Ray::new([9.0 * (i % 2) as f32, 9.0, 0.0], [0.0, -1.0, 0.0]);
    (0..count).map(ray).collect()
}

fn tracer_on(device: &Device) -> Tracer {
    let (scene, _) = scene_of([Mesh::streamed(&TRIANGLE, &[[0, 1, 2]]).unwrap()]);
    let builder = Tracer::builder().device(device.clone()).threads(1);
    builder.build(scene).unwrap()
}

/// Traces a step of one ray that hits the triangle. Returns the number of hits.
fn step(tracer: &mut Tracer) -> usize {
    let mut step = tracer.step(0.0);
    let query = step.trace(&down(1), Query::Any).unwrap();
    let done = step.submit().unwrap();
    usize::from(tracer.hits(done, query).unwrap().is_hit(0))
}

fn workers(threads: usize) -> ThreadPool {
    let builder = rayon::ThreadPoolBuilder::new().num_threads(threads);
    builder.build().unwrap()
}

/// Runs `work`, and panics if it does not finish in time.
fn within<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    let (done, result) = channel();
    let thread = thread::spawn(move || done.send(work()));
    match result.recv_timeout(Duration::from_secs(240)) {
        Ok(result) => result,
        Err(RecvTimeoutError::Timeout) => panic!("the work hangs"),
        Err(RecvTimeoutError::Disconnected) => match thread.join() {
            Ok(_) => unreachable!("it sends its result"),
            Err(panic) => resume_unwind(panic),
        },
    }
}

/// Tests rayon tasks that each build, use and drop a tracer.
pub(crate) fn rayon_tasks_own_tracers(device: &Device) {
    let device = device.clone();
    // GPUs take long to open.
    let on_gpu = if is_full() { 6 } else { 3 };
    let count = if device == Device::Cpu { 20 } else { on_gpu };
    let hits = within(move || {
        let each = (0..count).into_par_iter().with_max_len(1);
        workers(2).install(|| each.map(|_| step(&mut tracer_on(&device))).sum::<usize>())
    });
    assert_eq!(hits, count);
}

/// Makes calls that use threads, with meshes large enough to be processed in parallel. `between` runs between most
/// calls, before the first one and after the last one.
fn tour(device: &Device, between: &dyn Fn()) {
    let wide: Vec<Point> = (0..70_000).map(|i| TRIANGLE[i % 3]).collect();
    let wide = |by: f32| wide.iter().map(|p| [p[0], p[1] + by, p[2]]).collect();
    let (low, high): (Vec<Point>, Vec<Point>) = (wide(0.0), wide(1.0));
    let triangles: Vec<[u32; 3]> = (0..200).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let parts = vec![0; low.len()];
    let (read, keys) = ([low.clone(), high.clone()], vec![low.clone(), high.clone()]);
    let read = move |key: usize| Ok::<_, String>(read[key].clone());
    between();
    let sequence = Mesh::sequence(2, 4, read, &triangles).unwrap();
    between();
    let opened = Mesh::open("demo:twist:300").unwrap();
    between();
    let meshes = [
        sequence,
        opened,
        Mesh::streamed(&low, &triangles).unwrap(),
        Mesh::rigid(&low, &triangles, &parts).unwrap(),
        Mesh::keyframes(keys, &triangles).unwrap(),
    ];
    let (scene, [_, _, cloth, robot, keyed]) = scene_of(meshes);
    between();
    let builder = Tracer::builder().device(device.clone()).threads(1);
    let mut tracer = builder.clone().build(scene.clone()).unwrap();
    between();
    tracer.warm_up(0.0).unwrap();
    between();
    let other = Mesh::fixed(&high, &triangles).unwrap();
    let replacement = tracer.replace(keyed, other).unwrap();
    let pose = CameraPose::new([0.0, 9.0, 0.1], [0.0; 3]).with_fov(50.0);
    let camera = Camera::look_at(pose.with_up([0.0, 0.0, 1.0]), [40, 30]).unwrap();
    for time in [0.25, 0.5] {
        let mut step = tracer.step(time);
        between();
        step.vertices(cloth, Source::Host(&high)).unwrap();
        between();
        step.poses(robot, &[[[1.0, 0.0, 0.0, 0.0]; 3]]).unwrap();
        between();
        let query = step.trace(&down(20_000), Query::Closest).unwrap();
        between();
        let picture = step.render(&camera, [1.0, 9.0, 1.0]).unwrap();
        between();
        let done = step.submit().unwrap();
        between();
        assert!(tracer.hits(done, query).unwrap().is_hit(0));
        between();
        tracer.pixels(done, picture, &mut Vec::new()).unwrap();
        between();
    }
    tracer.commit(replacement).unwrap();
    between();
    step(&mut tracer);
    between();
    let mut tracer = builder.build_in_place_of(tracer, scene).unwrap();
    between();
    step(&mut tracer);
    between();
    drop(tracer);
    between();
}

/// Checks that no other task runs when a pool's only worker calls the library.
pub(crate) fn calls_do_not_run_other_tasks(device: &Device) {
    let device = device.clone();
    within(move || {
        let is_inside = Arc::new(AtomicBool::new(true));
        let has_run = Arc::<AtomicBool>::default();
        let between = || {
            let (is_inside, has_run) = (Arc::clone(&is_inside), Arc::clone(&has_run));
            rayon::spawn(move || {
                let ran = is_inside.load(Ordering::Relaxed);
                has_run.fetch_or(ran, Ordering::Relaxed);
            });
        };
        workers(1).install(|| {
            tour(&device, &between);
            is_inside.store(false, Ordering::Relaxed);
        });
        assert!(!has_run.load(Ordering::Relaxed), "another task has run");
    });
}

/// Blocks all workers of the global pool until the returned receiver is dropped.
fn occupy_the_global_pool() -> Receiver<()> {
    let threads = rayon::current_num_threads();
    let (begun, (hold, held)) = (Arc::new(Barrier::new(threads + 1)), channel::<()>());
    let entered = Arc::clone(&begun);
    rayon::spawn_broadcast(move |_| {
        entered.wait();
        while hold.send(()).is_ok() {
            thread::sleep(Duration::from_millis(1));
        }
    });
    begun.wait();
    held
}

/// Tests with a busy global pool. Tasks of that pool may wait for a tracer that is in use, so the library must not wait
/// for the pool.
pub(crate) fn works_with_busy_global_pool(device: &Device) {
    let device = device.clone();
    let held = occupy_the_global_pool();
    within(move || tour(&device, &|| ()));
    drop(held);
}

/// Tests key-frame readers that trace rays, on the tested device and on the host.
pub(crate) fn key_frame_readers_may_trace(device: &Device) {
    let demo = Arc::new(demo("demo:collide:300"));
    let (keys, shared) = (Arc::clone(&demo), Arc::new(Mutex::new(tracer_on(device))));
    let other = Mutex::new(tracer_on(&Device::Cpu));
    let read = move |key: usize| {
        let hits = step(&mut shared.lock().unwrap()) + step(&mut other.lock().unwrap());
        match hits {
            2 => Ok(keys.keys[key].clone()),
            _ => Err("the reader's ray misses"),
        }
    };
    let device = device.clone();
    within(move || {
        let mesh = Mesh::sequence(demo.keys.len(), 4, read, &demo.triangles).unwrap();
        let held = Mesh::keyframes(demo.keys.clone(), &demo.triangles).unwrap();
        let build = |mesh| {
            let builder = Tracer::builder().device(device.clone()).threads(1);
            builder.build(scene_of([mesh]).0).unwrap()
        };
        let (mut read, mut held) = (build(mesh), build(held));
        for key in (0..demo.keys.len()).step_by(3) {
            let time = key as f64 + 0.5;
            let [found, expected] = [&mut read, &mut held].map(|t| hits_at(t, time, &demo.rays));
            assert!(found == expected, "at {time}");
        }
    });
}

/// Checks that a panic of a reader is reported as an error, for either key frame.
pub(crate) fn key_frame_reader_panic_is_reported(_: &Device) {
    for bad in [0, 1] {
        let read = move |key: usize| match key == bad {
            true => panic!("planted"),
            false => Ok::<_, String>(TRIANGLE.to_vec()),
        };
        let made = Mesh::sequence(2, 4, read, &[[0, 1, 2]]);
        let said = made.and_then(|mesh| {
            let (mut scene, _) = scene_of([mesh]);
            scene.add(Mesh::fixed(&TRIANGLE, &[[0, 1, 2]])?);
            Tracer::builder().device(Device::Cpu).build(scene)
        });
        let said = said.map(drop).unwrap_err();
        assert_eq!(
            said,
            abvh::Error::KeyFrame(format!("key frame {bad}: its reader panicked"))
        );
    }
}
