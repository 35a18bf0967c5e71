//! What is warmed up or repeated leaves no trace in the frames that count.

use crate::fake::{Fake, Log};
use crate::{drifting, driver, query, read};
use backend::{Generation, QueryKind};
use pipeline::{Frame, FrameRecord, Pace, PipelineError, Update, Wanted};

/// What a frame says that no clock decides.
type Facts = (Frame, u64, u64, Option<Generation>, [bool; 3]);

/// Those of frames, where so many trees more were made earlier.
fn facts(all: &[FrameRecord], earlier: usize) -> Vec<Facts> {
    let facts = |r: &FrameRecord| {
        let flags = [r.adopted.is_some(), r.made, r.rejected.is_some()];
        let tree = r.tree_generation.0 - earlier as u64;
        (r.frame, tree, r.tree_age_frames, r.asked, flags)
    };
    all.iter().map(facts).collect()
}

/// Runs frames, after the first of which so many traces are done uncounted, or so many frames.
fn run(
    update: Update,
    predict: bool,
    (repeats, mut left): (bool, usize),
) -> (Vec<FrameRecord>, Log) {
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
        let done = match repeats {
            true => driver.repeat(query, again),
            false => driver.warm_up(query, again),
        };
        done.unwrap();
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
fn frames_are_the_same_whatever_was_warmed_up_or_repeated() {
    for (update, predict) in ALL {
        let (plain, log) = run(update, predict, (false, 0));
        for repeats in [false, true] {
            let (after, more) = run(update, predict, (repeats, ASKED));
            // A repeated frame goes through all its stages; a tree that the device makes again has a number of its own.
            let stages = usize::from(repeats) * DONE;
            let made = usize::from(update == Update::DeviceRebuild) * stages;
            assert_eq!(facts(&plain[..1], 0), facts(&after[..1], 0), "{update:?}");
            assert_eq!(
                facts(&plain[1..], 0),
                facts(&after[1..], made),
                "{update:?}"
            );
            assert_eq!(log.trees, more.trees, "{update:?}");
            assert_eq!(more.made.len(), log.made.len() + made, "{update:?}");
            assert_eq!(more.interpolated, log.interpolated + stages, "{update:?}");
            assert_eq!(more.refitted, log.refitted + stages, "{update:?}");
            assert_eq!(more.traced.len(), log.traced.len() + DONE, "{update:?}");
            let (tree, pose) = more.traced[0];
            let again = &more.traced[1..=DONE];
            assert!(again.iter().all(|t| t.1 == pose), "{update:?}");
            assert!(made > 0 || again.iter().all(|t| t.0 == tree));
        }
    }
}
