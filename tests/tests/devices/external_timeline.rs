//! What is lent to a device, and when it is used.

use crate::external::words;
use crate::opened;
use crate::other_device::{Exported, Importer, OtherDevice};
use crate::scenes::{go, hits, open, rays, stand};
use crate::sheets::{sheet, triangles};
use backend::{Hits, QueryKind, Rays, Ticket};
use geom::{Animation, Point, PointBuffer};
use gpu_common::LentRays;
use gpu_vulkan::external::ExternalMemory;
use gpu_vulkan::memory::Buffer;
use gpu_vulkan::timeline::Timeline;
use gpu_vulkan::{VulkanBackend, VulkanDevice};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Lets a submission go on that waits for an odd value, after what happens meanwhile. It has the next value reached.
fn let_go(
    backend: &mut VulkanBackend,
    (timeline, value): (&Timeline, u64),
    ticket: Option<Ticket>,
    meanwhile: impl FnOnce(),
) -> Hits {
    backend.gpu_mut().signal().unwrap();
    std::thread::sleep(Duration::from_millis(200));
    let is_done = |Ticket(number)| backend.gpu().done.has_reached(number).unwrap();
    let early = ticket.is_some_and(is_done) || timeline.has_reached(value + 1).unwrap();
    meanwhile();
    if !timeline.has_reached(value).unwrap() {
        timeline.signal(value).unwrap();
    }
    assert!(!early);
    let begun = Instant::now();
    while !timeline.has_reached(value + 1).unwrap() {
        assert!(begun.elapsed() < Duration::from_secs(10), "no signal");
    }
    ticket
        .map(|ticket| hits(backend, ticket))
        .unwrap_or_default()
}

/// The host's hand stands for the other device's semaphore.
pub(crate) fn what_is_lent_is_used_between_two_values_of_a_timeline() {
    let mut backend = opened::<VulkanDevice>().unwrap();
    let gpu = Arc::clone(&backend.gpu().gpu);
    let [vertices, given] = [12 * 400, 32 * 500].map(|bytes| {
        let made = ExternalMemory::new(&gpu, bytes).unwrap();
        Arc::new(made)
    });
    let other = OtherDevice::open(vertices.device_uuid());
    let [to_vertices, to_rays] = [&vertices, &given].map(|memory| {
        other.import(Exported {
            fd: memory.fd().unwrap(),
            size: memory.bytes,
            allocation_size: memory.allocation_bytes,
            memory_type: memory.memory_type,
        })
    });
    let animation = Animation::live(sheet(0.0), &[false; 400], triangles()).unwrap();
    let animation = Arc::new(animation);
    open(&mut backend, &animation);
    let arrive = |backend: &mut VulkanBackend, points: Vec<Point>| {
        let time = animation.push(PointBuffer::from(points)).unwrap();
        stand(backend, &animation, time);
    };
    let (list, closest) = (rays(500), QueryKind::Closest);
    let [still, moved] = [0.5, 0.25].map(|height| {
        arrive(&mut backend, sheet(height));
        let ticket = go(&mut backend, Rays::List(&list), closest);
        hits(&mut backend, ticket)
    });
    assert!(still != moved);
    let timeline = Arc::new(Timeline::new(&gpu).unwrap());

    backend.gpu_mut().synchronize(&timeline, [1, 2]).unwrap();
    for values in [[2, 2], [1, 2], [3, 1]] {
        assert!(backend.gpu_mut().synchronize(&timeline, values).is_err());
    }
    backend.gpu_mut().lend_rays(LentRays {
        rays: Buffer::lent(&gpu, &given, 32 * 500).unwrap(),
        answers: None,
    });
    arrive(&mut backend, sheet(0.5));
    let ticket = go(&mut backend, Rays::OnDevice(500), closest);
    let seen = let_go(&mut backend, (&timeline, 1), Some(ticket), || {
        other.write(to_rays, 0, bytemuck::cast_slice(&list), None);
    });
    assert!(seen == still);

    let write = |height| other.write(to_vertices, 0, words(&sheet(height)), None);
    let bring = |backend: &mut VulkanBackend, values| {
        let device = backend.gpu_mut();
        device.synchronize(&timeline, values).unwrap();
        device.bring_points((0..400, 400), (&vertices, 0)).unwrap();
    };
    bring(&mut backend, [3, 4]);
    arrive(&mut backend, sheet(0.5));
    let ticket = go(&mut backend, Rays::List(&list), closest);
    let seen = let_go(&mut backend, (&timeline, 3), Some(ticket), || write(0.25));
    assert!(seen == moved);

    // Nor does a step without a query leave anything unread.
    bring(&mut backend, [5, 6]);
    let_go(&mut backend, (&timeline, 5), None, || write(0.75));
    write(0.25);
    let kept = backend.gpu_mut().read_points(&(0..400)).unwrap();
    assert!(kept == Some(sheet(0.75)));
    assert_eq!(backend.gpu().validation_messages(), [""; 0]);
}
