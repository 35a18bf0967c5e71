//! Tests timing, memory, refused queries, scenes on a shared device, and dropping a backend.

use crate::Subject;
use crate::scenes::{
    SHADOWED, bits, camera, interpolate_and_refit, look, open, rays, report, submit_trace, swarm,
    trace, tree_at, wait_for_positions,
};
use backend::{Backend, BackendError, Generation, Hits, Intersector, Query, QueryKind, Rays};
use geom::{Animation, Camera};
use std::sync::Arc;
use std::thread;
use std::time::Instant;

/// Requires a device with timestamps.
pub(crate) fn stages_are_timed_in_milliseconds(backend: &mut dyn Subject) {
    let (animation, camera) = (swarm(2000), camera());
    let mut device_ms = 0.0;
    let since = Instant::now();
    open(backend, &animation);
    let tickets = [0.0, 0.3, 0.6].map(|time| {
        interpolate_and_refit(backend, &animation, time);
        submit_trace(backend, Rays::Camera(&camera), SHADOWED)
    });
    for ticket in tickets {
        let times = backend.wait(ticket).unwrap().times;
        let stages = [times.preprocess_ms, times.refit_ms, times.trace_primary_ms];
        assert_eq!(times.interpolate_ms, None, "it ran beside preprocess");
        assert_eq!(times.trace_shadow_ms, None, "both are traced together");
        let sum: f64 = stages.iter().map(|t| t.unwrap()).sum();
        assert!(sum > 0.0 && sum <= times.device_ms * 1.0001, "{times:?}");
        device_ms += times.device_ms * 0.999_999;
    }
    let wall_ms = since.elapsed().as_secs_f64() * 1e3;
    assert!(device_ms <= wall_ms, "{device_ms} {wall_ms}");
    // This submission has no stages.
    assert_eq!(report(backend).times.refit_ms, None);
}

/// Checks the memory of a scene of 20,000 triangles, that it is freed with the scene, and the memory of a trace.
pub(crate) fn device_memory_is_counted_and_freed(backend: &mut dyn Subject) {
    let (large, small) = (swarm(20_000), swarm(20));
    let mut bytes = |animation| {
        open(backend, animation);
        interpolate_and_refit(backend, animation, 0.5);
        backend.request_positions().unwrap();
        backend.submit().unwrap();
        let bytes = backend.memory().held.unwrap();
        // Inspection allocates memory in proportion to the scene, which must be freed, too.
        backend.boxes().unwrap();
        bytes
    };
    let [before, with, after] = [&small, &large, &small].map(&mut bytes);
    // Per triangle: 36 bytes in each of three key frames and two position buffers, and 12 of vertex indices.
    // Per leaf: 48 bytes of the record and 12 of vertex indices. Nodes and topology depend on the tree.
    let scene = 20_000 * (5 * 36 + 12);
    let topology = tree_at(&large, 0.0);
    let treelets = topology.treelets().unwrap();
    let tree = large.live_count() * (48 + 12) + 16 * treelets.rows() + treelets.bytes();
    let tree = tree as u64;
    for (bytes, least) in [(with.scene, scene), (with.tree, tree)] {
        let about = bytes >= least && bytes < least + least / 10;
        assert!(about, "{with:?}: {bytes} of {least}");
    }
    // The staging memory of a topology takes less than 10 bytes per triangle.
    assert!(with.scratch < 20_000 * 10, "{with:?}");
    assert!(before.total() < 1 << 20, "{before:?}");
    assert_eq!((after.scene, after.tree), (before.scene, before.tree));
    assert!(after.frames < before.frames + (1 << 18), "{after:?}");
    let frames = backend.memory().held.unwrap().frames;
    submit_trace(backend, Rays::Camera(&camera()), SHADOWED);
    let grown = backend.memory().held.unwrap().frames - frames;
    let least = 20 * camera().pixels() as u64;
    // Drivers round up the size of both buffers, NVIDIA's to 64 or 128 bytes.
    assert!((least..least + 2 * 128).contains(&grown), "{grown}");
}

