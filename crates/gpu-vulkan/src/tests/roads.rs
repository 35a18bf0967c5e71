//! Vertices on their way down and trees on their way up, beside the frames.

use super::scenes::{
    SHADOWED, arrive, bits, camera, device, go, hits, open, positions, stand, swarm, tree_at,
};
use crate::VulkanBackend;
use crate::memory::{Buffer, BufferUse};
use crate::timeline::Timeline;
use crate::transfer::{Copy, Transfer};
use backend::{Backend, Generation, Inspect, Rays};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

pub(super) fn requests_of_several_submissions_are_answered_in_their_order() {
    let mut backend = device();
    let animation = swarm(20_000);
    open(&mut *backend, &animation);
    assert!(backend.take_positions().unwrap().is_none());
    let mut asked = VecDeque::new();
    for frame in 0..7 {
        let time = 0.25 * f64::from(frame);
        stand(&mut *backend, &animation, time);
        backend.request_positions().unwrap();
        if frame % 2 == 1 {
            // Nor may what is recorded after the request disturb it.
            stand(&mut *backend, &animation, time + 0.05);
            stand(&mut *backend, &animation, time + 0.06);
        }
        asked.push_back((backend.submit().unwrap(), time));
        let Some(&(ticket, _)) = asked.back() else {
            panic!("just asked")
        };
        assert_eq!(backend.wait(ticket).unwrap().readback_bytes, 20_000 * 36);
    }
    let mut held = Vec::new();
    while let Some((ticket, time)) = asked.pop_front() {
        let (from, snapshot) = arrive(&mut *backend);
        assert_eq!(from, ticket);
        assert!(
            bits(&snapshot) == bits(&positions(&animation, time)),
            "{time}"
        );
        held.push(snapshot);
    }
    assert!(backend.take_positions().unwrap().is_none());
}

#[test]
#[should_panic(expected = "one request of positions a submission")]
fn a_submission_holds_one_request() {
    let Some(mut backend) = device() else {
        panic!("one request of positions a submission")
    };
    let animation = swarm(3);
    open(&mut *backend, &animation);
    backend.interpolate(animation.pose(0.0)).unwrap();
    backend.request_positions().unwrap();
    let _ = backend.request_positions();
}

pub(super) fn a_snapshot_outlives_the_backend() {
    let mut backend = device();
    let animation = swarm(100);
    open(&mut *backend, &animation);
    stand(&mut *backend, &animation, 0.25);
    backend.request_positions().unwrap();
    backend.submit().unwrap();
    let (_, snapshot) = arrive(&mut *backend);
    let expected = bits(&backend.positions().unwrap());
    drop(backend);
    // The last user of the device lets go of it on a thread that ends then.
    let elsewhere = std::thread::spawn(move || bits(&snapshot));
    assert!(elsewhere.join().unwrap() == expected);
}

/// Bars a road until the gate opens.
fn bar(road: &mut Transfer, gate: &Timeline, from: &Buffer, to: &Buffer) {
    let copy = Copy {
        from,
        to,
        to_at: 0,
        bytes: 16,
    };
    road.start(copy, Some(gate.at(1))).unwrap();
}

/// Why a device cannot show that copies up and down have queues of their own.
pub(super) fn lacks_queues(backend: &VulkanBackend) -> Option<String> {
    let gpu = &backend.gpu;
    let own = |queue| queue != gpu.compute;
    let three = own(gpu.upload) && own(gpu.readback) && gpu.upload != gpu.readback;
    (!three).then(|| "all work stands in one queue".to_owned())
}

pub(super) fn positions_on_their_way_are_not_written_over() {
    let mut backend = device();
    let gpu = Arc::clone(&backend.gpu);
    let animation = swarm(5000);
    open(&mut *backend, &animation);
    let gate = Timeline::new(&gpu).unwrap();
    let [from, to] = [0, 1].map(|_| Buffer::new(&gpu, "a bar", 16, BufferUse::Device).unwrap());
    bar(&mut backend.readback, &gate, &from, &to);
    for time in [0.1, 0.2] {
        stand(&mut *backend, &animation, time);
        backend.request_positions().unwrap();
        backend.submit().unwrap();
    }
    // Both position buffers are still to be read.
    stand(&mut *backend, &animation, 0.3);
    let third = backend.submit().unwrap();
    std::thread::sleep(Duration::from_millis(200));
    let early = backend.frames.is_done(third).unwrap();
    gate.signal(1);
    assert!(!early);
    for time in [0.1, 0.2] {
        let (_, snapshot) = arrive(&mut *backend);
        assert!(bits(&snapshot) == bits(&positions(&animation, time)));
    }
    backend.wait(third).unwrap();
}

pub(super) fn frames_go_on_though_nothing_comes_down_or_goes_up() {
    let mut backend = device();
    let gpu = Arc::clone(&backend.gpu);
    let (animation, camera) = (swarm(5000), camera());
    open(&mut *backend, &animation);
    stand(&mut *backend, &animation, 0.0);
    let ticket = go(&mut *backend, Rays::Camera(&camera), SHADOWED);
    backend.wait(ticket).unwrap();

    let gate = Timeline::new(&gpu).unwrap();
    let [from, to] = [0, 1].map(|_| Buffer::new(&gpu, "a bar", 16, BufferUse::Device).unwrap());
    bar(&mut backend.readback, &gate, &from, &to);
    stand(&mut *backend, &animation, 0.4);
    backend.request_positions().unwrap();
    let asked = go(&mut *backend, Rays::Camera(&camera), SHADOWED);
    for frame in 0..5 {
        stand(&mut *backend, &animation, 0.5 + 0.1 * f64::from(frame));
        let ticket = go(&mut *backend, Rays::Camera(&camera), SHADOWED);
        let report = backend.wait(ticket).unwrap();
        assert!(report.hits > 0 && backend.take_positions().unwrap().is_none());
    }
    // A tree is adopted without a wait; frames before it are not delayed by it.
    bar(&mut backend.upload, &gate, &from, &to);
    stand(&mut *backend, &animation, 1.5);
    let before = go(&mut *backend, Rays::Camera(&camera), SHADOWED);
    let tree = tree_at(&animation, 1.5);
    backend.adopt(&tree, Generation(2)).unwrap();
    backend.preprocess().unwrap();
    backend.refit().unwrap();
    let after = go(&mut *backend, Rays::Camera(&camera), SHADOWED);
    assert!(backend.wait(before).unwrap().hits > 0);
    let early = backend.frames.is_done(after).unwrap();
    gate.signal(1);
    assert!(!early);
    assert!(hits(&mut *backend, after) == hits(&mut *backend, before));
    let (from, snapshot) = arrive(&mut *backend);
    assert_eq!(from, asked);
    assert!(bits(&snapshot) == bits(&positions(&animation, 0.4)));
}
