//! A backend that makes its trees itself: nobody builds beside it, and nothing is read back.

use crate::fake::{Fake, Log};
use crate::{drifting, query, read};
use backend::{Generation, QueryKind};
use pipeline::{Driver, Frame, Pace, PipelineError, Update, Wanted};
use std::sync::{Arc, Mutex};

fn driver(update: Update) -> (Result<Driver, PipelineError>, Arc<Mutex<Log>>) {
    let (mut fake, log) = Fake::new(Some(0), None);
    fake.own_trees = true;
    let animation = drifting(5);
    (crate::driver(fake, &animation, (update, false)), log)
}

/// Generations of the trees made over six frames, the third of which stands where the second did.
fn rebuilt(update: Update) -> Vec<u64> {
    let (driver, log) = driver(update);
    let mut driver = driver.unwrap();
    let query = query(QueryKind::Closest);
    let frames = [0.0, 0.5, 0.5, 1.0, 2.0, 3.0].into_iter();
    let frames = (0..).zip(frames).map(|(index, time)| Frame { index, time });
    let mut ages = Vec::new();
    driver
        .run(frames, query, Wanted::default(), |record, _| {
            ages.push(record.tree_age_frames);
            assert!(record.adopted.is_none() && record.fetched.is_none());
            Ok::<(), PipelineError>(())
        })
        .unwrap();
    assert!(!driver.has_builder());
    drop(driver);
    let log = read(log);
    assert_eq!((log.requested, log.adopted.len()), (0, 0));
    assert_eq!((log.interpolated, log.refitted), (5, 5));
    assert_eq!(log.traced.len(), ages.len());
    log.made.iter().map(|&Generation(g)| g).collect()
}

#[test]
fn each_frame_that_moved_has_a_tree_of_its_own_or_all_have_the_first() {
    assert_eq!(rebuilt(Update::Rebuild), [1, 2, 3, 4, 5]);
    assert_eq!(rebuilt(Update::DeviceRebuild), [1, 2, 3, 4, 5]);
    assert_eq!(rebuilt(Update::Refit), [1]);
}

#[test]
fn trees_built_beside_the_frames_are_refused() {
    for update in [Update::Async(Pace::Free), Update::TSah] {
        let refused = driver(update).0.err().unwrap().to_string();
        assert!(
            refused.starts_with("fake does not support update policy"),
            "{refused}"
        );
    }
}
