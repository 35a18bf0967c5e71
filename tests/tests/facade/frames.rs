//! Tests frames of an animation, and key frames that are read during playback.

use crate::pictures::{Shown, lit, shown};
use crate::pool::{self, Pooled};
use crate::{Demo, demo, hits_after, hits_at, of_keys, scene_of};
use abvh::frames::{Frame, OutputSelection};
use abvh::{Device, Error, Mesh, Point, Query, Ray, Source, Tracer, Update};
use integration::is_full;
use integration::stage::{camera, colours, host};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Times in both directions, between key frames, repeated, and arbitrarily far beyond both ends.
const TIMES: [f64; 12] = [
    0.0,
    0.5,
    f64::INFINITY,
    f64::NEG_INFINITY,
    1.25,
    1.25,
    7.0,
    2.5,
    -1.0,
    1e9,
    f64::MIN,
    f64::MAX,
];

/// Creates a mesh whose key frames are read on demand from a demo.
fn sequence(demo: &Demo) -> Mesh {
    let (keys, read) = (demo.keys.len(), demo.keys.clone());
    let read = move |key: usize| Ok::<_, Error>(read[key].clone());
    let mesh = Mesh::sequence(keys, 4, read, &demo.triangles).unwrap();
    mesh.with_colours(&colours(demo.triangles.len())).unwrap()
}

/// Returns a triangle at `height`, for a mesh that moves up and down.
fn triangle_at(height: f32) -> [Point; 3] {
    [[-0.5, -0.5], [0.5, -0.5], [0.0, 0.5]].map(|[x, z]| [x, height, z])
}

/// Compares frames with steps, with and without a mesh that steps move. Also tests frames after a run ended early.
pub(crate) fn frames_match_step_pictures(device: &Device) {
    let demo = demo("demo:twist:2000");
    let camera = camera(&demo.animation, [40, 30]);
    let view = lit(&camera);
    let wanted = OutputSelection {
        hits: true,
        pixels: true,
    };
    let frames = (0..).zip(TIMES);
    let all = frames.map(|(i, time)| Frame {
        index: 100 - i,
        time,
    });
    let all: Vec<Frame> = all.collect();
    for is_alone in [true, false] {
        let (mut scene, _) = scene_of([sequence(&demo)]);
        let moved = Mesh::streamed(&triangle_at(0.0), &[[0, 1, 2]]).unwrap();
        let moved = (!is_alone).then(|| scene.add(moved));
        let mut tracer = pool::tracer(scene, device);
        if let Some(streamed_id) = moved {
            let mut step = tracer.step(0.0);
            step.vertices(streamed_id, Source::Host(&triangle_at(0.4)))
                .unwrap();
            step.submit().unwrap();
        }
        let expected = TIMES.map(|time| shown(&mut tracer, time, view));
        assert!(expected[0] != expected[1]);
        let mut step = tracer.step(0.0);
        let query = step.trace(&demo.rays, Query::Closest).unwrap();
        let before = step.submit().unwrap();
        let is_prepared = tracer.prepare_frames(view, wanted);
        assert_eq!(is_prepared, Ok(*device != Device::Cpu));
        for most in [3, TIMES.len()] {
            let mut found = Vec::new();
            let no_device = Err(Error::NoDevice("enough".to_owned()));
            let ended = tracer.render_frames(&all, view, wanted, |record, answers| {
                assert_eq!(record.frame, all[found.len()]);
                let hit = answers.hits.closest.iter().map(|hit| hit.triangle);
                found.push(Shown {
                    rgba: std::mem::take(&mut answers.pixels),
                    triangles: hit.collect(),
                    blocked: answers.hits.blocked.clone(),
                });
                match found.len() {
                    count if count == most => no_device.clone(),
                    _ => Ok(()),
                }
            });
            assert_eq!(ended, no_device);
            assert!(found == expected[..most], "alone: {is_alone}");
            assert!(shown(&mut tracer, TIMES[1], view) == expected[1]);
        }
        let dropped = tracer.hits(before, query).err();
        assert_eq!(dropped, Some(Error::NoResult));
    }
}

