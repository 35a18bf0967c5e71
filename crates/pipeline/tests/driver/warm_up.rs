//! What is warmed up leaves no trace in the frames that count.

use crate::fake::{Fake, Log};
use crate::{drifting, driver, query, read};
use backend::{Generation, QueryKind};
use pipeline::{Frame, FrameRecord, Pace, PipelineError, Update, Wanted};

/// What a frame says that no clock decides.
type Facts = (Frame, u64, u64, Option<Generation>, [bool; 3]);

fn facts(all: &[FrameRecord]) -> Vec<Facts> {
    let facts = |r: &FrameRecord| {
        let flags = [r.adopted.is_some(), r.made, r.rejected.is_some()];
        (
            r.frame,
            r.tree_generation.0,
            r.tree_age_frames,
            r.asked,
            flags,
        )
    };
    all.iter().map(facts).collect()
}

/// Runs frames, after the first of which so many traces are done uncounted.
fn run(update: Update, predict: bool, mut left: usize) -> (Vec<FrameRecord>, Log) {
    let (fake, log) = Fake::new(Some(0), None);
    let mut driver = driver(fake, &drifting(30), (update, predict)).unwrap();
    let query = query(QueryKind::Closest);
    let mut records = Vec::new();
    let frame = |index| Frame {
        index,
        time: index as f64 * 1.4,
    };
    for part in [0..1, 1..20] {
        let done = driver.run(part.map(frame), query, Wanted::default(), |record, _| {
            records.push(record.clone());
            Ok::<(), PipelineError>(())
        });
        done.unwrap();
        if left == 0 {
            continue;
        }
        let again = |_: &_| {
            left -= 1;
            left > 0
        };
        driver.warm_up(query, again).unwrap();
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
// One more is under way when there are enough.
const ASKED: usize = 50;
const DONE: usize = ASKED + 1;

#[test]
fn frames_are_the_same_whatever_was_warmed_up() {
    for (update, predict) in ALL {
        let (plain, log) = run(update, predict, 0);
        let (after, more) = run(update, predict, ASKED);
        assert_eq!(facts(&plain), facts(&after), "{update:?}");
        assert_eq!(log.trees, more.trees, "{update:?}");
        assert_eq!(more.made.len(), log.made.len(), "{update:?}");
        assert_eq!(more.interpolated, log.interpolated, "{update:?}");
        assert_eq!(more.refitted, log.refitted, "{update:?}");
        assert_eq!(more.traced.len(), log.traced.len() + DONE, "{update:?}");
        let again = &more.traced[1..=DONE];
        assert!(again.iter().all(|&t| t == more.traced[0]), "{update:?}");
    }
}
