//! Choices by rule, and choices for a small scene on the host.

use super::*;
use crate::open;
use backend::{BackendName, QueryKind, Rays};
use scene::Scene;

const BY: Intersector = Intersector::Watertight;

#[test]
fn names_mean_what_they_name_and_lockstep_is_async() {
    let asked = |backend, update, lockstep| Ask {
        lockstep,
        ..Ask::of(backend, BY, update)
    };
    let host = Some(BackendName::Cpu);
    let three = Policy::Lockstep(3);
    let free = Policy::Async;
    for (ask, update, is_named) in [
        (asked(host, Some(Policy::Async), Some(3)), three, true),
        (asked(host, None, Some(3)), three, false),
        (asked(host, None, None), free, false),
        (asked(host, Some(Policy::Refit), None), Policy::Refit, true),
        (asked(host, Some(Policy::Async), None), free, true),
    ] {
        let (taken, why) = ask.update();
        assert_eq!((taken, why.is_none()), (update, is_named), "{ask:?}");
    }
    assert!(asked(host, None, None).is_open() && !asked(host, None, Some(3)).is_open());
}

#[test]
fn trees_are_left_to_a_device_only_where_it_can_build_them() {
    let scene = demo("demo:collide:400");
    // Frames so far apart that every frame needs a new tree.
    let frames = [0.0, 4.0, 8.0].map(|time| Frame { index: 0, time });
    let (rays, kind) = (Rays::List(&[]), QueryKind::Any);
    let run = Run {
        frames: &frames,
        query: Query { rays, kind },
    };
    let ask = Ask::of(Some(BackendName::Vulkan), BY, None);
    for (device, makes_trees, expected) in [
        (DeviceKind::Gpu, true, Policy::DeviceRebuild),
        (DeviceKind::Gpu, false, Policy::Rebuild),
        (DeviceKind::Software, true, Policy::Rebuild),
        (DeviceKind::Cpu, false, Policy::Rebuild),
    ] {
        let capabilities = Capabilities {
            device,
            makes_trees,
        };
        let facts = facts(&capabilities, &scene.animation, &ask, &run).unwrap();
        assert_eq!(facts.choose().0, expected, "{device:?} {makes_trees}");
    }
}

#[test]
fn frames_last_from_the_earliest_to_the_latest() {
    let range = |frames: &[Frame]| {
        let (rays, kind) = (Rays::List(&[]), QueryKind::Any);
        let query = Query { rays, kind };
        let usual = Ask::of(Some(BackendName::Cpu), BY, Some(Policy::Refit));
        usual.over(frames, query).time_range()
    };
    let frames = [3.0, 1.5, 2.0].map(|time| Frame { index: 0, time });
    assert_eq!(range(&frames), [1.5, 3.0]);
    assert_eq!(range(&[]), [0.0, 0.0]);
}

fn demo(name: &str) -> Scene {
    scene::open(name, &scene::Options::default()).unwrap()
}

#[test]
fn what_is_left_open_is_settled_with_a_reason() {
    let scene = demo("demo:collide:400");
    let view = shading::frame_scene(&scene.animation, 40.0, [64, 36]);
    let camera = view.camera([64, 36]).unwrap();
    let query = shading::query((&camera, view.light));
    let settled = |count| {
        let frame = |index| Frame {
            index,
            time: index as f64 / 8.0,
        };
        let frames: Vec<Frame> = (0..count).map(frame).collect();
        let ask = Ask {
            threads: Some(2),
            ..Ask::of(Some(BackendName::Cpu), BY, None)
        };
        let backend = open::bare(Some(BackendName::Cpu), None, 2).unwrap();
        settle(
            backend.as_ref(),
            &scene.animation,
            &ask.over(&frames, query),
        )
        .unwrap()
    };
    let why = settled(32).1.unwrap();
    assert!(why.contains("frames") || why.contains("tree"), "{why}");
    assert_eq!(settled(1).0, Policy::Refit);
}
