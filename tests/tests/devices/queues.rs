//! Tests of Vulkan only: layers, adapters, and copies of vertices and trees on queues of their own.

use crate::open_vulkan;
use crate::scenes::{
    SHADOWED, bits, camera, hits, interpolate_and_refit, open, positions, rays, submit_trace,
    swarm, trace, tree_at, wait_for_positions,
};
use backend::{Backend, BackendError, FRAMES_IN_FLIGHT, Generation, QueryKind, Rays, Ticket};
use geom::Animation;
use gpu_common::{Options, Validation};
use gpu_vulkan::VulkanBackend;
use gpu_vulkan::memory::{Buffer, BufferUse};
use gpu_vulkan::timeline::Timeline;
use gpu_vulkan::transfer::{BufferCopy, Transfer};
use std::sync::Arc;
use std::time::Duration;

pub(crate) fn required_validation_is_active_or_reported() {
    let options = Options {
        validation: Validation::Required,
        ..Options::default()
    };
    match gpu_vulkan::open(&options) {
        Ok(b) => assert!(b.gpu().gpu.instance.is_validated),
        Err(e) => assert!(matches!(e, BackendError::NoDevice(_)), "{e}"),
    }
    let plain = gpu_vulkan::open(&Options::default()).unwrap();
    assert!(!plain.gpu().gpu.instance.is_validated);
}

pub(crate) fn every_adapter_lists_its_limits() {
    for adapter in gpu_vulkan::adapters().unwrap() {
        let value = |name| {
            let found = adapter.limits.iter().find(|(n, _)| *n == name);
            found.map(|(_, value)| value.as_str())
        };
        for name in [
            "max workgroup size",
            "timestamp period ns",
            "transfer queues",
        ] {
            assert!(value(name).is_some_and(|v| !v.is_empty()), "{name}");
        }
        let range: u64 = value("max storage buffer bytes").unwrap().parse().unwrap();
        assert!(range > 0 && !adapter.name.is_empty());
    }
}

pub(crate) fn large_host_buffers_import_process_pages() {
    let mut backend = open_vulkan().unwrap();
    let gpu = Arc::clone(&backend.gpu().gpu);
    let words: Vec<u32> = (0..1 << 18).collect();
    let bytes = size_of_val(&words[..]) as u64;
    let made = |place| Buffer::new(&gpu, "words", bytes, place).unwrap();
    let uses = [BufferUse::Staging, BufferUse::Device, BufferUse::Readback];
    let [mut from, there, to] = uses.map(made);
    from.write(0, &words);
    let readback = &mut backend.gpu_mut().readback;
    for (from, to) in [(&from, &there), (&there, &to)] {
        let copy = BufferCopy::between(from.vk, to.vk).range(0..bytes, 0);
        readback.start(&copy, &[]).unwrap();
        readback.wait().unwrap();
    }
    assert!(to.read::<u32>(words.len()) == words);
    let is_offered = gpu
        .features
        .sharing
        .contains(&c"VK_EXT_external_memory_host");
    let imported = [&from, &there, &to].map(Buffer::is_imported);
    assert_eq!(imported, [is_offered, false, is_offered]);
    let small = Buffer::new(&gpu, "a few words", bytes - 16, BufferUse::Staging);
    assert!(!small.unwrap().is_imported());
}

/// Blocks a transfer queue until `gate` reaches 1.
fn block_queue(queue: &mut Transfer, gate: &Timeline, from: &Buffer, to: &Buffer) {
    let copy = BufferCopy::between(from.vk, to.vk).range(0..16, 0);
    queue.start(&copy, &[gate.at(1)]).unwrap();
}

/// Returns the reason if the device has no separate queues for uploads and downloads.
pub(crate) fn lacks_queues() -> Option<String> {
    let backend = open_vulkan().ok()?;
    let three = backend.gpu().has_queues_for_copies();
    (!three).then(|| "the device has no separate transfer queues".to_owned())
}

/// Returns whether a submission is done. Never waits.
fn is_done(backend: &VulkanBackend, ticket: Ticket) -> bool {
    backend.gpu().done.has_reached(ticket.0).unwrap()
}

pub(crate) fn submissions_in_flight_are_bounded() {
    let mut backend = open_vulkan().unwrap();
    let (animation, camera) = (swarm(2000), camera());
    open(&mut backend, &animation);
    for frame in 0..8 {
        interpolate_and_refit(&mut backend, &animation, 0.2 * f64::from(frame));
        let Ticket(number) = submit_trace(&mut backend, Rays::Camera(&camera), SHADOWED);
        let older = Ticket(number - FRAMES_IN_FLIGHT as u64);
        assert!(is_done(&backend, older), "{number}");
    }
}

/// Checks key frames in memory that the device reads directly. The memory is reused once no submission reads it.
pub(crate) fn shared_key_frames_equal_copied_ones() {
    let mut backend = open_vulkan().unwrap();
    let scene = swarm(300);
    let list = rays(200);
    let found = [false, true].map(|is_shared| {
        let first = scene.first().to_vec();
        let marks = vec![false; first.len()];
        let triangles = scene.triangles().to_vec();
        let streamed = Arc::new(Animation::streamed(first, &marks, triangles).unwrap());
        open(&mut backend, &streamed);
        let frames = (1..12).map(|frame| {
            let spare = streamed.spare_frame();
            let mut memory = spare.unwrap_or_else(|| {
                let count = streamed.vertex_count();
                if is_shared {
                    backend.gpu_mut().point_buffer(count).unwrap()
                } else {
                    vec![[0.0; 3]; count].into()
                }
            });
            let moved = positions(&scene, 0.15 * f64::from(frame));
            memory.copy_from_slice(&moved);
            let time = streamed.push(memory).unwrap();
            interpolate_and_refit(&mut backend, &streamed, time);
            trace(&mut backend, Rays::List(&list), QueryKind::Closest)
        });
        frames.collect::<Vec<_>>()
    });
    assert!(found[0] == found[1] && found[0][0] != found[0][10]);
}

