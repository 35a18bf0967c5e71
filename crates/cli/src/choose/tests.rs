//! Choices by rule, and choices for a small scene on the host.

use super::*;
use crate::open;
use backend::{Intersector, QueryKind, Rays};
use clap::ValueEnum;
use scene::Scene;

const AUTO: MethodArgs = MethodArgs {
    intersector: Intersector::Watertight,
    layout: LayoutName::Auto,
};

#[test]
fn names_mean_what_they_name_and_lockstep_is_async() {
    let asked = |backend, update, lockstep| Ask {
        lockstep,
        ..Ask::of(backend, AUTO, update)
    };
    let host = BackendName::Cpu;
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
    assert_eq!(layout(LayoutName::Bvh2), Some(Layout::Bvh2));
    assert_eq!(layout(LayoutName::Auto), None);
}

#[test]
fn the_layout_left_open_depends_on_the_kind_of_device() {
    for device in DeviceKind::ALL {
        let capabilities = Capabilities {
            device,
            makes_trees: true,
        };
        for &name in LayoutName::value_variants() {
            let (taken, why) = capabilities.layout(name);
            let named = layout(name);
            let usual = match device {
                DeviceKind::Software => Layout::Bvh2,
                DeviceKind::Gpu | DeviceKind::Cpu => Layout::Fast,
            };
            assert_eq!(taken, named.unwrap_or(usual));
            assert_eq!(named.is_none(), why.is_some());
        }
    }
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
    let ask = Ask::of(BackendName::Vulkan, AUTO, None);
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
        let method = Method::default();
        let facts = facts(&capabilities, &scene.animation, &ask, &run, method).unwrap();
        assert_eq!(facts.choose().0, expected, "{device:?} {makes_trees}");
    }
}

#[test]
fn frames_last_from_the_earliest_to_the_latest() {
    let range = |frames: &[Frame]| {
        let (rays, kind) = (Rays::List(&[]), QueryKind::Any);
        let query = Query { rays, kind };
        let usual = Ask::of(BackendName::Cpu, AUTO, Some(Policy::Refit));
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
            ..Ask::of(BackendName::Cpu, AUTO, None)
        };
        let backend = open::bare(BackendName::Cpu, None, 2).unwrap();
        settle(
            backend.as_ref(),
            &scene.animation,
            &ask.over(&frames, query),
        )
        .unwrap()
    };
    let (method, _, [why_update, why_layout]) = settled(32);
    let why = why_update.unwrap();
    assert!(why.contains("frames") || why.contains("tree"), "{why}");
    assert_eq!((method.layout, why_layout.is_some()), (Layout::Fast, true));
    assert_eq!(settled(1).1, Policy::Refit);
}
