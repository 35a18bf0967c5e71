//! Tests vertices, rays and results in memory shared with another device, and the semaphore that orders accesses.

use crate::lent::{
    Found, Moved, OnHost, RaysOnDevice, Sheets, check_rays_match_host, check_vertices_match_host,
    check_vertices_survive_replacement, found, sheet, triangles, two_sheets,
};
use crate::open_vulkan;
use crate::other_device::{Exported, Importer, OtherDevice};
use crate::scenes::{hits, interpolate_and_refit, open, rays, submit_trace};
use abvh::external_memory::{ExternalBuffer, ExternalRays};
use abvh::{
    Device, Error, Intersector, MeshId, Point, Query, Ray, Scene, Source, Step, Tracer,
    TracerBuilder, Update,
};
use backend::{Backend, Hits, QueryKind, Rays, Ticket};
use geom::{Animation, PointBuffer};
use gpu_vulkan::external::ExternalMemory;
use gpu_vulkan::memory::Buffer;
use gpu_vulkan::timeline::Timeline;
use gpu_vulkan::{ExternalVertices, VulkanBackend};
use std::sync::Arc;
use std::time::{Duration, Instant};

fn builder() -> TracerBuilder {
    Tracer::builder().device(Device::Vulkan(None)).threads(2)
}

fn tracer(scene: Scene, update: Update) -> Tracer {
    builder().update(update).build(scene).unwrap()
}

/// Returns the reason if memory cannot be shared on this machine.
pub(crate) fn lacks() -> Option<String> {
    let memory = tracer(Scene::new(), Update::Async).external_buffer(16);
    memory.err().map(|e| e.to_string())
}

fn import<O: Importer>(other: &O, buffer: &ExternalBuffer) -> O::Memory {
    other.import(Exported {
        fd: buffer.fd().unwrap(),
        size: buffer.size(),
        allocation_size: buffer.allocation_size(),
        memory_type: buffer.memory_type(),
    })
}

/// Two sheets, and shared memory for the vertices of each, which start at `OFFSET`.
pub(crate) struct Shared<O: Importer> {
    pub(crate) other: O,
    pub(crate) tracer: Tracer,
    pub(crate) sheets: [MeshId; 2],
    pub(crate) memory: [(ExternalBuffer, O::Memory); 2],
}

pub(crate) const OFFSET: u64 = 20;

impl<O: Importer> Sheets for Shared<O> {
    fn open(update: Update) -> Self {
        let (scene, sheets) = two_sheets();
        let mut tracer = tracer(scene, update);
        let first = tracer.external_buffer(16).unwrap();
        let other = O::open(first.device_uuid());
        let memory = [0, 1].map(|_| {
            let buffer = tracer.external_buffer(OFFSET + 12 * 400).unwrap();
            let bytes = import(&other, &buffer);
            (buffer, bytes)
        });
        Self {
            other,
            tracer,
            sheets,
            memory,
        }
    }

    fn traced(&mut self) -> (&mut Tracer, [MeshId; 2]) {
        (&mut self.tracer, self.sheets)
    }

    /// Moves sheets from shared memory or from the host.
    fn moved(&mut self, moved: Moved) -> Step<'_> {
        let mut step = self.tracer.step(0.0);
        for i in [0, 1] {
            let Some((height, is_shared)) = moved[i] else {
                continue;
            };
            let (points, (buffer, bytes)) = (sheet(height), &self.memory[i]);
            let source = match is_shared {
                true => {
                    self.other.write(*bytes, OFFSET, as_bytes(&points));
                    let offset = OFFSET;
                    Source::External { buffer, offset }
                }
                false => Source::Host(&points),
            };
            step.vertices(self.sheets[i], source).unwrap();
        }
        step
    }
}

pub(crate) fn as_bytes(points: &[Point]) -> &[u8] {
    bytemuck::cast_slice(points)
}

pub(crate) fn reads_vertices_from_external_memory() {
    check_vertices_match_host::<Shared<OtherDevice>>();
}

pub(crate) fn external_vertices_survive_mesh_replacement() {
    check_vertices_survive_replacement::<Shared<OtherDevice>>();
}

