//! The whole pipeline on the `cpu` backend: whatever the builder's timing, the hits are right.

use backend::{Hits, Intersector, Method, Query, QueryKind, Rays};
use geom::Animation;
use integration::rays::{camera, light};
use integration::stage::Stage;
use pipeline::{Driver, DriverOptions, Frame, FrameRecord, Pace, PipelineError, Update};
use std::sync::Arc;

const FRAMES: u64 = 24;

fn scene() -> Arc<Animation> {
    let scene = scene::open("demo:shatter:12000", &scene::Options::default());
    scene.expect("a demo opens").animation
}

/// Frames that go forth and back, stand still for a while, and jump.
fn times(animation: &Animation) -> Vec<f64> {
    let time = |i: u64| match i {
        0..8 => i as f64 / 8.0,
        8..12 => 1.0,
        12..20 => 1.0 - (i - 12) as f64 / 8.0,
        _ => 0.3 * (i - 20) as f64,
    };
    (0..FRAMES).map(|i| animation.end() * time(i)).collect()
}

/// Renders all frames under `update`; gives each frame's record and hits.
fn render(animation: &Arc<Animation>, update: Update) -> Vec<(FrameRecord, Hits)> {
    render_by(animation, update, true)
}

fn render_by(
    animation: &Arc<Animation>,
    update: Update,
    predict: bool,
) -> Vec<(FrameRecord, Hits)> {
    let backend = cpu_ref::CpuBackend::new(Some(2)).expect("threads can be had");
    let options = DriverOptions {
        method: Method::default(),
        update,
        builder_threads: 1,
        time_range: [0.0, animation.end()],
        predict,
    };
    let mut driver =
        Driver::new(Box::new(backend), Arc::clone(animation), options).expect("the scene fits");
    let times = times(animation).into_iter().enumerate();
    let frames = times.map(|(i, time)| Frame {
        index: i as u64,
        time,
    });
    let camera = camera(animation, [80, 60]);
    let query = Query {
        rays: Rays::Camera(&camera),
        kind: QueryKind::ClosestAndShadow {
            light: light(animation),
        },
    };
    let mut done = Vec::new();
    driver
        .run::<PipelineError>(frames, query, true, |record, hits| {
            done.push((record.clone(), hits.clone()));
            Ok(())
        })
        .expect("every frame renders");
    done
}

/// Each frame by itself, with a tree of its own.
fn expected(animation: &Arc<Animation>) -> Vec<Hits> {
    let camera = camera(animation, [80, 60]);
    let light = light(animation);
    let mut stage = Stage::new(animation, Intersector::Watertight, 1);
    let rays = Rays::Camera(&camera);
    let kind = QueryKind::ClosestAndShadow { light };
    let frame = |time| {
        stage.plant(time);
        stage.trace(time, Query { rays, kind })
    };
    times(animation).into_iter().map(frame).collect()
}

#[test]
fn no_frame_is_ever_traced_with_stale_positions_whatever_the_policy() {
    let animation = scene();
    let expected = expected(&animation);
    for update in [
        Update::Rebuild,
        Update::Refit,
        Update::TSah,
        Update::Async(Pace::Free),
        Update::Async(Pace::Lockstep(0)),
        Update::Async(Pace::Lockstep(1)),
        Update::Async(Pace::Lockstep(5)),
    ] {
        for predict in [true, false] {
            let done = render_by(&animation, update, predict);
            assert_eq!(done.len(), expected.len());
            for ((record, hits), expected) in done.iter().zip(&expected) {
                let frame = record.frame;
                assert!(hits == expected, "{update:?} {predict}: {frame:?}");
            }
        }
    }
}

#[test]
fn frames_come_in_order_and_generations_only_rise() {
    let animation = scene();
    for update in [
        Update::Rebuild,
        Update::Async(Pace::Free),
        Update::Async(Pace::Lockstep(2)),
    ] {
        let done = render(&animation, update);
        for (i, (record, _)) in done.iter().enumerate() {
            assert_eq!(record.frame.index, i as u64);
            assert!(record.tree_age_frames <= i as u64);
        }
        for pair in done.windows(2) {
            let [(a, _), (b, _)] = pair else { continue };
            let risen = b.tree_generation > a.tree_generation;
            assert!(
                risen || b.tree_generation == a.tree_generation,
                "{update:?}"
            );
            assert_eq!(risen, b.adopted.is_some(), "{update:?}: {:?}", b.frame);
        }
    }
}

#[test]
fn an_asynchronous_run_adopts_trees_and_refit_does_not() {
    let animation = scene();
    let adopted = |update| {
        let done = render(&animation, update);
        done.iter().filter(|(r, _)| r.adopted.is_some()).count()
    };
    assert_eq!(adopted(Update::Refit), 1);
    assert!(adopted(Update::Async(Pace::Lockstep(1))) > 5);
    // The motion stands still from one frame to the next four times; each other frame needs its own tree.
    assert_eq!(adopted(Update::Rebuild), FRAMES as usize - 4);
}
