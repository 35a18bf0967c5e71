//! Whole trials, over a small scene on the host.

use super::*;
use crate::ahead::Ahead;
use crate::args::{BackendName, MethodArgs, PolicyArgs, Switch};
use crate::open::{self, Want};
use crate::session;
use backend::{Hits, QueryKind, Rays};
use scene::Scene;

const SIZE: [u32; 2] = [64, 36];

pub(super) fn frames(n: u64) -> Vec<Frame> {
    let time = |index| index as f64 / 8.0;
    let frame = |index| Frame {
        index,
        time: time(index),
    };
    (0..n).map(frame).collect()
}

fn ask<'a>(scene: &Scene, frames: &[Frame], named: IntersectorName, tolerance: f64) -> Ask<'a> {
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
        update: choose::update(policy, &scene.animation, frames).unwrap(),
        tolerance,
        run: None,
        ahead: Ahead::of(frames, Switch::On),
    }
}

/// Hands a run of these frames to `with`.
pub(super) fn with_run<T>(
    animation: &Animation,
    frames: &[Frame],
    with: impl FnOnce(&Run<'_>) -> T,
) -> T {
    let view = picture::frame_scene(animation, 40.0, SIZE);
    let camera = view.camera(SIZE).unwrap();
    let query = Query {
        rays: Rays::Camera(&camera),
        kind: QueryKind::ClosestAndShadow { light: view.light },
    };
    with(&Run { frames, query })
}

/// Has everything settled for a run of so many frames.
fn settled(scene: &Scene, count: u64, named: IntersectorName, tolerance: f64) -> Settled {
    let frames = frames(count);
    with_run(&scene.animation, &frames, |&run| {
        let ask = Ask {
            run: Some(run),
            ..ask(scene, &frames, named, tolerance)
        };
        let backend = session_backend(&ask);
        settle(
            &mut TrialBackend::new(backend, &scene.animation, &ask),
            &ask,
        )
        .unwrap()
    })
}

fn demo(name: &str) -> Scene {
    scene::open(name, &scene::Options::default()).unwrap()
}

#[test]
fn a_long_run_is_tried_out_and_a_short_one_goes_by_rule() {
    let scene = demo("demo:collide:400");
    let long = settled(&scene, 32, IntersectorName::Watertight, 0.0);
    let why = long.why_update.unwrap();
    assert!(why.starts_with("measured over"), "{why}");
    for name in ["rebuild", "refit", "async"] {
        assert!(why.contains(name), "{why}");
    }
    assert_eq!(long.why_intersector, None, "it was asked for by name");
    for fact in [
        "motion",
        "refit decay",
        "degenerate",
        "offset",
        "found out in",
    ] {
        assert!(why.contains(fact), "{why}");
    }
    let short = settled(&scene, 8, IntersectorName::Watertight, 0.0);
    assert!(!short.why_update.unwrap().contains("measured"));
}

#[test]
fn without_a_trial_the_decay_of_the_first_tree_decides() {
    let scene = demo("demo:collide:400");
    let mut settled = Settled::by_rule(&ask(&scene, &frames(8), IntersectorName::Auto, 0.0));
    settled.by_facts(&Facts::decayed(1.3), true);
    assert_eq!(settled.update, Update::Async(pipeline::Pace::Free));
    settled.by_facts(&Facts::decayed(1.01), true);
    assert_eq!(settled.update, Update::Refit);
    let why = settled.why_update.unwrap();
    assert!(why.contains("as good as a fresh one"), "{why}");
}

#[test]
fn nothing_but_exact_meets_a_tolerance_of_nought_and_nothing_has_to_be_asked() {
    let scene = demo("demo:collide:400");
    let none = settled(&scene, 32, IntersectorName::Auto, 0.0);
    assert_eq!(none.method.intersector, Intersector::Exact);
    // Too many rays would be needed.
    let little = settled(&scene, 32, IntersectorName::Auto, 0.5);
    assert_eq!(little.method.intersector, Intersector::Exact);
    let why = settled(&scene, 32, IntersectorName::Auto, 500.0)
        .why_intersector
        .unwrap();
    assert!(why.contains("rays wrong, at most"), "{why}");
}

/// Far from the origin `woop` is wrong often, whatever it costs.
#[test]
fn what_is_wrong_too_often_is_not_taken_however_fast() {
    let near = demo("demo:twist:600").animation;
    let move_away = |key: &Vec<[f32; 3]>| key.iter().map(|v| v.map(|x| x + 4096.0)).collect();
    let keys = near.keys().iter().map(move_away).collect();
    let far = geom::Animation::new(keys, near.triangles().to_vec()).unwrap();
    let scene = Scene {
        animation: std::sync::Arc::new(far),
        ..demo("demo:twist:600")
    };
    let frames = frames(32);
    let base = ask(&scene, &frames, IntersectorName::Auto, 20.0);
    let view = picture::frame_scene(&scene.animation, 40.0, [256, 144]);
    let camera = view.camera([256, 144]).unwrap();
    let run = Run {
        frames: &frames,
        query: Query {
            rays: Rays::Camera(&camera),
            kind: QueryKind::ClosestAndShadow { light: view.light },
        },
    };
    let backend = session_backend(&base);
    let mut stand = TrialBackend::new(backend, &scene.animation, &base);
    let mut timed: Vec<_> = Intersector::ALL
        .map(|intersector| methods::Timed {
            method: Method {
                intersector,
                layout: Layout::Bvh2,
            },
            ms: if intersector == Intersector::Woop {
                1.0
            } else {
                2.0
            },
            build_ms: 1.0,
        })
        .to_vec();
    timed.sort_by(|a, b| a.ms.total_cmp(&b.ms));
    let mut settled = Settled::by_rule(&base);
    take_method(&mut stand, &base, (&run, &timed), &mut settled).unwrap();
    let why = settled.why_intersector.unwrap();
    assert!(why.contains("woop 2"), "{why}");
    assert_ne!(settled.method.intersector, Intersector::Woop, "{why}");
}

fn session_backend(ask: &Ask<'_>) -> Box<dyn backend::Backend> {
    let want = Want {
        backend: BackendName::Cpu,
        adapter: None,
        method: choose::method(ask.method),
        threads: 2,
    };
    open::open(&want, Ok).unwrap().value
}

/// Whatever a trial did before, answers are those of a run without one.
#[test]
fn a_trial_leaves_no_trace_in_the_hits() {
    let scene = demo("demo:collide:400");
    let frames = frames(20);
    let view = picture::frame_scene(&scene.animation, 40.0, SIZE);
    let camera = view.camera(SIZE).unwrap();
    let query = Query {
        rays: Rays::Camera(&camera),
        kind: QueryKind::ClosestAndShadow { light: view.light },
    };
    let hits = |run: Option<Run<'_>>| {
        let base = ask(&scene, &frames, IntersectorName::Watertight, 0.0);
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
    let tried = hits(Some(Run {
        frames: &frames,
        query,
    }));
    assert!(tried == hits(None));
    assert!(
        tried
            .iter()
            .any(|h| h.closest.iter().any(geom::Hit::is_hit))
    );
}