/// Rays and results in memory shared with another device.
struct SharedRays<O: Importer> {
    other: O,
    tracer: Tracer,
    count: usize,
    /// Memory of the rays, then of the results.
    memory: [(ExternalBuffer, O::Memory); 2],
}

impl<O: Importer> SharedRays<O> {
    fn new(scene: Scene, rays: &[Ray], intersector: Intersector) -> Self {
        let builder = builder().update(Update::Async).intersector(intersector);
        let mut tracer = builder.build(scene).unwrap();
        let made = [0; 2].map(|_| tracer.external_buffer(size_of_val(rays) as u64));
        let made = made.map(Result::unwrap);
        let other = O::open(made[0].device_uuid());
        let memory = made.map(|buffer| {
            let bytes = import(&other, &buffer);
            (buffer, bytes)
        });
        other.write(memory[0].1, 0, bytemuck::cast_slice(rays));
        Self {
            other,
            tracer,
            count: rays.len(),
            memory,
        }
    }
}

impl<O: Importer> RaysOnDevice for SharedRays<O> {
    fn tracer(&mut self) -> &mut Tracer {
        &mut self.tracer
    }

    fn trace(&mut self, query: Query, has_results: bool) -> Vec<Found> {
        let [(rays, _), (results, _)] = &self.memory;
        let asked = ExternalRays {
            rays,
            count: self.count,
            results: has_results.then_some(results),
        };
        found(&mut self.tracer, query, |step| {
            step.trace_external(asked, query)
        })
    }

    fn fill_results(&mut self, byte: u8) {
        let (results, bytes) = &self.memory[1];
        let all = vec![byte; results.size() as usize];
        self.other.write(*bytes, 0, &all);
    }

    fn results(&mut self, words: usize) -> Vec<u32> {
        let read = self.other.read(self.memory[1].1, 4 * words);
        bytemuck::cast_slice(&read).to_vec()
    }
}

pub(crate) fn traces_rays_in_external_memory() {
    check_shared_rays::<OtherDevice>();
}

/// Checks that rays in shared memory have the hits of rays of the host, with both robust intersectors.
pub(crate) fn check_shared_rays<O: Importer>() {
    for intersector in [Intersector::Watertight, Intersector::Exact] {
        check_rays_match_host(|scene, rays| SharedRays::<O>::new(scene, rays, intersector));
    }
}

pub(crate) fn external_memory_misuse_is_an_error() {
    let open = || Shared::<OtherDevice>::open(Update::Async);
    let (mut own, other) = (open(), open());
    let (mesh, (buffer, _)) = (own.sheets[0], &own.memory[0]);
    let foreign = &other.memory[0].0;
    let small = own.tracer.external_buffer(64).unwrap();
    for (buffer, offset) in [
        (foreign, 0),
        (&small, 0),
        (buffer, OFFSET + 2),
        (buffer, buffer.size() - 12 * 400 + 4),
        (buffer, u64::MAX - 3),
    ] {
        let source = Source::External { buffer, offset };
        let said = own.tracer.step(0.0).vertices(mesh, source);
        assert!(matches!(said, Err(Error::Misuse(_))), "{offset} {said:?}");
    }
    for (rays, count, results) in [
        (foreign, 2, None),
        (&small, 3, None),
        (&small, usize::MAX, None),
        (buffer, 5, Some(&small)),
        (buffer, 2, Some(foreign)),
        (buffer, 2, Some(buffer)),
    ] {
        let asked = ExternalRays {
            rays,
            count,
            results,
        };
        let said = own.tracer.step(0.0).trace_external(asked, Query::Closest);
        assert!(matches!(said, Err(Error::Misuse(_))), "{count} {said:?}");
    }
    for bytes in [1 << 60, u64::MAX] {
        let said = own.tracer.external_buffer(bytes);
        assert!(matches!(said, Err(Error::Unsupported(_))), "{said:?}");
    }
    let host = Tracer::builder().device(Device::Cpu).build(Scene::new());
    let mut host = host.unwrap();
    let said = [
        host.external_buffer(64).err(),
        host.external_semaphore().err(),
    ];
    assert!(matches!(
        said,
        [Some(Error::Unsupported(_)), Some(Error::Unsupported(_))]
    ));
    // If semaphores are not supported, the error names the extension.
    if let Err(e) = own.tracer.external_semaphore() {
        assert!(
            e.to_string().contains("VK_KHR_external_semaphore_fd"),
            "{e}"
        );
    }
    let moved = [Some((0.5, false)), None];
    assert!(own.see(moved) == OnHost::open(Update::Async).see(moved));
}

