//! What is settled for a small scene on the host.

use super::*;
use crate::ahead::Ahead;
use crate::args::{BackendName, MethodArgs, PolicyArgs, Switch, UpdateName};
use crate::open::{self, Want};
use crate::session;
use backend::{Hits, QueryKind, Rays};
use scene::Scene;

const SIZE: [u32; 2] = [64, 36];

fn frames(n: u64) -> Vec<Frame> {
    let time = |index| index as f64 / 8.0;
    let frame = |index| Frame {
        index,
        time: time(index),
    };
    (0..n).map(frame).collect()
}

fn ask<'a>(frames: &[Frame], named: IntersectorName, tolerance: f64) -> Ask<'a> {
    let policy = PolicyArgs {
        update: UpdateName::Auto,
        lockstep: None,
    };
    Ask {
        backend: BackendName::Cpu,
        adapter: None,
        threads: Some(2),
        builder_threads: None,
        method: MethodArgs {
            intersector: named,
            layout: LayoutName::Auto,
        },
        update: choose::update(policy).unwrap(),
        tolerance,
        run: None,
        ahead: Ahead::of(frames, Switch::On),
    }
}

/// What is settled for a run of so many pictures.
fn settled(scene: &Scene, count: u64, named: IntersectorName, tolerance: f64) -> Settled {
    let view = output::frame_scene(&scene.animation, 40.0, SIZE);
    let camera = view.camera(SIZE).unwrap();
    let query = Query {
        rays: Rays::Camera(&camera),
        kind: QueryKind::ClosestAndShadow { light: view.light },
    };
    settled_for(scene, (count, query), named, tolerance)
}

fn settled_for(
    scene: &Scene,
    (count, query): (u64, Query<'_>),
    named: IntersectorName,
    tolerance: f64,
) -> Settled {
    let frames = frames(count);
    let ask = Ask {
        run: Some(Run {
            frames: &frames,
            query,
        }),
        ..ask(&frames, named, tolerance)
    };
    let want = Want {
        backend: BackendName::Cpu,
        adapter: None,
        method: choose::method(ask.method),
        threads: 2,
    };
    let backend = open::open(&want, Ok).unwrap().value;
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
fn policy_and_layout_are_chosen_with_a_reason_and_what_is_named_without() {
    let scene = demo("demo:collide:400");
    let taken = settled(&scene, 32, IntersectorName::Watertight, 0.0);
    let why = taken.why_update.unwrap();
    assert!(why.contains("frames") || why.contains("tree"), "{why}");
    assert_eq!(taken.method.layout, Layout::Fast);
    assert!(taken.why_layout.is_some() && taken.why_intersector.is_none());
    let one = settled(&scene, 1, IntersectorName::Watertight, 0.0);
    assert_eq!(one.update, Update::Refit);
}

#[test]
fn nothing_but_exact_meets_a_tolerance_of_nought_and_nothing_has_to_be_asked() {
    let scene = demo("demo:collide:400");
    let none = settled(&scene, 32, IntersectorName::Auto, 0.0);
    assert_eq!(none.method.intersector, Intersector::Exact);
    // Too many rays would be needed.
    let little = settled(&scene, 32, IntersectorName::Auto, 0.5);
    assert_eq!(little.method.intersector, Intersector::Exact);
    assert!(little.why_intersector.unwrap().contains("too many rays"));
    let some = settled(&scene, 32, IntersectorName::Auto, 500.0);
    assert_eq!(some.method.intersector, Intersector::Watertight);
    let why = some.why_intersector.unwrap();
    assert!(why.contains("rays wrong, at most"), "{why}");
}

/// Rays that begin far away are rounded by more than a triangle's size by all but `exact`.
#[test]
fn what_is_wrong_too_often_is_not_taken_however_fast() {
    let scene = demo("demo:twist:600");
    let bounds = scene.animation.bounds();
    let mut rng = fastrand::Rng::with_seed(3);
    let mut within = |i: usize| bounds.min[i] + rng.f32() * (bounds.max[i] - bounds.min[i]);
    let rays: Vec<geom::Ray> = (0..500)
        .map(|_| {
            let origin = [1e6, 2e6, 3e6];
            let to = [within(0), within(1), within(2)];
            geom::Ray {
                origin,
                direction: [0, 1, 2].map(|i| to[i] - origin[i]),
                t_min: 0.0,
                t_max: f32::INFINITY,
            }
        })
        .collect();
    let query = Query {
        rays: Rays::List(&rays),
        kind: QueryKind::Closest,
    };
    let taken = settled_for(&scene, (32, query), IntersectorName::Auto, 200.0);
    let why = taken.why_intersector.unwrap();
    assert_eq!(taken.method.intersector, Intersector::Exact, "{why}");
    assert!(
        why.contains("watertight ") && why.contains("woop "),
        "{why}"
    );
}

/// Whatever is taken, answers are those of a run without a choice.
#[test]
fn a_choice_leaves_no_trace_in_the_hits() {
    let scene = demo("demo:collide:400");
    let frames = frames(20);
    let view = output::frame_scene(&scene.animation, 40.0, SIZE);
    let camera = view.camera(SIZE).unwrap();
    let query = Query {
        rays: Rays::Camera(&camera),
        kind: QueryKind::ClosestAndShadow { light: view.light },
    };
    let hits = |run: Option<Run<'_>>| {
        let base = ask(&frames, IntersectorName::Watertight, 0.0);
        let mut session = session::start(&scene.animation, &Ask { run, ..base }).unwrap();
        let mut all: Vec<Hits> = Vec::new();
        let run = session
            .driver
            .run::<Stop>(frames.iter().copied(), query, true, |_, hits| {
                all.push(hits.clone());
                Ok(())
            });
        run.unwrap();
        all
    };
    let chosen = hits(Some(Run {
        frames: &frames,
        query,
    }));
    assert!(chosen == hits(None));
    assert!(
        chosen
            .iter()
            .all(|h| h.closest.iter().any(geom::Hit::is_hit))
    );
}