pub(crate) fn steady_frames_create_no_buffers(backend: &mut dyn Subject) {
    let (animation, camera) = (swarm(1000), camera());
    let trees = [0.0, 0.7, 1.5].map(|time| tree_at(&animation, time));
    open(backend, &animation);
    let mut made = 0;
    for frame in 0..30_u64 {
        if frame % 3 == 1 {
            let tree = &trees[frame as usize / 3 % 3];
            backend.adopt(tree, Generation(2 + frame)).unwrap();
        }
        interpolate_and_refit(backend, &animation, 0.06 * frame as f64);
        if frame % 3 == 0 {
            backend.request_positions().unwrap();
        }
        let found = trace(backend, Rays::Camera(&camera), SHADOWED);
        assert!(found.closest.iter().any(|h| h.is_hit()));
        if frame % 3 == 0 {
            wait_for_positions(backend);
        }
        if frame == 9 {
            made = backend.buffers_made();
        }
    }
    assert_eq!(backend.buffers_made(), made);
}

pub(crate) fn too_large_query_is_refused(backend: &mut dyn Subject) {
    let animation = swarm(50);
    open(backend, &animation);
    interpolate_and_refit(backend, &animation, 0.5);
    let square = |side| look([0.3, 0.2, 3.0], [0.0; 3], (50.0, [side, side]));
    let kind = QueryKind::Closest;
    let mut limit_met = |camera: &Camera| {
        let rays = Rays::Camera(camera);
        match backend.trace(&[Query { rays, kind }]) {
            Err(BackendError::Limit { need, limit, .. }) if need > limit => limit,
            other => panic!("{other:?}"),
        }
    };
    let limit = limit_met(&square(60_000));
    // Hits take 16 bytes per pixel.
    let camera = square(((limit / 16) as f64).sqrt() as u32 + 1);
    assert_eq!(limit_met(&camera), limit);
    let rays_of = Rays::Camera(&camera);
    let found = trace(backend, Rays::List(&rays(8)), kind);
    assert_eq!(found.closest.len(), 8);
    // Queries that were recorded together with it are discarded, too.
    let few = rays(5);
    let queries = [Rays::List(&few), rays_of].map(|rays| Query { rays, kind });
    let refused = backend.trace(&queries);
    assert!(matches!(refused, Err(BackendError::Limit { .. })));
    let again = trace(backend, Rays::List(&rays(8)), kind);
    assert_eq!(again, found);
}

/// Checks that the query after a refused one has the same hits, whether or not the host has computed the range of the
/// coordinates at that time.
pub(crate) fn range_is_measured_after_refused_query(backend: &mut dyn Subject) {
    let scene = swarm(50);
    let mut far = scene.first().to_vec();
    far[7] = [1e30, 0.0, 0.0];
    let found = [false, true].map(|is_known| {
        let marks = vec![false; far.len()];
        let triangles = scene.triangles().to_vec();
        let live = Animation::streamed(scene.first().to_vec(), &marks, triangles);
        let live = Arc::new(live.unwrap());
        open(backend, &live);
        let time = live.push(far.clone()).unwrap();
        if is_known {
            live.range(live.pose(time));
        }
        interpolate_and_refit(backend, &live, time);
        // More workgroups in one dimension than most devices support.
        let wide = look([0.3, 0.2, 3.0], [0.0; 3], (50.0, [1_100_000, 1]));
        let (rays_of, kind) = (Rays::Camera(&wide), QueryKind::Closest);
        let asked = backend.trace(&[Query {
            rays: rays_of,
            kind,
        }]);
        if asked.is_ok() {
            report(backend);
        }
        trace(backend, Rays::List(&rays(200)), kind)
    });
    assert!(found[0] == found[1]);
}

type Bits = [Option<u32>; 3];

/// Returns the hits and positions of consecutive frames, with a new tree in each third frame.
fn play(backend: &mut dyn Backend, animation: &Arc<Animation>) -> Vec<(Hits, Vec<Bits>)> {
    open(backend, animation);
    let frames = (0..6).map(|round| {
        let time = 0.19 * round as f64;
        if round % 3 == 2 {
            let tree = tree_at(animation, time);
            backend.adopt(&tree, Generation(round)).unwrap();
        }
        interpolate_and_refit(backend, animation, time);
        backend.request_positions().unwrap();
        let seen = trace(backend, Rays::Camera(&camera()), SHADOWED);
        (seen, bits(&wait_for_positions(backend).1))
    });
    frames.collect()
}

