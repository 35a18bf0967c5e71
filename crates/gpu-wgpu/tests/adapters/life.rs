//! Frames, snapshots, scenes: what may be under way, and how it ends.

use crate::scenes::{
    self, SHADOWED, camera, go, hits, open, open_laid, rays, stand, swarm, tree_at,
};
use backend::{
    Backend, BackendError, Generation, Inspect, Layout, QueryKind, Rays, Snapshot, Ticket,
};
use geom::Point;
use gpu_vulkan::VulkanBackend;
use gpu_wgpu::{Options, WgpuBackend};
use libtest_mimic::Failed;
use std::time::{Duration, Instant};

pub(crate) fn arrive(backend: &mut WgpuBackend) -> Result<(Ticket, Snapshot), Failed> {
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(30) {
        if let Some(arrived) = backend.take_positions()? {
            return Ok(arrived);
        }
        std::thread::yield_now();
    }
    Err("the positions never arrived".into())
}

fn bits(points: &[Point]) -> Vec<[u32; 3]> {
    points.iter().map(|p| p.map(scenes::bits)).collect()
}

pub(crate) fn a_wrong_tree_is_refused_and_the_old_one_stays() -> Result<(), Failed> {
    let animation = swarm(50);
    let mut backend = WgpuBackend::new(&Options::default())?;
    open(&mut backend, &animation)?;
    let other = tree_at(&swarm(40), 0.0);
    let refused = backend.adopt(&other, Generation(2));
    assert!(
        matches!(refused, Err(BackendError::WrongTree(_))),
        "{refused:?}"
    );
    stand(&mut backend, &animation, 0.5)?;
    let ticket = go(&mut backend, Rays::List(&rays(8)), QueryKind::Closest)?;
    hits(&mut backend, ticket)?;
    Ok(())
}

pub(crate) fn snapshots_hold_the_vertices_of_their_frame() -> Result<(), Failed> {
    let animation = swarm(20_000);
    let mut backend = WgpuBackend::new(&Options::default())?;
    open(&mut backend, &animation)?;
    assert!(backend.take_positions()?.is_none());
    let mut held = Vec::new();
    for frame in 0..6 {
        let time = 0.3 * f64::from(frame);
        stand(&mut backend, &animation, time)?;
        backend.request_positions()?;
        if frame == 4 {
            // Nor may what is recorded after the request.
            backend.interpolate(animation.pose(time + 0.05))?;
        }
        let ticket = backend.submit()?;
        // Frames that follow at once must not disturb it.
        stand(&mut backend, &animation, time + 0.1)?;
        backend.submit()?;
        stand(&mut backend, &animation, time + 0.2)?;
        backend.submit()?;
        let (from, snapshot) = arrive(&mut backend)?;
        assert_eq!(from, ticket);
        assert_eq!(backend.wait(ticket)?.readback_bytes, 20_000 * 36);
        let pose = animation.pose(time);
        let expected: Vec<Point> = (0..60_000).map(|v| animation.vertex(pose, v)).collect();
        assert!(bits(&snapshot) == bits(&expected), "frame {frame}");
        held.push(snapshot);
        if frame % 2 == 1 {
            held.clear();
        }
    }
    Ok(())
}

pub(crate) fn a_snapshot_outlives_the_backend() -> Result<(), Failed> {
    let animation = swarm(100);
    let mut backend = WgpuBackend::new(&Options::default())?;
    open(&mut backend, &animation)?;
    stand(&mut backend, &animation, 0.25)?;
    backend.request_positions()?;
    backend.submit()?;
    let (_, snapshot) = arrive(&mut backend)?;
    let expected = bits(&backend.positions()?);
    drop(backend);
    let elsewhere = std::thread::spawn(move || bits(&snapshot));
    assert!(elsewhere.join().unwrap() == expected);
    Ok(())
}

pub(crate) fn results_last_for_two_more_traces() -> Result<(), Failed> {
    let (animation, camera) = (swarm(300), camera());
    let mut backend = WgpuBackend::new(&Options::default())?;
    open(&mut backend, &animation)?;
    let times = [0.0, 0.5, 1.2, 1.9, 0.7, 1.4];
    let mut alone = Vec::new();
    for time in times {
        stand(&mut backend, &animation, time)?;
        let ticket = go(&mut backend, Rays::Camera(&camera), SHADOWED)?;
        alone.push(hits(&mut backend, ticket)?);
    }
    // Nobody waits, and a submission without a trace comes between.
    let mut tickets = Vec::new();
    for time in times {
        stand(&mut backend, &animation, time)?;
        tickets.push(go(&mut backend, Rays::Camera(&camera), SHADOWED)?);
        stand(&mut backend, &animation, 0.1)?;
        backend.submit()?;
    }
    for i in [5, 3, 4, 3] {
        assert!(hits(&mut backend, tickets[i])? == alone[i], "trace {i}");
        let report = backend.wait(tickets[i])?;
        assert_eq!(
            report.hits,
            alone[i].closest.iter().filter(|h| h.is_hit()).count() as u64
        );
    }
    Ok(())
}