/// Runs `meanwhile`, then unblocks a submission that waits for an odd value. Checks that the submission was blocked
/// and signals the next value. Returns its hits.
fn unblock(
    backend: &mut VulkanBackend,
    (timeline, value): (&Timeline, u64),
    ticket: Option<Ticket>,
    meanwhile: impl FnOnce(),
) -> Hits {
    backend.gpu_mut().signal().unwrap();
    std::thread::sleep(Duration::from_millis(200));
    let is_done = ticket.is_some_and(|ticket| backend.is_done(ticket).unwrap());
    let early = is_done || timeline.has_reached(value + 1).unwrap();
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

/// Signals the timeline from the host, in place of another device.
pub(crate) fn timeline_bounds_external_memory_access() {
    let mut backend = open_vulkan().unwrap();
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
    let animation = Animation::streamed(sheet(0.0), &[false; 400], triangles()).unwrap();
    let animation = Arc::new(animation);
    open(&mut backend, &animation);
    let push_and_refit = |backend: &mut VulkanBackend, points: Vec<Point>| {
        let time = animation.push(PointBuffer::from(points)).unwrap();
        interpolate_and_refit(backend, &animation, time);
    };
    let (list, closest) = (rays(500), QueryKind::Closest);
    let [still, moved] = [0.5, 0.25].map(|height| {
        push_and_refit(&mut backend, sheet(height));
        let ticket = submit_trace(&mut backend, Rays::List(&list), closest);
        hits(&mut backend, ticket)
    });
    assert!(still != moved);
    let timeline = Arc::new(Timeline::new(&gpu).unwrap());

    backend.gpu_mut().synchronize(&timeline, 1, 2).unwrap();
    for [wait, signal] in [[2, 2], [1, 2], [3, 1]] {
        let refused = backend.gpu_mut().synchronize(&timeline, wait, signal);
        assert!(refused.is_err());
    }
    // A device that takes over from this one still refuses values that were used.
    let mut next = backend.share_device()().unwrap();
    next.gpu_mut().copy_signals(backend.gpu());
    assert!(next.gpu_mut().synchronize(&timeline, 1, 2).is_err());
    drop(next);
    backend.gpu_mut().set_external_rays(gpu_vulkan::LentRays {
        rays: Buffer::external(&gpu, &given, 32 * 500).unwrap(),
        results: None,
    });
    push_and_refit(&mut backend, sheet(0.5));
    let ticket = submit_trace(&mut backend, Rays::OnDevice(500), closest);
    let seen = unblock(&mut backend, (&timeline, 1), Some(ticket), || {
        other.write(to_rays, 0, bytemuck::cast_slice(&list));
    });
    assert!(seen == still);

    let write = |height| other.write(to_vertices, 0, as_bytes(&sheet(height)));
    let lend_vertices = |backend: &mut VulkanBackend, wait, signal| {
        let device = backend.gpu_mut();
        device.synchronize(&timeline, wait, signal).unwrap();
        let source = ExternalVertices {
            memory: &vertices,
            offset: 0,
            range: 0..400,
            vertex_count: 400,
        };
        device.set_external_points(source).unwrap();
    };
    lend_vertices(&mut backend, 3, 4);
    push_and_refit(&mut backend, sheet(0.5));
    let ticket = submit_trace(&mut backend, Rays::List(&list), closest);
    let seen = unblock(&mut backend, (&timeline, 3), Some(ticket), || write(0.25));
    assert!(seen == moved);

    // A step without a query reads the vertices, too.
    lend_vertices(&mut backend, 5, 6);
    unblock(&mut backend, (&timeline, 5), None, || write(0.75));
    write(0.25);
    let kept = backend.gpu_mut().read_external_points(&(0..400)).unwrap();
    assert!(kept == Some(sheet(0.75)));
}
