//! What is rehearsed leaves no trace in the frames that count.

use crate::drifting;
use crate::fake::Fake;
use backend::{Generation, Method, Query, Rays, Seek};
use geom::Camera;
use pipeline::{Driver, Frame, FrameRecord, Options, Pace, PipelineError, Update};
use std::sync::Arc;

/// What a frame says that no clock decides.
fn facts(r: &FrameRecord) -> (Frame, Generation, u64, Option<Generation>, [bool; 3]) {
    let flags = [r.adopted.is_some(), r.made, r.rejected.is_some()];
    (
        r.frame,
        r.tree_generation,
        r.tree_age_frames,
        r.asked,
        flags,
    )
}

/// Runs frames, `rehearsals` traces after the first of them.
fn run(
    update: Update,
    predict: bool,
    rehearsals: usize,
) -> (Vec<FrameRecord>, Vec<Vec<u32>>, usize) {
    let animation = drifting(30);
    let (fake, log) = Fake::new(Some(0), None);
    let options = Options {
        method: Method::default(),
        update,
        builder_threads: 1,
        time_range: [0.0, animation.end()],
        predict,
    };
    let mut driver = Driver::new(Box::new(fake), Arc::clone(&animation), options).unwrap();
    let camera = Camera::look_at([0.0, 0.0, 9.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, [2, 2]).unwrap();
    let query = Query {
        rays: Rays::Camera(&camera),
        seek: Seek::Closest,
    };
    let mut records = Vec::new();
    let frames: Vec<_> = (0..20)
        .map(|index| Frame {
            index,
            time: index as f64 * 1.4,
        })
        .collect();
    for (i, part) in [&frames[..1], &frames[1..]].into_iter().enumerate() {
        let done = driver.run(part.iter().copied(), query, false, |record, _| {
            records.push(record.clone());
            Ok::<(), PipelineError>(())
        });
        done.unwrap();
        let mut left = if i == 0 { rehearsals } else { 0 };
        if left > 0 {
            let again = |_: &_| {
                left -= 1;
                left > 0
            };
            driver.rehearse(query, again).unwrap();
        }
    }
    drop(driver);
    let log = Arc::into_inner(log).unwrap().into_inner().unwrap();
    (records, log.trees, log.traced.len())
}

#[test]
fn frames_are_the_same_whatever_was_rehearsed() {
    let lockstep = Update::Async(Pace::Lockstep(3));
    for (update, predict) in [
        (lockstep, true),
        (lockstep, false),
        (Update::Rebuild, false),
        (Update::Refit, false),
        (Update::TSah, false),
        (Update::DeviceRebuild, false),
    ] {
        let (plain, trees, traced) = run(update, predict, 0);
        let (rehearsed, same_trees, traced_more) = run(update, predict, 50);
        let of = |all: &[FrameRecord]| all.iter().map(facts).collect::<Vec<_>>();
        assert_eq!(of(&plain), of(&rehearsed), "{update:?}");
        assert_eq!(trees, same_trees, "{update:?}");
        // One more is under way when there are enough.
        assert_eq!(traced_more, traced + 51, "{update:?}");
    }
}