pub(crate) fn pending_readbacks_are_not_overwritten() {
    let mut backend = open_vulkan().unwrap();
    let gpu = Arc::clone(&backend.gpu().gpu);
    let animation = swarm(5000);
    open(&mut backend, &animation);
    let gate = Timeline::new(&gpu).unwrap();
    let [from, to] =
        [0, 1].map(|_| Buffer::new(&gpu, "a blocked copy", 16, BufferUse::Device).unwrap());
    block_queue(&mut backend.gpu_mut().readback, &gate, &from, &to);
    for time in [0.1, 0.2] {
        interpolate_and_refit(&mut backend, &animation, time);
        backend.request_positions().unwrap();
        backend.submit().unwrap();
    }
    // Neither position buffer has been read back yet.
    interpolate_and_refit(&mut backend, &animation, 0.3);
    let third = backend.submit().unwrap();
    std::thread::sleep(Duration::from_millis(200));
    let early = is_done(&backend, third);
    gate.signal(1).unwrap();
    assert!(!early);
    for time in [0.1, 0.2] {
        let (_, snapshot) = wait_for_positions(&mut backend);
        assert!(bits(&snapshot) == bits(&positions(&animation, time)));
    }
    backend.wait(third).unwrap();
}

pub(crate) fn frames_continue_during_blocked_copies() {
    let mut backend = open_vulkan().unwrap();
    let gpu = Arc::clone(&backend.gpu().gpu);
    let (animation, camera) = (swarm(5000), camera());
    open(&mut backend, &animation);
    interpolate_and_refit(&mut backend, &animation, 0.0);
    let ticket = submit_trace(&mut backend, Rays::Camera(&camera), SHADOWED);
    backend.wait(ticket).unwrap();

    let gate = Timeline::new(&gpu).unwrap();
    let [from, to] =
        [0, 1].map(|_| Buffer::new(&gpu, "a blocked copy", 16, BufferUse::Device).unwrap());
    block_queue(&mut backend.gpu_mut().readback, &gate, &from, &to);
    interpolate_and_refit(&mut backend, &animation, 0.4);
    backend.request_positions().unwrap();
    let asked = submit_trace(&mut backend, Rays::Camera(&camera), SHADOWED);
    for frame in 0..5 {
        interpolate_and_refit(&mut backend, &animation, 0.5 + 0.1 * f64::from(frame));
        let ticket = submit_trace(&mut backend, Rays::Camera(&camera), SHADOWED);
        let report = backend.wait(ticket).unwrap();
        assert!(report.hits > 0 && backend.take_positions().unwrap().is_none());
    }
    // Adopting a tree does not wait, and earlier frames are not delayed.
    block_queue(&mut backend.gpu_mut().upload, &gate, &from, &to);
    interpolate_and_refit(&mut backend, &animation, 1.5);
    let before = submit_trace(&mut backend, Rays::Camera(&camera), SHADOWED);
    let tree = tree_at(&animation, 1.5);
    backend.adopt(&tree, Generation(2)).unwrap();
    backend.preprocess().unwrap();
    backend.refit().unwrap();
    let after = submit_trace(&mut backend, Rays::Camera(&camera), SHADOWED);
    assert!(backend.wait(before).unwrap().hits > 0);
    let early = is_done(&backend, after);
    gate.signal(1).unwrap();
    assert!(!early);
    assert!(hits(&mut backend, after) == hits(&mut backend, before));
    let (from, snapshot) = wait_for_positions(&mut backend);
    assert_eq!(from, asked);
    assert!(bits(&snapshot) == bits(&positions(&animation, 0.4)));
}

/// Checks that a key frame is not overwritten while a submission without an interpolation waits to read it.
pub(crate) fn key_frames_of_waiting_submission_are_kept() {
    let mut backend = open_vulkan().unwrap();
    let gpu = Arc::clone(&backend.gpu().gpu);
    let (scene, camera) = (swarm(300), camera());
    let triangles = scene.triangles().to_vec();
    let source = move |key: usize| scene.key(key % 3).map(|frame| frame.to_vec());
    let paged = Animation::paged(Arc::new(source), 5, 4, triangles);
    let paged = Arc::new(paged.unwrap());
    open(&mut backend, &paged);
    interpolate_and_refit(&mut backend, &paged, 0.5);
    let expected = trace(&mut backend, Rays::Camera(&camera), SHADOWED);
    let gate = Arc::new(Timeline::new(&gpu).unwrap());
    backend.gpu_mut().synchronize(&gate, 1, 2).unwrap();
    let tree = tree_at(&paged, 1.0);
    backend.adopt(&tree, Generation(2)).unwrap();
    backend.preprocess().unwrap();
    backend.refit().unwrap();
    let waiting = submit_trace(&mut backend, Rays::Camera(&camera), SHADOWED);
    // Fills the memory of key frames, so that the next key frame replaces the first one.
    backend.interpolate(paged.pose(2.5)).unwrap();
    backend.submit().unwrap();
    backend.interpolate(paged.pose(4.0)).unwrap();
    backend.gpu_mut().upload.wait().unwrap();
    gate.signal(1).unwrap();
    assert!(hits(&mut backend, waiting) == expected);
}
