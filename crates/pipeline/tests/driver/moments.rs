//! When things happen: who waits for whom, and in what order.

use crate::fake::Gate;
use crate::{drifting, run, run_paced};
use pipeline::{FrameRecord, Pace, Update};
use std::sync::Arc;

/// Records of frames whose builder gets nowhere until `held` more frames are rendered.
fn beside_a_slow_builder(frames: u64, held: u64) -> Vec<FrameRecord> {
    let gate = Some(Arc::new(Gate::new(held)));
    let update = Update::Async(Pace::Free);
    let by = (update, false);
    run_paced(&drifting(200), (frames, |_| 1), by, (Some(1), gate)).records
}

/// If a frame waited for the builder, each would wait for the other, and trees adopted later would be young.
#[test]
fn frames_go_on_while_the_builder_waits_for_them() {
    let records = beside_a_slow_builder(100, 20);
    assert_eq!(records.len(), 100);
    let mut adopted = 0;
    for r in &records[1..] {
        let Some(tree) = r.adopted else { continue };
        adopted += 1;
        assert!(r.tree_age_frames >= 20, "{r:?}");
        let (handed_over, ended) = (tree.moments.arrived, tree.moments.build.ended);
        let beside = |f: &&FrameRecord| handed_over < f.moments.begun && f.moments.seen < ended;
        assert!(records.iter().filter(beside).count() >= 17, "{r:?}");
    }
    assert!(adopted >= 2, "{adopted}");
    assert!(records[0].build_wait_ms > 0.0);
    assert!(records[1..].iter().all(|r| r.build_wait_ms == 0.0));
}

#[test]
fn only_those_who_want_a_tree_of_their_own_or_a_fixed_age_wait_for_it() {
    let refit = run(30, 20, Update::Refit, Some(0)).records;
    assert!(refit[1..].iter().all(|r| r.build_wait_ms == 0.0));
    let rebuild = run(30, 20, Update::Rebuild, Some(0)).records;
    let waits = |r: &FrameRecord| 0.0 < r.build_wait_ms && r.build_wait_ms <= r.wall_ms;
    assert!(rebuild.iter().all(waits), "{rebuild:?}");
    // Vertices take more polls to arrive than there are frames to swap in.
    let lockstep = run(30, 24, Update::Async(Pace::Lockstep(2)), Some(9)).records;
    for r in lockstep {
        assert_eq!(r.build_wait_ms > 0.0, r.adopted.is_some(), "{r:?}");
        assert!(r.build_wait_ms <= r.wall_ms);
    }
}

#[test]
fn moments_come_in_order_and_each_tree_adopted_was_asked_for() {
    for update in [
        Update::Rebuild,
        Update::Async(Pace::Free),
        Update::Async(Pace::Lockstep(3)),
    ] {
        let records = run(60, 50, update, Some(2)).records;
        for (i, r) in records.iter().enumerate() {
            let m = r.moments;
            let host = [m.begun, m.submitted, m.waited, m.seen, m.read];
            assert!(host.is_sorted(), "{update:?} {i}");
            let device = [m.begun, r.traced.handed_in, m.submitted, r.traced.seen];
            assert!(device.is_sorted() && r.traced.seen == m.seen);
            let Some(tree) = r.adopted else { continue };
            let (t, b) = (tree.moments, tree.moments.build);
            let [before, after] = [[t.asked, t.arrived], [t.taken, t.adopted]];
            let build = [b.begun, b.built, b.weighed, b.ended];
            let way = [&before[..], &build, &after, &[m.submitted]].concat();
            assert!(way.is_sorted() && m.begun <= t.taken, "{update:?} {i}");
            assert_eq!((tree.triangles, tree.snapshot_bytes), (2, 72));
            let asking = &records[i - r.tree_age_frames as usize];
            assert_eq!(asking.asked, Some(r.tree_generation));
            assert!(asking.moments.begun <= t.asked && t.asked <= asking.moments.submitted);
        }
    }
}
