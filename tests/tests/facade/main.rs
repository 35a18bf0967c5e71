//! Tests the library `abvh` on every device. Hits depend only on vertex positions, not on how these were supplied.
//!
//! Tests of an absent device show as ignored. `ABVH_REQUIRE_BACKENDS` makes them fail instead, as in `backends.rs`.

mod frames;
#[cfg(target_os = "linux")]
mod memory;
mod pictures;
mod pool;
mod replace;
mod results;
mod rigid;
mod runtimes;

use abvh::{
    Device, Error, Hit, Hits, Mesh, MeshId, Point, Query, Ray, Rays, Replacement, Scene, Source,
    Step, Tracer, Update,
};
use geom::Animation;
use integration::stage::{picture_rays, vast_camera};
use integration::{device_trial, is_full, named};
use pool::{Pooled, tracer};
use std::sync::Arc;

type Test = (&'static str, fn(&Device));

/// Tests of every device.
const TESTS: &[Test] = named![
    streamed_steps_match_key_frames,
    unmoved_meshes_keep_their_positions,
    long_lists_match_separate_queries,
    pictures::batched_cameras_match_separate_steps,
    rigid::rigid_meshes_equal_transformed_vertices,
    pictures::pictures_match_host_bytes,
    pictures::pictures_match_host_at_any_scale,
    pictures::meshes_keep_their_colours,
    pictures::odd_pictures_do_not_panic,
    frames::frames_match_step_pictures,
    frames::paged_key_frames_match_resident_ones,
    frames::unreadable_key_frames_are_errors,
    frames::update_policies_do_not_change_hits,
    misuse_is_an_error,
    replace::replaced_mesh_matches_new_scene,
    replace::replacement_may_change_motion_kind,
    replace::results_survive_steps_and_commits,
    replace::dropped_replacements_change_nothing,
    replace::supports_two_concurrent_replacements,
    replace::invalid_replacements_are_errors,
    runtimes::rayon_tasks_own_tracers,
    runtimes::calls_do_not_run_other_tasks,
    runtimes::works_with_busy_global_pool,
    runtimes::key_frame_readers_may_trace,
    results::held_results_survive_later_steps,
    results::dropped_steps_have_no_effect,
    results::refused_queries_change_nothing,
    results::results_can_be_polled,
];

/// Tests of one device only.
const OWN: &[(&str, &[Test])] = &[
    (
        "cpu",
        named![
            frames::traces_on_a_caller_backend,
            replace::replaces_meshes_after_build_in_place,
            runtimes::key_frame_reader_panic_is_reported,
        ],
    ),
    #[cfg(target_os = "linux")]
    ("cpu", named![memory::scene_beyond_memory_is_refused]),
    ("wgpu", named![replace::replaces_meshes_on_caller_device]),
];

/// Types that can be sent to other threads or shared between them.
const _: () = {
    const fn is_send<T: Send>() {}
    is_send::<(Tracer, Replacement, Scene, Mesh, Device, Error)>();
    const fn is_shared<T: Sync>() {}
    is_shared::<(Tracer, Hits)>();
};

fn main() {
    #[cfg(target_os = "linux")]
    memory::child();
    let mut trials = Vec::new();
    for (name, device, absent) in integration::devices() {
        let own = OWN.iter().filter(|(of, _)| *of == name);
        for &(property, check) in TESTS.iter().chain(own.flat_map(|(_, tests)| *tests)) {
            let (device, full_name) = (device.clone(), format!("{name}::{property}"));
            trials.push(device_trial(full_name, name, absent.clone(), move || {
                check(&device);
            }));
        }
    }
    let conclusion = libtest_mimic::run(&integration::arguments(), trials);
    pool::close();
    conclusion.exit();
}

/// A demo: its key frames, its triangles and a picture's rays.
struct Demo {
    animation: Arc<Animation>,
    keys: Vec<Vec<Point>>,
    triangles: Vec<[u32; 3]>,
    rays: Vec<Ray>,
}

fn demo(name: &str) -> Demo {
    let scene = scene::open(name, &scene::SceneOptions::default()).unwrap();
    let animation = scene.animation;
    let keys = animation.all_keys().unwrap();
    Demo {
        keys: keys.iter().map(|key| key.to_vec()).collect(),
        triangles: animation.triangles().to_vec(),
        rays: picture_rays(&animation),
        animation,
    }
}

/// All hits of a query: mesh, triangle, and bits of `t`, `u` and `v`.
type Found = Vec<[u32; 5]>;

fn bits(hits: Hits) -> Found {
    let hit = |hit: Hit| {
        let [t, u, v] = [hit.t, hit.u, hit.v].map(f32::to_bits);
        [hit.mesh.index() as u32, hit.triangle, t, u, v]
    };
    let rays = 0..hits.len();
    rays.map(|ray| hits.closest(ray).map_or([u32::MAX; 5], hit))
        .collect()
}

fn scene_of<const N: usize>(meshes: [Mesh; N]) -> (Scene, [MeshId; N]) {
    let mut scene = Scene::new();
    let ids = meshes.map(|mesh| scene.add(mesh));
    (scene, ids)
}

/// Traces rays in a step, after the updates that `update` makes.
fn hits_after(
    tracer: &mut Tracer,
    time: f64,
    rays: &[Ray],
    update: impl FnOnce(&mut Step<'_>) -> abvh::Result<()>,
) -> Found {
    let mut step = tracer.step(time);
    update(&mut step).unwrap();
    let query = step.trace(rays, Query::Closest).unwrap();
    let done = step.submit().unwrap();
    bits(tracer.hits(done, query).unwrap())
}

/// Traces rays in a step without updates.
fn hits_at(tracer: &mut Tracer, time: f64, rays: &[Ray]) -> Found {
    hits_after(tracer, time, rays, |_| Ok(()))
}

fn of_keys(demo: &Demo, device: &Device) -> Pooled {
    let mesh = Mesh::keyframes(demo.keys.clone(), &demo.triangles).unwrap();
    tracer(scene_of([mesh]).0, device)
}

/// Key frames and positions to which a vertex jumps.
const LEAPS: [(usize, Point); 4] = [
    (3, [1e30, 0.0, 0.0]),
    (6, [f32::NAN; 3]),
    (9, [-1e30, 1e30, 0.0]),
    (12, [f32::NEG_INFINITY, 0.0, 1.0]),
];

fn streamed_steps_match_key_frames(device: &Device) {
    for (name, update) in [
        ("demo:collide:3000", Update::Async),
        ("demo:twist:2000", Update::Rebuild),
        ("demo:shatter:2000", Update::Refit),
        ("demo:twist:1000", Update::DeviceRebuild),
    ] {
        if (update, device) == (Update::DeviceRebuild, &Device::Cpu) {
            let refused = Tracer::builder().device(Device::Cpu).update(update);
            let refused = refused.build(Scene::new());
            assert!(matches!(refused, Err(Error::Unsupported(_))), "{refused:?}");
            continue;
        }
        let mut demo = demo(name);
        if update == Update::Async {
            for (key, place) in LEAPS {
                demo.keys[key][7] = place;
            }
        }
        let mut keyed = of_keys(&demo, device);
        let mesh = Mesh::streamed(&demo.keys[0], &demo.triangles).unwrap();
        let (scene, [mesh]) = scene_of([mesh]);
        let mut live = pool::build(Tracer::builder().update(update), scene, device);
        let (mut met, mut built) = (0, false);
        // Plays forwards and backwards, with jumps.
        let (keys, stride) = (demo.keys.len(), if is_full() { 1 } else { 3 });
        let there = (0..keys).step_by(stride);
        let back = there.clone().rev();
        for key in there.chain([0, keys - 1, 1]).chain(back) {
            let (mut step, vertices) = (live.step(0.0), &demo.keys[key]);
            let moved = match key % 2 {
                0 => step.vertices(mesh, Source::Host(vertices)),
                _ => (step.vertices_mut(mesh)).map(|to| to.copy_from_slice(vertices)),
            };
            moved.unwrap();
            let near = step.trace(&demo.rays, Query::Closest).unwrap();
            let any = step.trace(&demo.rays, Query::Any).unwrap();
            let done = step.submit().unwrap();
            let expected = hits_at(&mut keyed, key as f64, &demo.rays);
            let found = bits(live.hits(done, near).unwrap());
            assert!(found == expected, "{name} at {key}");
            let is_absent = !vertices[7].iter().all(|x| x.is_finite());
            let counted = live.statistics().unwrap().inactive > 0;
            assert_eq!(counted, is_absent, "{name} at {key}");
            let found = live.hits(done, any).unwrap();
            for (ray, hit) in expected.iter().enumerate() {
                let is_hit = hit[0] != u32::MAX;
                assert_eq!(found.is_hit(ray), is_hit, "{name} at {key}: ray {ray}");
                met += usize::from(is_hit);
            }
            built |= live.statistics().unwrap().building;
        }
        assert!(met > 1000, "{name}: {met}");
        let trees = live.statistics().unwrap().generation;
        let is_rebuilt = matches!(update, Update::Rebuild | Update::DeviceRebuild);
        assert!(trees > if is_rebuilt { 8 } else { 0 }, "{name}: {trees}");
        // A tree that a step waits for is adopted by the same step.
        assert_eq!(built, update == Update::Async, "{name}");
    }
}

/// Tests a static mesh and two streamed meshes. Each step moves at most one mesh.
fn unmoved_meshes_keep_their_positions(device: &Device) {
    let demo = demo("demo:twist:2000");
    let lifted = |key: usize, by: f32| -> Vec<Point> {
        let vertices = demo.keys[key].iter();
        vertices.map(|p| [p[0], p[1], p[2] + by]).collect()
    };
    let fixed = |vertices: &[Point]| Mesh::fixed(vertices, &demo.triangles).unwrap();
    let mesh = |vertices: &[Point]| Mesh::streamed(vertices, &demo.triangles).unwrap();
    let (ground, mut places) = (lifted(0, -0.4), [lifted(0, 0.2), lifted(0, 0.0)]);
    let meshes = [fixed(&ground), mesh(&places[0]), mesh(&places[1])];
    let (scene, [_, ids @ ..]) = scene_of(meshes);
    let mut live = tracer(scene, device);
    for step in 0..12 {
        let moved = step % 3;
        if moved < 2 {
            places[moved] = lifted(step % demo.keys.len(), 0.05 * step as f32);
        }
        let found = hits_after(&mut live, 0.0, &demo.rays, |step| match moved {
            2 => Ok(()),
            _ => step.vertices(ids[moved], Source::Host(&places[moved])),
        });
        let (scene, _) = scene_of([&ground, &places[0], &places[1]].map(|all| fixed(all)));
        let expected = hits_at(&mut tracer(scene, device), 0.0, &demo.rays);
        assert!(found == expected, "step {step}");
    }
}

/// Tests a list whose hits GPUs read back in several parts. wgpu also uploads it in parts. Most of its rays cannot hit
/// anything.
fn long_lists_match_separate_queries(device: &Device) {
    let demo = demo("demo:collide:3000");
    let mut live = of_keys(&demo, device);
    let mut rays = vec![Ray::new([0.0; 3], [0.0; 3]); 1_100_000];
    let starts = [0, 400_000, rays.len() - demo.rays.len()];
    for start in starts {
        rays[start..][..demo.rays.len()].copy_from_slice(&demo.rays);
    }
    let alone = hits_at(&mut live, 0.5, &demo.rays);
    let together = hits_at(&mut live, 0.5, &rays);
    for start in starts {
        assert!(together[start..][..alone.len()] == alone, "from {start} on");
    }
}

fn misuse_is_an_error(device: &Device) {
    let (points, triangle) = ([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]]);
    let made = [
        Mesh::fixed(&points, &triangle),
        Mesh::streamed(&points, &triangle),
        Mesh::rigid(&points, &triangle, &[0, 0, 3]),
    ];
    let meshes = made.map(Result::unwrap);
    let (_, [foreign, ..]) = scene_of(meshes.clone());
    let (scene, [fixed, cloth, robot]) = scene_of(meshes.clone());
    // A mesh that is added to a clone does not belong to the original.
    let later = scene.clone().add(meshes[0].clone());
    let builder = Tracer::builder().device(device.clone());
    let crowd = builder.builder_threads(usize::MAX).build(scene.clone());
    assert!(matches!(crowd.map(drop), Err(Error::Unsupported(_))));
    let mut other = tracer(scene.clone(), device);
    let mut tracer = tracer(scene, device);
    tracer.warm_up(f64::NAN).unwrap();
    let mut step = tracer.step(f64::NAN);
    let host = Source::Host(&points);
    let count = |mesh, what, expected, found| Error::Count {
        mesh,
        what,
        expected,
        found,
    };
    for foreign in [foreign, later] {
        let refused = Err(Error::ForeignMesh(foreign));
        assert_eq!(step.vertices(foreign, host), refused);
    }
    for mesh in [fixed, robot] {
        let what = "vertices";
        assert_eq!(step.vertices(mesh, host), Err(Error::Motion { mesh, what }));
    }
    let few = step.vertices(cloth, Source::Host(&points[1..]));
    assert_eq!(few, Err(count(cloth, "vertices", 3, 2)));
    assert_eq!(step.poses(robot, &[]), Err(count(robot, "matrices", 4, 0)));
    // There may be further matrices, for parts without vertices.
    step.poses(robot, &[[[0.0; 4]; 3]; 6]).unwrap();
    // A failed query has not started tracing, so updates are still accepted.
    assert!(step.trace(Rays::OnDevice(1), Query::Any).is_err());
    assert_eq!(step.vertices(cloth, host), Ok(()));
    let query = step.trace(&[], Query::Any).unwrap();
    assert_eq!(step.vertices(cloth, host), Err(Error::TooLate));
    let done = step.submit().unwrap();
    assert!(tracer.hits(done, query).unwrap().is_empty());
    let mut step = other.step(0.0);
    step.trace(&[], Query::Any).unwrap();
    step.submit().unwrap();
    let found = other.hits(done, query);
    assert!(matches!(found.map(drop), Err(Error::NoResult)));
    let mut step = tracer.step(0.0);
    let traced = step.trace(&vast_camera(), Query::Closest);
    let vast = traced.and_then(|_| step.submit());
    assert!(matches!(
        vast,
        Err(Error::Unsupported(_) | Error::OutOfMemory(_))
    ));
    let on_device = tracer.step(0.0).trace(Rays::OnDevice(1), Query::Any);
    assert!(on_device.is_err() || *device != Device::Cpu);
    tracer.step(0.0).trace(&[], Query::Any).unwrap();
    for made in [
        Mesh::fixed(&points, &[[0, 1, 3]]),
        Mesh::keyframes(Vec::new(), &[]),
        Mesh::keyframes(vec![points.to_vec(), Vec::new()], &[]),
        Mesh::rigid(&points, &triangle, &[0]),
    ] {
        assert!(matches!(made, Err(Error::Mesh(_))), "{made:?}");
    }
}
