//! The whole pipeline on the `cpu` backend: whatever the builder's timing, the hits are right.

use backend::{Hits, Intersector, Method, Query, QueryKind, Rays};
use geom::Animation;
use integration::stage::{Stage, camera, light};
use libtest_mimic::Trial;
use pipeline::{
    Answers, BuilderThreads, Driver, DriverOptions, Frame, FrameRecord, Pace, PipelineError,
    Update, Wanted,
};
use std::sync::Arc;

const FRAMES: u64 = 24;
/// Frames that stand where the one before did.
const AT_REST: usize = 4;

pub(crate) fn trials() -> [Trial; 2] {
    [("from_read_back_vertices", false), ("ahead", true)].map(|(name, predict)| {
        let name = format!("schedule::frames_are_right_with_trees_{name}");
        integration::trial(name, move || frames_are_right(predict))
    })
}

/// Frames that go forth and back, stand still for a while, and jump.
fn frames(animation: &Animation) -> impl Iterator<Item = Frame> {
    let end = animation.end();
    let time = |i: u64| match i {
        0..8 => i as f64 / 8.0,
        8..12 => 1.0,
        12..20 => 1.0 - (i - 12) as f64 / 8.0,
        _ => 0.3 * (i - 20) as f64,
    };
    (0..FRAMES).map(move |index| Frame {
        index,
        time: end * time(index),
    })
}

/// Renders all frames under `update`; gives each frame's record and hits.
fn render(
    animation: &Arc<Animation>,
    query: Query<'_>,
    (update, predict): (Update, bool),
) -> Vec<(FrameRecord, Hits)> {
    let backend = Box::new(cpu_ref::CpuBackend::new(Some(2)).unwrap());
    let options = DriverOptions {
        method: Method::default(),
        update,
        time_range: [0.0, animation.end()],
        predict,
    };
    let threads = BuilderThreads::new(1).unwrap();
    let mut driver = Driver::new(backend, Arc::clone(animation), options, threads).unwrap();
    let mut done = Vec::new();
    let keep = |record: &FrameRecord, found: &mut Answers| {
        done.push((record.clone(), found.hits.clone()));
        Ok(())
    };
    let run = driver.run::<PipelineError>(frames(animation), query, Wanted::HITS, keep);
    run.unwrap();
    done
}

/// No frame is traced with stale positions, frames come in order, and generations rise only where a tree is adopted.
fn frames_are_right(predict: bool) {
    let scene = scene::open("demo:shatter:12000", &scene::Options::default());
    let animation = scene.unwrap().animation;
    let (camera, light) = (camera(&animation, [80, 60]), light(&animation));
    let rays = Rays::Camera(&camera);
    let kind = QueryKind::ClosestAndShadow { light };
    // Each frame by itself, with a tree of its own.
    let mut stage = Stage::new(&animation, Intersector::Watertight, 1);
    let alone = frames(&animation).map(|frame| {
        stage.plant(frame.time);
        stage.trace(frame.time, rays, kind)
    });
    let expected: Vec<Hits> = alone.collect();
    let moving = FRAMES as usize - AT_REST;
    for (update, adopted) in [
        (Update::Rebuild, moving..=moving),
        (Update::Refit, 1..=1),
        (Update::TSah, 1..=1),
        (Update::Async(Pace::Free), 1..=moving),
        (Update::Async(Pace::Lockstep(0)), moving..=moving),
        (Update::Async(Pace::Lockstep(1)), 6..=moving),
        (Update::Async(Pace::Lockstep(5)), 2..=moving),
    ] {
        let done = render(&animation, Query { rays, kind }, (update, predict));
        assert_eq!(done.len(), expected.len());
        let mut newest = 0;
        for (i, ((record, hits), expected)) in done.iter().zip(&expected).enumerate() {
            let about = format!("{update:?}: {:?}", record.frame);
            assert!(hits == expected, "{about}");
            assert_eq!(record.frame.index, i as u64);
            assert!(record.tree_age_frames <= i as u64, "{about}");
            let generation = record.tree_generation.0;
            assert_eq!(generation > newest, record.adopted.is_some(), "{about}");
            assert!(generation >= newest, "{about}");
            newest = generation;
        }
        let count = done.iter().filter(|(r, _)| r.adopted.is_some()).count();
        assert!(adopted.contains(&count), "{update:?} adopts {count} trees");
    }
}
