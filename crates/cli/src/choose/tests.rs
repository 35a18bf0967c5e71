//! What is settled by rule, and for a small scene on the host.

use super::*;
use crate::open;
use backend::{QueryKind, Rays};
use scene::Scene;

#[test]
fn names_mean_what_they_name_and_lockstep_is_async() {
    use UpdateName as U;
    let chosen = |update, lockstep| super::update(PolicyArgs { update, lockstep });
    let three = Update::Async(Pace::Lockstep(3));
    assert_eq!(chosen(U::Async, Some(3)), asked(three));
    assert_eq!(chosen(U::Auto, Some(3)).value, three);
    assert!(chosen(U::Auto, None).is_open && !chosen(U::Refit, None).is_open);
    let woop = intersector(IntersectorName::Woop);
    assert_eq!(woop, asked(Intersector::Woop));
    assert_eq!(layout(LayoutName::Bvh2), Some(Layout::Bvh2));
    assert_eq!(layout(LayoutName::Auto), None);
}

#[test]
fn a_drivers_own_intersector_stands_for_the_usual_one_alone() {
    use IntersectorName as I;
    use LayoutName as L;
    for (intersector, layout, beyond) in [
        (I::Auto, L::Auto, None),
        (I::Watertight, L::Auto, None),
        (I::Woop, L::Auto, Some("intersector 'woop'")),
        (I::Auto, L::Bvh2, Some("layout 'bvh2'")),
    ] {
        let method = MethodArgs {
            intersector,
            layout,
        };
        assert_eq!(beyond_drivers(method).as_deref(), beyond);
    }
}

#[test]
fn a_driver_rebuilds_where_nobody_asked_for_more() {
    let free = auto(Update::Async(Pace::Free), "because");
    assert_eq!(within_frames(free).value, Update::Rebuild);
    assert_eq!(within_frames(asked(free.value)), asked(free.value));
    let refit = auto(Update::Refit, "it stands still");
    assert_eq!(within_frames(refit), refit);
}

#[test]
fn frames_last_from_the_earliest_to_the_latest() {
    let range = |frames: &[Frame]| {
        let method = MethodArgs {
            intersector: IntersectorName::Woop,
            layout: LayoutName::Auto,
        };
        let rays = Rays::List(&[]);
        let kind = QueryKind::Any;
        let query = Query { rays, kind };
        let run = Some(Run { frames, query });
        let usual = Ask::of(BackendName::Cpu, method, asked(Update::Refit));
        Ask { run, ..usual }.time_range()
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
    let method = MethodArgs {
        intersector,
        layout: LayoutName::Auto,
    };
    let ask = Ask {
        threads: Some(2),
        tolerance,
        run: Some(Run {
            frames: &frames,
            query,
        }),
        ..Ask::of(BackendName::Cpu, method, free_update(UpdateName::Auto))
    };
    let backend = open::bare(BackendName::Cpu, None, 2).unwrap();
    settle(
        &mut ReusedBackend::new(backend, &scene.animation, &ask),
        &ask,
    )
    .unwrap()
}

fn demo(name: &str) -> Scene {
    scene::open(name, &scene::Options::default()).unwrap()
}

#[test]
fn what_is_left_open_is_settled_with_a_reason_and_what_is_named_without() {
    use IntersectorName::{Auto, Watertight};
    let scene = demo("demo:collide:400");
    let view = output::frame_scene(&scene.animation, 40.0, [64, 36]);
    let camera = view.camera([64, 36]).unwrap();
    let query = Query {
        rays: Rays::Camera(&camera),
        kind: QueryKind::ClosestAndShadow { light: view.light },
    };
    let settled = |count, intersector, ppm| settled(&scene, (count, query), intersector, ppm);
    let taken = settled(32, Watertight, 0.0);
    let why = taken.why[0].clone().unwrap();
    assert!(why.contains("frames") || why.contains("tree"), "{why}");
    assert_eq!(taken.method.layout, Layout::Fast);
    assert!(taken.why[2].is_some() && taken.why[1].is_none());
    assert_eq!(settled(1, Watertight, 0.0).update, Update::Refit);
    // Nothing but exact meets a tolerance of nought, and of a little too many rays would be needed.
    for (tolerance, takes, says) in [
        (0.0, Intersector::Exact, "by definition"),
        (0.5, Intersector::Exact, "too many rays"),
        (500.0, Intersector::Watertight, "rays wrong, at most"),
    ] {
        let taken = settled(32, Auto, tolerance);
        assert_eq!(taken.method.intersector, takes);
        let why = taken.why[1].clone().unwrap();
        assert!(why.contains(says), "{why}");
    }
}

/// Rays that begin far away are rounded by more than a triangle's size by all but `exact`.
#[test]
fn what_is_wrong_too_often_is_not_taken_however_fast() {
    let scene = demo("demo:twist:600");
    let bounds = scene.animation.bounds();
    let mut rng = fastrand::Rng::with_seed(3);
    let mut within = |i: usize| bounds.min[i] + rng.f32() * (bounds.max[i] - bounds.min[i]);
    let origin = [1e6, 2e6, 3e6];
    let mut ray = || geom::Ray::new(origin, [0, 1, 2].map(|i| within(i) - origin[i]));
    let rays: Vec<geom::Ray> = (0..500).map(|_| ray()).collect();
    let query = Query {
        rays: Rays::List(&rays),
        kind: QueryKind::Closest,
    };
    let taken = settled(&scene, (32, query), IntersectorName::Auto, 200.0);
    let why = taken.why[1].clone().unwrap();
    assert_eq!(taken.method.intersector, Intersector::Exact, "{why}");
    assert!(why.contains("watertight ") && why.contains("woop "));
}
