//! Submissions: how many may be under way, how long they are remembered, when they ran.

use super::scenes::{
    SHADOWED, camera, device, go, hits, open, open_laid, rays, stand, swarm, tree_at,
};
use backend::{Backend, FRAMES_IN_FLIGHT, Generation, Layout, QueryKind, Rays, Ticket};

pub(super) fn no_more_submissions_are_under_way_than_may_be() {
    let mut backend = device();
    let (animation, camera) = (swarm(2000), camera());
    open(&mut *backend, &animation);
    for frame in 0..8 {
        stand(&mut *backend, &animation, 0.2 * f64::from(frame));
        let Ticket(number) = go(&mut *backend, Rays::Camera(&camera), SHADOWED);
        assert!(backend.frames.under_way().count() <= FRAMES_IN_FLIGHT);
        let older = Ticket(number - FRAMES_IN_FLIGHT as u64);
        assert!(backend.frames.is_done(older).unwrap(), "{number}");
    }
}

pub(super) fn results_last_for_two_more_traces() {
    let mut backend = device();
    let (animation, camera) = (swarm(300), camera());
    open(&mut *backend, &animation);
    let times = [0.0, 0.5, 1.2, 1.9, 0.7, 1.4];
    let mut alone = Vec::new();
    for time in times {
        stand(&mut *backend, &animation, time);
        let ticket = go(&mut *backend, Rays::Camera(&camera), SHADOWED);
        alone.push(hits(&mut *backend, ticket));
    }
    // Nobody waits, and many submissions without a trace come between.
    let mut tickets = Vec::new();
    for (i, &time) in times.iter().enumerate() {
        stand(&mut *backend, &animation, time);
        tickets.push(go(&mut *backend, Rays::Camera(&camera), SHADOWED));
        for _ in 0..9 {
            stand(&mut *backend, &animation, 0.1);
            backend.submit().unwrap();
        }
        // Another trace in the making takes nothing away.
        if i == 5 {
            stand(&mut *backend, &animation, 0.3);
        }
    }
    for i in [5, 3, 4, 3] {
        assert!(hits(&mut *backend, tickets[i]) == alone[i], "trace {i}");
        let count = alone[i].closest.iter().filter(|h| h.is_hit()).count();
        assert_eq!(backend.wait(tickets[i]).unwrap().hits, count as u64);
    }
}

pub(super) fn times_begin_one_after_the_other_by_one_clock() {
    let mut backend = device();
    let (animation, camera) = (swarm(2000), camera());
    // `preprocess` waits for `interpolate`; the other does not.
    open(&mut *backend, &animation);
    stand(&mut *backend, &animation, 0.1);
    let ticket = go(&mut *backend, Rays::Camera(&camera), SHADOWED);
    let times = backend.wait(ticket).unwrap().times;
    assert!(times.interpolate_ms.is_some() && times.preprocess_ms.is_some());
    open_laid(&mut *backend, &animation, Layout::Fast);
    let mut tickets = Vec::new();
    let mut ends = 0.0;
    for frame in 0..6 {
        stand(&mut *backend, &animation, 0.3 * f64::from(frame));
        tickets.push(go(&mut *backend, Rays::Camera(&camera), SHADOWED));
        if frame % 3 == 2 {
            for ticket in tickets.drain(..) {
                let times = backend.wait(ticket).unwrap().times;
                let stages = [times.preprocess_ms, times.refit_ms, times.trace_primary_ms];
                assert_eq!(times.interpolate_ms, None, "it ran beside preprocess");
                assert_eq!(times.trace_shadow_ms, None, "both are traced together");
                let sum: f64 = stages.iter().map(|t| t.unwrap()).sum();
                assert!(sum > 0.0 && sum <= times.device_ms * 1.0001, "{times:?}");
                let begun = times.begun_ms.unwrap();
                assert!(begun >= ends, "{begun} {ends}");
                ends = (begun + times.device_ms) * 0.999_999;
            }
        }
    }
    let ticket = backend.submit().unwrap();
    assert_eq!(backend.wait(ticket).unwrap().times.begun_ms, None);
}

pub(super) fn another_scene_forgets_the_first() {
    let mut backend = device();
    let (first, second) = (swarm(500), swarm(30));
    let mut held = Vec::new();
    for animation in [&second, &first, &second, &first] {
        open(&mut *backend, animation);
        held.push(backend.device_bytes().unwrap().total());
        assert!(backend.take_positions().unwrap().is_none());
        stand(&mut *backend, animation, 0.5);
        let ticket = go(&mut *backend, Rays::List(&rays(64)), QueryKind::Closest);
        assert_eq!(hits(&mut *backend, ticket).closest.len(), 64);
        // Left under way, with a recording begun, for the next scene to drop.
        stand(&mut *backend, animation, 0.6);
        backend.request_positions().unwrap();
        backend.submit().unwrap();
        backend.interpolate(animation.pose(0.7)).unwrap();
    }
    // Nodes and records alone take 112 bytes a triangle.
    assert!(held[1] > held[0] + 400 * 112, "{held:?}");
    assert!(
        held[3] >= held[1] && held[3] < held[1] + held[0],
        "{held:?}"
    );
}

pub(super) fn steady_frames_make_no_buffers() {
    Layout::ALL.into_iter().for_each(buffers_of_steady_frames);
}

fn buffers_of_steady_frames(layout: Layout) {
    let mut backend = device();
    let (animation, camera) = (swarm(1000), camera());
    open_laid(&mut *backend, &animation, layout);
    let trees = [0.0, 0.7, 1.5].map(|time| tree_at(&animation, time));
    let mut made = 0;
    for frame in 0..30_u64 {
        if frame % 3 == 1 {
            let tree = &trees[frame as usize / 3 % 3];
            backend.adopt(tree, Generation(2 + frame)).unwrap();
        }
        stand(&mut *backend, &animation, 0.06 * frame as f64);
        if frame % 3 == 0 {
            backend.request_positions().unwrap();
        }
        let ticket = go(&mut *backend, Rays::Camera(&camera), SHADOWED);
        let found = hits(&mut *backend, ticket);
        assert!(found.closest.iter().any(|h| h.is_hit()));
        if frame % 3 == 0 {
            super::scenes::arrive(&mut *backend);
        }
        if frame == 9 {
            made = backend.gpu.memory.made();
        }
    }
    assert_eq!(backend.gpu.memory.made(), made);
}

pub(super) fn a_backend_may_be_dropped_at_any_moment() {
    let mut backend = device();
    let animation = swarm(2000);
    open(&mut *backend, &animation);
    stand(&mut *backend, &animation, 0.5);
    backend.request_positions().unwrap();
    go(&mut *backend, Rays::Camera(&camera()), SHADOWED);
    backend
        .adopt(&tree_at(&animation, 0.5), Generation(2))
        .unwrap();
    stand(&mut *backend, &animation, 0.6);
    backend.request_positions().unwrap();
}
