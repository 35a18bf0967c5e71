//! What is rehearsed or repeated leaves no trace in the frames that count.

use crate::fake::{Fake, Log};
use crate::{camera, drifting, driver, read};
use backend::{Generation, Query, QueryKind, Rays};
use pipeline::{Frame, FrameRecord, Pace, PipelineError, Update, Wanted};

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

/// What is done uncounted after the first frame.
#[derive(Clone, Copy)]
enum Uncounted {
    /// Traces.
    WarmUp(usize),
    /// Frames.
    Repeat(usize),
}

/// Runs frames, and something uncounted after the first of them.
fn run(update: Update, predict: bool, uncounted: Uncounted) -> (Vec<FrameRecord>, Log) {
    let animation = drifting(30);
    let (fake, log) = Fake::new(Some(0), None);
    let mut driver = driver(fake, &animation, (update, predict)).unwrap();
    let camera = camera();
    let query = Query {
        rays: Rays::Camera(&camera),
        kind: QueryKind::Closest,
    };
    let mut records = Vec::new();
    let frames: Vec<_> = (0..20)
        .map(|index| Frame {
            index,
            time: index as f64 * 1.4,
        })
        .collect();
    for (i, part) in [&frames[..1], &frames[1..]].into_iter().enumerate() {
        let done = driver.run(
            part.iter().copied(),
            query,
            Wanted::default(),
            |record, _| {
                records.push(record.clone());
                Ok::<(), PipelineError>(())
            },
        );
        done.unwrap();
        let (Uncounted::WarmUp(mut left) | Uncounted::Repeat(mut left)) = uncounted;
        if i == 0 && left > 0 {
            let again = |_: &_| {
                left -= 1;
                left > 0
            };
            let done = match uncounted {
                Uncounted::WarmUp(_) => driver.warm_up(query, again),
                Uncounted::Repeat(_) => driver.repeat(query, again),
            };
            done.unwrap();
        }
    }
    drop(driver);
    (records, read(log))
}

const LOCKSTEP: Update = Update::Async(Pace::Lockstep(3));
const ALL: [(Update, bool); 6] = [
    (LOCKSTEP, true),
    (LOCKSTEP, false),
    (Update::Rebuild, false),
    (Update::Refit, false),
    (Update::TSah, false),
    (Update::DeviceRebuild, false),
];
const NOTHING: Uncounted = Uncounted::WarmUp(0);
// One more is under way when there are enough.
const ASKED: usize = 50;
const DONE: usize = ASKED + 1;

#[test]
fn frames_are_the_same_whatever_was_rehearsed() {
    for (update, predict) in ALL {
        let (plain, log) = run(update, predict, NOTHING);
        let (rehearsed, more) = run(update, predict, Uncounted::WarmUp(ASKED));
        let of = |all: &[FrameRecord]| all.iter().map(facts).collect::<Vec<_>>();
        assert_eq!(of(&plain), of(&rehearsed), "{update:?}");
        assert_eq!(log.trees, more.trees, "{update:?}");
        assert_eq!(more.traced.len(), log.traced.len() + DONE, "{update:?}");
        assert_eq!(more.interpolated, log.interpolated, "{update:?}");
    }
}

#[test]
fn a_frame_is_repeated_with_its_own_tree_and_all_its_stages() {
    for (update, predict) in ALL {
        let (plain, log) = run(update, predict, NOTHING);
        let (after, more) = run(update, predict, Uncounted::Repeat(ASKED));
        // A tree that the device makes again has a number of its own.
        let made = usize::from(update == Update::DeviceRebuild) * DONE;
        let of = |all: &[FrameRecord], earlier: usize| {
            let all = all.iter().map(facts);
            let numbered = all.map(|(frame, tree, age, asked, flags)| {
                (frame, tree.0 - earlier as u64, age, asked, flags)
            });
            numbered.collect::<Vec<_>>()
        };
        assert_eq!(of(&plain, 0)[0], of(&after, 0)[0], "{update:?}");
        assert_eq!(of(&plain, 0)[1..], of(&after[1..], made), "{update:?}");
        assert_eq!(more.made.len(), log.made.len() + made, "{update:?}");
        assert_eq!(log.trees, more.trees, "{update:?}");
        assert_eq!(more.interpolated, log.interpolated + DONE, "{update:?}");
        assert_eq!(more.refitted, log.refitted + DONE, "{update:?}");
        let again = &more.traced[1..=DONE];
        let first = more.traced[0];
        assert!(again.iter().all(|t| t.1 == first.1), "{update:?}");
        assert!(made > 0 || again.iter().all(|t| t.0 == first.0));
    }
}
