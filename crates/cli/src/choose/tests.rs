//! Choices by rule, and choices for a small scene on the host.

use super::*;
use crate::{open, session};
use backend::{QueryKind, Rays};
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
    let (host, driver) = (BackendName::Cpu, BackendName::VulkanRt);
    let three = Policy::Lockstep(3);
    let free = Policy::Async;
    for (ask, update, is_named) in [
        (asked(host, Some(Policy::Async), Some(3)), three, true),
        (asked(host, None, Some(3)), three, false),
        (asked(host, None, None), free, false),
        (asked(host, Some(Policy::Refit), None), Policy::Refit, true),
        // A driver rebuilds where nobody asked for more.
        (asked(driver, None, None), Policy::Rebuild, false),
        (asked(driver, Some(Policy::Async), None), free, true),
    ] {
        let (taken, why) = ask.update();
        assert_eq!((taken, why.is_none()), (update, is_named), "{ask:?}");
    }
    assert!(asked(host, None, None).is_open() && !asked(host, None, Some(3)).is_open());
    assert_eq!(layout(LayoutName::Bvh2), Some(Layout::Bvh2));
    assert_eq!(layout(LayoutName::Auto), None);
}

#[test]
fn a_drivers_own_intersector_stands_for_the_usual_one_alone() {
    use Intersector as I;
    use LayoutName as L;
    let usual = MethodArgs::of(I::Watertight, L::Auto);
    let beyond = beyond_drivers(usual, Some(Policy::DeviceRebuild));
    assert_eq!(beyond.as_deref(), Some("update policy 'device-rebuild'"));
    for (intersector, layout, beyond) in [
        (I::Watertight, L::Auto, None),
        (I::Woop, L::Auto, Some("intersector 'woop'")),
        (I::Watertight, L::Bvh2, Some("layout 'bvh2'")),
    ] {
        let method = MethodArgs::of(intersector, layout);
        let found = beyond_drivers(method, Some(Policy::Rebuild));
        assert_eq!(found.as_deref(), beyond);
    }
}

/// A real GPU is not needed: choices depend on the kind of device and on what backends support.
#[test]
fn every_backend_supports_what_is_chosen_for_it_on_every_kind_of_device() {
    let mut chosen = 0;
    for known in backends::KNOWN {
        let name = BackendName::from_str(known.name, true).unwrap();
        for (&device, usual) in known.kinds.iter().flat_map(|kind| {
            let layouts = LayoutName::value_variants().iter();
            layouts.map(move |&layout| (kind, layout))
        }) {
            let updates = [None].into_iter().chain(Policy::ALL.map(Some));
            for (update, &by) in updates.flat_map(|update| {
                let intersectors = Intersector::ALL.iter();
                intersectors.map(move |by| (update, by))
            }) {
                let ask = Ask::of(name, MethodArgs::of(by, usual), update);
                let context = format!("{ask} {usual:?} on {device:?}");
                let beyond = known
                    .has_own_trees
                    .then(|| beyond_drivers(ask.method, update));
                let Ok(settled) = session::for_backend(&ask) else {
                    assert!(beyond.flatten().is_some(), "{context} is refused");
                    continue;
                };
                let intersector = settled.method.intersector;
                let capabilities = Capabilities {
                    device,
                    layouts: layouts(known.supports, intersector),
                    makes_trees: known.has_own_trees,
                };
                let (layout, why) = capabilities.layout(settled.method.layout);
                let method = Method {
                    intersector,
                    layout,
                };
                assert!((known.supports)(method), "{context}: {method:?}");
                let named = self::layout(settled.method.layout);
                assert_eq!(named.is_none(), why.is_some(), "{context}");
                let expected = match (known.has_own_trees, device) {
                    (true, _) | (_, DeviceKind::Software) => Layout::Bvh2,
                    _ => Layout::Fast,
                };
                assert_eq!(layout, named.unwrap_or(expected), "{context}");
                chosen += 1;
            }
        }
    }
    let ours = backends::KNOWN.iter().filter(|known| !known.has_own_trees);
    let devices: usize = ours.map(|known| known.kinds.len()).sum();
    assert!(chosen > devices * 5 * 4 * 3, "{chosen} combinations");
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
            layouts: Layout::ALL.to_vec(),
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