/// Checks that other scenes on the device change nothing while they are loaded, traced and dropped.
pub(crate) fn scenes_share_a_device_concurrently(backend: &mut dyn Subject) {
    let scenes = [2000, 3000].map(swarm);
    let alone = scenes.each_ref().map(|scene| play(backend, scene));
    let mut others = [0, 1].map(|_| backend.share_device());
    let [first, second] = &mut others;
    thread::scope(|scope| {
        for (other, which) in [(first, 0), (second, 1)] {
            let (scene, alone) = (&scenes[which], &alone[which]);
            scope.spawn(move || {
                for _ in 0..2 {
                    assert!(play(&mut **other, scene) == *alone, "beside, {which}");
                    *other = other.share_device();
                }
            });
        }
        for _ in 0..3 {
            assert!(play(backend, &scenes[0]) == alone[0]);
        }
    });
    drop(others);
    assert!(play(backend, &scenes[1]) == alone[1]);
}

pub(crate) fn snapshot_outlives_the_backend(mut backend: Box<dyn Subject>) {
    let animation = swarm(100);
    open(&mut *backend, &animation);
    interpolate_and_refit(&mut *backend, &animation, 0.25);
    backend.request_positions().unwrap();
    assert_eq!(report(&mut *backend).readback_bytes, 100 * 36);
    let (_, snapshot) = wait_for_positions(&mut *backend);
    let expected = bits(&backend.positions().unwrap());
    drop(backend);
    // The snapshot is dropped last, on a thread that then ends. This closes the device.
    let elsewhere = std::thread::spawn(move || bits(&snapshot));
    assert!(elsewhere.join().unwrap() == expected);
}

pub(crate) fn dropping_a_busy_backend_is_safe(mut backend: Box<dyn Subject>) {
    let subject: &mut dyn Backend = &mut *backend;
    let animation = swarm(2000);
    open(subject, &animation);
    interpolate_and_refit(subject, &animation, 0.5);
    subject.request_positions().unwrap();
    submit_trace(subject, Rays::Camera(&camera()), SHADOWED);
    let tree = tree_at(&animation, 0.5);
    subject.adopt(&tree, Generation(2)).unwrap();
    interpolate_and_refit(subject, &animation, 0.6);
    subject.request_positions().unwrap();
}

/// Checks that the device holds only few key frames, in any order of playback. The property
/// `paged_key_frames_have_the_positions_of_held_ones` of `conformance` checks the positions.
pub(crate) fn only_few_paged_key_frames_are_on_the_device(backend: &mut dyn Subject) {
    let options = scene::SceneOptions {
        key_bytes: 0,
        ..scene::SceneOptions::default()
    };
    let scene = scene::open("demo:twist:3000", &options).unwrap();
    let paged = scene.animation;
    assert_eq!(paged.window(), Some(8));
    let intersector = Intersector::Watertight;
    backend.load(Arc::clone(&paged), intersector).unwrap();
    let times: Vec<f64> = (0..46).map(|i| f64::from(i * 7919 % 230) * 0.1).collect();
    for (i, &time) in times.iter().enumerate() {
        paged.look_ahead(times[i..].iter().copied());
        backend.interpolate(paged.pose(time)).unwrap();
        backend.submit().unwrap();
    }
    let scene = backend.memory().held.unwrap().scene;
    let keys = scene / (12 * paged.vertex_count() as u64);
    assert!(keys < 8 + 2 + 3, "memory for {keys} times all vertices");
}

pub(crate) fn shading_requires_a_palette(backend: &mut dyn Subject) {
    let (animation, camera) = (swarm(50), camera());
    open(backend, &animation);
    interpolate_and_refit(backend, &animation, 0.0);
    let query = Query {
        rays: Rays::Camera(&camera),
        kind: SHADOWED,
    };
    backend.trace(&[query]).unwrap();
    let ticket = backend.submit().unwrap();
    assert!(!backend.pixels(ticket, &mut vec![1]).unwrap());
}
