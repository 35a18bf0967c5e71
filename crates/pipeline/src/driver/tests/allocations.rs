//! After the first frames, the frame loop allocates no heap memory with `refit` and `async`, and hardly any in
//! lockstep.
//!
//! Builders allocate memory on their own threads. Only allocations of the rendering thread are counted.

#![expect(unsafe_code, reason = "an allocator that counts")]

use super::*;
use backend::Snapshot;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// Counts the allocations of each thread.
struct Counting;

// SAFETY: every call is forwarded to the system's allocator; counting allocates no memory itself.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|n| n.set(n.get() + 1));
        // SAFETY: the caller guarantees what `GlobalAlloc` requires, and the system's allocator requires the same.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.with(|n| n.set(n.get() + 1));
        // SAFETY: as above.
        unsafe { System.realloc(at, layout, size) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Returns each frame's number of allocations since the end of the previous frame, and the number of adopted trees.
fn allocations_per_frame(by: Config) -> (Vec<u64>, usize) {
    const FRAMES: u64 = 400;
    let animation = shuffled(2, 512);
    let mut fake = Fake::new(Some(0));
    let snapshot = |_| Box::new(animation.first().to_vec()) as Snapshot;
    fake.prepared = Some((0..=FRAMES).map(snapshot).collect());
    let mut driver = driver(fake, &animation, by).unwrap();
    let query = query(QueryKind::Closest);
    let (mut all, mut trees) = (Vec::with_capacity(FRAMES as usize), 0);
    let mut last = ALLOCATIONS.get();
    let frames = (0..FRAMES).map(|index| Frame {
        index,
        time: index as f64 / FRAMES as f64,
    });
    let run =
        driver.run::<PipelineError>(frames, query, OutputSelection::default(), |record, _| {
            trees += usize::from(record.tree.adopted);
            std::thread::sleep(Duration::from_micros(250));
            let now = ALLOCATIONS.get();
            all.push(now - last);
            last = now;
            Ok(())
        });
    run.unwrap();
    (all, trees)
}

#[test]
fn steady_frames_do_not_allocate() {
    let before = ALLOCATIONS.get();
    drop(std::hint::black_box(vec![0_u8; 9]));
    assert_eq!(
        ALLOCATIONS.get(),
        before + 1,
        "the counting allocator is not in use"
    );
    let async_policy = Policy::Async;
    // A thread that waits on a channel is registered there, which allocates memory the first time.
    for (update, predict, least, allowed) in [
        (Policy::Refit, true, 1, 0),
        (async_policy, true, 4, 0),
        (async_policy, false, 4, 0),
        (Policy::Lockstep(3), true, 100, 4),
    ] {
        let (all, trees) = allocations_per_frame((update, predict));
        assert!(trees >= least, "{update:?} {predict}: {trees} trees");
        // The builder thread starts with its first job, within the first 20 frames.
        let late: u64 = all[20..].iter().sum();
        assert!(late <= allowed, "{update:?} {predict}: {late} times");
    }
}