pub(crate) fn another_scene_forgets_the_first() -> Result<(), Failed> {
    forgets(&mut WgpuBackend::new(&Options::default())?)?;
    match VulkanBackend::new(&gpu_vulkan::Options::default()) {
        Ok(mut twin) => forgets(&mut twin),
        // Where wgpu reaches its adapter by Metal or DirectX 12.
        Err(_) => Ok(()),
    }
}

fn forgets(backend: &mut dyn Backend) -> Result<(), Failed> {
    let (first, second) = (swarm(500), swarm(30));
    for animation in [&second, &first, &second, &first] {
        open(backend, animation)?;
        assert!(backend.take_positions()?.is_none());
        stand(backend, animation, 0.5)?;
        let ticket = go(backend, Rays::List(&rays(64)), QueryKind::Closest)?;
        assert_eq!(hits(backend, ticket)?.closest.len(), 64);
        // Left under way, with a recording begun, for the next scene to drop.
        stand(backend, animation, 0.6)?;
        backend.request_positions()?;
        backend.submit()?;
        backend.interpolate(animation.pose(0.7))?;
    }
    Ok(())
}

pub(crate) fn stages_are_timed() -> Result<(), Failed> {
    Layout::ALL.into_iter().try_for_each(stages_of_layout)
}

fn stages_of_layout(layout: Layout) -> Result<(), Failed> {
    let animation = swarm(2000);
    let mut backend = WgpuBackend::new(&Options::default())?;
    open_laid(&mut backend, &animation, layout)?;
    stand(&mut backend, &animation, 0.5)?;
    let ticket = go(&mut backend, Rays::Camera(&camera()), SHADOWED)?;
    let times = backend.wait(ticket)?.times;
    let mut stages = vec![times.preprocess_ms, times.refit_ms, times.trace_primary_ms];
    match layout {
        Layout::Bvh2 => stages.push(times.interpolate_ms),
        Layout::Fast => assert_eq!(times.interpolate_ms, None, "it ran beside preprocess"),
    }
    assert_eq!(times.trace_shadow_ms, None, "both are traced together");
    if gpu_wgpu::adapters()?.iter().any(|a| a.has_timestamps) {
        let sum: f64 = stages.iter().map(|t| t.unwrap_or(f64::NAN)).sum();
        assert!(sum > 0.0 && sum <= times.device_ms * 1.0001, "{times:?}");
    } else {
        assert!(
            stages.iter().all(Option::is_none) && times.device_ms > 0.0,
            "{times:?}"
        );
    }
    let ticket = backend.submit()?;
    assert!(backend.wait(ticket)?.times.refit_ms.is_none());
    Ok(())
}

pub(crate) fn submissions_share_one_clock() -> Result<(), Failed> {
    let animation = swarm(500);
    let mut backend = WgpuBackend::new(&Options::default())?;
    open(&mut backend, &animation)?;
    let timed = gpu_wgpu::adapters()?.iter().any(|a| a.has_timestamps);
    let (mut tickets, begun) = (Vec::new(), Instant::now());
    for _ in 0..3 {
        stand(&mut backend, &animation, 0.5)?;
        tickets.push(go(&mut backend, Rays::Camera(&camera()), SHADOWED)?);
    }
    let mut before: Option<f64> = None;
    for ticket in &tickets {
        let times = backend.wait(*ticket)?.times;
        assert_eq!(times.begun_ms.is_some(), timed, "{times:?}");
        if let (Some(begun), Some(before)) = (times.begun_ms, before) {
            assert!(begun >= before, "a frame begins after the one before it");
        }
        before = times.begun_ms.map(|at| at + times.device_ms);
    }
    let wall_ms = begun.elapsed().as_secs_f64() * 1e3;
    let last = backend.wait(tickets[2])?.times.begun_ms;
    let span = last.zip(backend.wait(tickets[0])?.times.begun_ms);
    assert!(span.is_none_or(|(b, a)| b - a <= wall_ms), "milliseconds");
    // Nothing ran, so nothing began.
    let ticket = backend.submit()?;
    assert_eq!(backend.wait(ticket)?.times.begun_ms, None);
    Ok(())
}

pub(crate) fn a_whole_life_leaves_no_validation_message() -> Result<(), Failed> {
    for checked in [false, true] {
        let options = Options {
            validation: true,
            checked,
            ..Options::default()
        };
        let mut backend = WgpuBackend::new(&options)?;
        let animation = swarm(3000);
        open(&mut backend, &animation)?;
        for frame in 0..5 {
            stand(&mut backend, &animation, 0.4 * f64::from(frame))?;
            if frame % 2 == 0 {
                backend.request_positions()?;
            }
            go(&mut backend, Rays::Camera(&camera()), SHADOWED)?;
            backend.adopt(&tree_at(&animation, 0.4), Generation(2 + frame as u64))?;
        }
        let (_, held) = arrive(&mut backend)?;
        // Dropped with frames and positions under way and a recording begun.
        backend.interpolate(animation.pose(0.2))?;
        assert_eq!(backend.validation_messages(), [""; 0]);
        drop(backend);
        drop(held);
        let after = WgpuBackend::new(&options)?;
        assert_eq!(after.validation_messages(), [""; 0], "checked: {checked}");
    }
    Ok(())
}
