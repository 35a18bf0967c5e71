//! What is settled by rule, and for a small scene on the host.

use super::*;
use crate::open;
use backend::QueryKind;
use clap::ValueEnum;
use geom::Hit;
use scene::Scene;

const AUTO: MethodArgs = MethodArgs {
    intersector: IntersectorName::Auto,
    layout: LayoutName::Auto,
};

#[test]
fn names_mean_what_they_name_and_lockstep_is_async() {
    use UpdateName as U;
    let asked = |backend, update, lockstep| Ask {
        lockstep,
        ..Ask::of(backend, AUTO, update)
    };
    let host = BackendName::Cpu;
    let three = Update::Async(Pace::Lockstep(3));
    let free = Update::Async(Pace::Free);
    for (ask, update, is_named) in [
        (asked(host, U::Async, Some(3)), three, true),
        (asked(host, U::Auto, Some(3)), three, false),
        (asked(host, U::Auto, None), free, false),
        (asked(host, U::Refit, None), Update::Refit, true),
        (asked(host, U::Async, None), free, true),
    ] {
        let (taken, why) = ask.update();
        assert_eq!((taken, why.is_none()), (update, is_named), "{ask:?}");
    }
    assert!(asked(host, U::Auto, None).is_open() && !asked(host, U::Auto, Some(3)).is_open());
    let woop = intersector(IntersectorName::Woop);
    assert_eq!(woop, (Intersector::Woop, None));
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
    let ask = Ask::of(BackendName::Vulkan, AUTO, UpdateName::Auto);
    for (device, makes_trees, expected) in [
        (DeviceKind::Gpu, true, Update::DeviceRebuild),
        (DeviceKind::Gpu, false, Update::Rebuild),
        (DeviceKind::Software, true, Update::Rebuild),
        (DeviceKind::Cpu, false, Update::Rebuild),
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
        let usual = Ask::of(BackendName::Cpu, AUTO, UpdateName::Refit);
        usual.over(frames, query).time_range()
    };
    let frames = [3.0, 1.5, 2.0].map(|time| Frame { index: 0, time });
    assert_eq!(range(&frames), [1.5, 3.0]);
    assert_eq!(range(&[]), [0.0, 0.0]);
}

/// What is settled for a run of so many frames.
fn settled(
    scene: &Scene,
    (count, query): (u64, Query<'_>),
    intersector: IntersectorName,
    tolerance: f64,
) -> Settled {
    let frame = |index| Frame {
        index,
        time: index as f64 / 8.0,
    };
    let frames: Vec<Frame> = (0..count).map(frame).collect();
    let method = MethodArgs::of(intersector, LayoutName::Auto);
    let ask = Ask {
        threads: Some(2),
        tolerance,
        ..Ask::of(BackendName::Cpu, method, UpdateName::Auto)
    };
    let ask = ask.over(&frames, query);
    let backend = open::bare(BackendName::Cpu, None, 2).unwrap();
    settle(backend, &scene.animation, &ask).unwrap().1
}

fn demo(name: &str) -> Scene {
    scene::open(name, &scene::Options::default()).unwrap()
}

#[test]
fn what_is_left_open_is_settled_with_a_reason_and_what_is_named_without() {
    use IntersectorName::{Auto, Watertight};
    let scene = demo("demo:collide:400");
    let view = shading::frame_scene(&scene.animation, 40.0, [64, 36]);
    let camera = view.camera([64, 36]).unwrap();
    let query = shading::query((&camera, view.light));
    let settled = |count, intersector, ppm| settled(&scene, (count, query), intersector, ppm);
    let taken = settled(32, Watertight, 0.0);
    let (method, _, [why, none, some]) = taken;
    let why = why.unwrap();
    assert!(why.contains("frames") || why.contains("tree"), "{why}");
    assert_eq!(method.layout, Layout::Fast);
    assert!(some.is_some() && none.is_none());
    assert_eq!(settled(1, Watertight, 0.0).1, Update::Refit);
    // Nothing but exact meets a tolerance of nought, and of a little too many rays would be needed.
    for (tolerance, takes, says) in [
        (0.0, Intersector::Exact, "by definition"),
        (0.5, Intersector::Exact, "too many rays"),
        (500.0, Intersector::Watertight, "rays wrong, at most"),
    ] {
        let (method, _, [_, why, _]) = settled(32, Auto, tolerance);
        assert_eq!(method.intersector, takes);
        let why = why.unwrap();
        assert!(why.contains(says), "{why}");
    }
}

/// Rays that begin far away are rounded by more than a triangle's size by all but `exact`.
#[test]
fn what_is_wrong_too_often_is_not_taken_however_fast() {
    let scene = demo("demo:twist:600");
    let bounds = scene.animation.bounds();
    let mut rng = Rng::with_seed(3);
    let mut within = |i: usize| bounds.min[i] + rng.f32() * (bounds.max[i] - bounds.min[i]);
    let origin = [1e6, 2e6, 3e6];
    let ray = |_| Ray::new(origin, [0, 1, 2].map(|i| within(i) - origin[i]));
    let rays: Vec<Ray> = (0..500).map(ray).collect();
    let (rays, kind) = (Rays::List(&rays), QueryKind::Closest);
    let query = Query { rays, kind };
    let (method, _, [_, why, _]) = settled(&scene, (32, query), IntersectorName::Auto, 200.0);
    let why = why.unwrap();
    assert_eq!(method.intersector, Intersector::Exact, "{why}");
    assert!(why.contains("watertight ") && why.contains("woop "));
}

#[test]
fn none_wrong_shows_less_the_more_is_tolerated() {
    for tolerance in [5.0, 10.0, 1000.0] {
        let rays = needed(tolerance).unwrap() as u64;
        let most = output::plot::Rate::of(0, rays).unwrap().high;
        assert!(most < tolerance, "{tolerance}: {rays} rays");
    }
    assert_eq!(needed(1.0), None, "more rays than are asked");
    assert_eq!(needed(0.0), None);
}

#[test]
fn a_ray_is_wrong_once_by_its_triangle_or_its_shadow() {
    let hit = |triangle| Hit {
        triangle,
        ..Hit::MISS
    };
    let hits = |all: [(u32, u8); 4]| Hits {
        closest: all.map(|(triangle, _)| hit(triangle)).to_vec(),
        blocked: all.map(|(_, blocked)| blocked).to_vec(),
    };
    let exact = hits([(1, 0), (2, 1), (3, 0), (4, 0)]);
    let found = hits([(1, 0), (2, 0), (9, 0), (9, 1)]);
    assert_eq!(differing(&exact, &found), 3);
    assert_eq!(differing(&exact, &exact.clone()), 0);
}