/// Tests key frames that are read, alone and with another mesh, which is replaced.
pub(crate) fn paged_key_frames_match_resident_ones(device: &Device) {
    let demo = demo("demo:collide:3000");
    let mut held = of_keys(&demo, device);
    let mut alone = pool::tracer(scene_of([sequence(&demo)]).0, device);
    let far = |y: f32| Mesh::fixed(&triangle_at(y), &[[0, 1, 2]]).unwrap();
    let (scene, [_, other]) = scene_of([sequence(&demo), far(-900.0)]);
    let mut beside = pool::tracer(scene, device);
    for (i, time) in TIMES.into_iter().enumerate() {
        let expected = hits_at(&mut held, time, &demo.rays);
        assert!(hits_at(&mut alone, time, &demo.rays) == expected, "{time}");
        assert!(hits_at(&mut beside, time, &demo.rays) == expected, "{time}");
        if i == 3 {
            let replacement = beside.replace(other, far(-800.0)).unwrap();
            beside.commit(replacement).unwrap();
        }
    }
}

/// Creates a mesh whose key frames after `last` cannot be read while `fails` is set.
fn unreliable(demo: &Demo, last: usize, fails: &Arc<AtomicBool>) -> Mesh {
    let (keys, fails) = (demo.keys.clone(), Arc::clone(fails));
    let read = move |key: usize| {
        if key > last && fails.load(Ordering::Relaxed) {
            return Err(format!("key frame {key} is gone"));
        }
        Ok(keys[key].clone())
    };
    Mesh::sequence(demo.keys.len(), 4, read, &demo.triangles).unwrap()
}

/// Checks that a tracer recovers when an unreadable key frame becomes readable again.
fn fail_and_go_on(demo: &Demo, mut tracer: Pooled, fails: &AtomicBool, device: &Device) {
    let first = hits_at(&mut tracer, 0.0, &demo.rays);
    fails.store(true, Ordering::Relaxed);
    for _ in 0..2 {
        let said = tracer.step(12.0).trace(&demo.rays, Query::Closest);
        let why = said.unwrap_err();
        let is_named = matches!(&why, Error::KeyFrame(why) if why.contains("is gone"));
        assert!(is_named, "{why:?}");
    }
    assert!(hits_at(&mut tracer, 0.0, &demo.rays) == first);
    let again = tracer.step(12.0).trace(&demo.rays, Query::Closest);
    assert!(again.is_err());
    fails.store(false, Ordering::Relaxed);
    let expected = hits_at(&mut of_keys(demo, device), 12.0, &demo.rays);
    assert!(hits_at(&mut tracer, 12.0, &demo.rays) == expected);
}

/// Tests a reader that fails, or that returns fewer vertices than before.
pub(crate) fn unreadable_key_frames_are_errors(device: &Device) {
    let demo = demo("demo:collide:300");
    for is_alone in [true, false] {
        let fails = Arc::new(AtomicBool::new(false));
        let (mut scene, _) = scene_of([unreliable(&demo, 8, &fails)]);
        if !is_alone {
            scene.add(Mesh::fixed(&triangle_at(-900.0), &[[0, 1, 2]]).unwrap());
        }
        fail_and_go_on(&demo, pool::tracer(scene, device), &fails, device);
    }
    // The first tree is built for later times, but this frame needs only the first key frame.
    let fails = Arc::new(AtomicBool::new(false));
    let mut tracer = pool::tracer(scene_of([unreliable(&demo, 0, &fails)]).0, device);
    fails.store(true, Ordering::Relaxed);
    let traced = tracer.step(0.0).trace(&demo.rays, Query::Closest);
    assert!(traced.is_ok(), "{traced:?}");
    let shrinks = |key: usize| Ok::<_, Error>(vec![[0.0; 3]; 5 - key]);
    let none = |_: usize| Err::<Vec<Point>, _>("nothing there");
    let made = [
        Mesh::sequence(3, 4, shrinks, &[]),
        Mesh::sequence(1, 4, none, &[]),
    ];
    for made in made {
        assert!(matches!(made, Err(Error::KeyFrame(_))), "{made:?}");
    }
    for (keys, triangles) in [(0, [0, 1, 2]), (1, [0, 1, 5])] {
        let made = Mesh::sequence(keys, 4, shrinks, &[triangles]);
        assert!(matches!(made, Err(Error::Mesh(_))), "{made:?}");
    }
}

/// Checks that no update policy with trees from the host changes a hit, for any time range. Nothing moves beyond the
/// ends of the animation.
pub(crate) fn update_policies_do_not_change_hits(device: &Device) {
    let demo = demo("demo:twist:2000");
    let camera = camera(&demo.animation, [40, 30]);
    let view = lit(&camera);
    // Wrong boxes or a wrong time would change most hits, so a few rays suffice.
    let stride = if is_full() { 1 } else { 7 };
    let rays: Vec<Ray> = demo.rays.iter().copied().step_by(stride).collect();
    let mut usual = of_keys(&demo, device);
    let within = TIMES.map(|time| time.clamp(0.0, demo.animation.end()));
    let expected = within.map(|time| hits_at(&mut usual, time, &rays));
    let pictures = within.map(|time| shown(&mut usual, time, view));
    for update in [
        Update::Lockstep(0),
        Update::Lockstep(2),
        Update::Lockstep(5),
        Update::Async,
        Update::Refit,
        Update::Rebuild,
    ] {
        for (time_range, predict) in [
            ([0.0, f64::INFINITY], true),
            ([-7.0, f64::NAN], false),
            ([f64::NAN, -7.0], false),
        ] {
            let mesh = Mesh::keyframes(demo.keys.clone(), &demo.triangles).unwrap();
            let (mut scene, _) = scene_of([mesh]);
            let streamed = Mesh::streamed(&triangle_at(-900.0), &[[0, 1, 2]]).unwrap();
            let streamed_id = time_range[0].is_nan().then(|| scene.add(streamed));
            let builder = Tracer::builder().update(update).builder_threads(1);
            let builder = builder.predict(predict).time_range(time_range);
            let mut tracer = pool::build(builder, scene, device);
            for (time, expected) in TIMES.into_iter().zip(&expected) {
                let moved = triangle_at(-901.0);
                let found = hits_after(&mut tracer, time, &rays, |step| {
                    streamed_id.map_or(Ok(()), |id| step.vertices(id, Source::Host(&moved)))
                });
                assert!(found == *expected, "{update:?} at {time}");
            }
            // The offset of shadow rays depends on the size of the scene, so also on the streamed triangle.
            let pictures = pictures.iter().filter(|_| streamed_id.is_none());
            for (time, picture) in TIMES.into_iter().zip(pictures) {
                let found = shown(&mut tracer, time, view);
                assert!(found == *picture, "{update:?} at {time}");
            }
            let trees = tracer.statistics().unwrap().generation;
            let is_one = update == Update::Refit;
            // With `Update::Async`, the builder thread decides when new trees arrive.
            if update != Update::Async {
                assert_eq!(trees == 1, is_one, "{update:?}");
            }
        }
    }
}

/// Tests a tracer on a backend that the caller created.
pub(crate) fn traces_on_a_caller_backend(device: &Device) {
    let demo = demo("demo:twist:2000");
    let mut usual = of_keys(&demo, device);
    let (scene, _) = scene_of([Mesh::open("demo:twist:2000").unwrap()]);
    let tracer = Tracer::builder().build_on(Box::new(host()), scene);
    let mut tracer = tracer.unwrap();
    assert!(hits_at(&mut tracer, 1.5, &demo.rays) == hits_at(&mut usual, 1.5, &demo.rays));
}
