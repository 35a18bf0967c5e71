//! Tests rays in the caller's own buffers, and results that are written to them.

use crate::lent::{Found, RaysOnDevice, all_kinds, check_rays_match_host, flying, found};
use crate::scenes::rays;
use crate::wgpu_lent::{bytes_of, filled, own_device};
use abvh::own_device::{OwnDevice, RayBuffers, required_limits};
use abvh::{Device, Error, Intersector, Query, Ray, Scene, Tracer, TracerBuilder};
use wgpu::{Buffer, BufferDescriptor, BufferUsages, Limits};

const INTERSECTORS: [Intersector; 3] = [
    Intersector::Watertight,
    Intersector::Exact,
    Intersector::Woop,
];

/// Usage of the buffers of rays and of results.
const USAGE: BufferUsages = BufferUsages::STORAGE
    .union(BufferUsages::COPY_DST)
    .union(BufferUsages::COPY_SRC);

/// A scene on the caller's device, with buffers of rays and of results.
struct RaysOnCallerDevice {
    device: OwnDevice,
    tracer: Tracer,
    count: usize,
    rays: Buffer,
    results: Buffer,
}

impl RaysOnCallerDevice {
    fn new(scene: Scene, rays: &[Ray], intersector: Intersector) -> Self {
        let limits = required_limits(&scene, rays.len()).unwrap();
        let builder = Tracer::builder().intersector(intersector).threads(2);
        Self::on(own_device(limits), builder, scene, rays)
    }

    fn on(device: OwnDevice, builder: TracerBuilder, scene: Scene, rays: &[Ray]) -> Self {
        let builder = builder.device(Device::from(device.clone()));
        Self {
            tracer: builder.build(scene).unwrap(),
            count: rays.len(),
            rays: filled(&device, bytemuck::cast_slice(rays), USAGE),
            results: filled(&device, &vec![0; 16 * rays.len()], USAGE),
            device,
        }
    }
}

impl RaysOnDevice for RaysOnCallerDevice {
    fn tracer(&mut self) -> &mut Tracer {
        &mut self.tracer
    }

    fn trace(&mut self, query: Query, has_results: bool) -> Vec<Found> {
        let asked = RayBuffers {
            rays: &self.rays,
            count: self.count,
            results: has_results.then_some(&self.results),
        };
        found(&mut self.tracer, query, |step| {
            step.trace_buffers(asked, query)
        })
    }

    fn fill_results(&mut self, byte: u8) {
        self.results = filled(&self.device, &vec![byte; 16 * self.count], USAGE);
    }

    fn results(&mut self, words: usize) -> Vec<u32> {
        let bytes = bytes_of(&self.device, &self.results);
        bytemuck::cast_slice(&bytes[..4 * words]).to_vec()
    }
}

pub(crate) fn reads_rays_from_caller_buffers() {
    let list = all_kinds();
    for intersector in INTERSECTORS {
        let mut caller =
            check_rays_match_host(|scene, rays| RaysOnCallerDevice::new(scene, rays, intersector));
        // Hits of rays from the host are stored on the device in the format of results.
        let mut step = caller.tracer.step(0.5);
        let asked = step.trace(&list, Query::Closest).unwrap();
        let done = step.submit().unwrap();
        let hits = caller.tracer.hits_buffer(done, asked).unwrap();
        let hits = bytes_of(&caller.device, &hits);
        assert!(hits[..16 * list.len()] == bytes_of(&caller.device, &caller.results));
        // Later rays from the host do not overwrite the caller's buffer.
        for query in [Query::Closest, Query::Any].repeat(4) {
            let ray = [Ray::new([9.0; 3], [1.0; 3])];
            found(&mut caller.tracer, query, |step| step.trace(&ray, query));
        }
        let bytes: &[u8] = bytemuck::cast_slice(&list);
        let kept = bytes_of(&caller.device, &caller.rays);
        assert!(kept == bytes, "{intersector:?}");
    }
}

/// Tests a list from the host that is uploaded in parts, on a device whose limits allow no larger list.
pub(crate) fn long_lists_fit_the_requested_limits() {
    let all = rays(1000).repeat(34);
    let mut caller = RaysOnCallerDevice::new(flying(), &all, INTERSECTORS[0]);
    for query in [Query::Closest, Query::Any, Query::Closest] {
        let sent = found(&mut caller.tracer, query, |step| step.trace(&all, query));
        assert!(sent == caller.trace(query, false), "{query:?}");
    }
}

/// Checks that buffers are released, since the caller may pass new ones in every step.
pub(crate) fn ray_buffers_are_released() {
    const BYTES: usize = 8 << 20;
    let few = rays(64);
    let mut all = few.clone();
    all.resize(BYTES / size_of::<Ray>(), few[0]);
    let mut caller = RaysOnCallerDevice::new(flying(), &all, INTERSECTORS[0]);
    caller.count = few.len();
    let mut step = || {
        caller.rays = filled(&caller.device, bytemuck::cast_slice(&all), USAGE);
        caller.trace(Query::Closest, false);
        let report = caller.device.device.generate_allocator_report();
        report.map(|report| report.total_allocated_bytes)
    };
    let held: Vec<_> = (0..40).filter_map(|_| step()).collect();
    let most = held.iter().skip(20).max();
    let grown = most.map(|most| most.saturating_sub(held[19]));
    assert!(
        grown.is_some_and(|grown| grown <= 2 * BYTES as u64),
        "{held:?}"
    );
}

pub(crate) fn unsuitable_ray_buffer_is_an_error() {
    let list = all_kinds();
    let mut caller = RaysOnCallerDevice::new(flying(), &list, INTERSECTORS[0]);
    let expected = caller.trace(Query::Closest, false);
    let all = BufferUsages::STORAGE | BufferUsages::COPY_DST;
    let [rays, copied, both] = [BufferUsages::STORAGE, BufferUsages::COPY_SRC, all]
        .map(|usage| filled(&caller.device, bytemuck::cast_slice(&list), usage));
    let count = caller.count;
    let asked = RayBuffers {
        rays: &rays,
        count,
        results: None,
    };
    let is_misuse = |said: Option<Error>| assert!(matches!(said, Some(Error::Misuse(_))));
    let is_device = |said: Option<Error>| assert!(matches!(said, Some(Error::Device(_))));
    let is_unsupported = |said| assert!(matches!(said, Some(Error::Unsupported(_))));
    for (rays, count, results) in [
        (&rays, count + 1, None),
        (&copied, count, None),
        (&rays, count, Some(&copied)),
        (&rays, count, Some(&rays)),
        (&both, count, Some(&both)),
        (&rays, usize::MAX, None),
    ] {
        let asked = RayBuffers {
            rays,
            count,
            results,
        };
        let mut step = caller.tracer.step(0.0);
        is_misuse(step.trace_buffers(asked, Query::Closest).err());
    }
    // On wgpu, only `trace_buffers` can specify where rays are stored.
    let nowhere = abvh::Rays::OnDevice(3);
    is_unsupported(caller.tracer.step(0.0).trace(nowhere, Query::Closest).err());
    let host = Tracer::builder().device(Device::Cpu).build(flying());
    let said = (host.unwrap().step(0.0)).trace_buffers(asked, Query::Closest);
    is_unsupported(said.err());
    let other = own_device(caller.device.device.limits());
    let rays = &filled(&other, bytemuck::cast_slice(&list), USAGE);
    let foreign = RayBuffers { rays, ..asked };
    let mut step = caller.tracer.step(0.0);
    step.trace_buffers(foreign, Query::Closest).unwrap();
    is_device(step.submit().err());
    // Results without the usage COPY_SRC remain on the device.
    let mut step = caller.tracer.step(0.0);
    let results = Some(&both);
    let query = step.trace_buffers(RayBuffers { results, ..asked }, Query::Closest);
    let done = step.submit().unwrap();
    is_misuse(caller.tracer.hits(done, query.unwrap()).err());
    // A buffer without rays may be empty.
    let empty = filled(&caller.device, &[], USAGE);
    let nothing = RayBuffers {
        rays: &empty,
        count: 0,
        results: None,
    };
    let none = found(&mut caller.tracer, Query::Closest, |step| {
        step.trace_buffers(nothing, Query::Closest)
    });
    assert!(none.is_empty());
    // Later steps are not affected.
    assert!(caller.trace(Query::Closest, false) == expected);
}

/// Tests buffers that no storage binding can cover: the size of one is not a multiple of 4, and the other is too large.
pub(crate) fn ray_buffers_are_bound_in_part() {
    let list = all_kinds();
    let limits = required_limits(&flying(), list.len()).unwrap();
    let most = limits.max_storage_buffer_binding_size;
    let device = own_device(Limits {
        max_buffer_size: 2 * most,
        ..limits
    });
    let builder = Tracer::builder().threads(2);
    let mut caller = RaysOnCallerDevice::on(device, builder, flying(), &list);
    let expected = caller.trace(Query::Closest, true);
    let ray = size_of::<Ray>() as u64;
    for size in [ray * list.len() as u64 + 2, most + ray] {
        let desc = BufferDescriptor {
            label: None,
            size,
            usage: USAGE,
            mapped_at_creation: false,
        };
        [caller.rays, caller.results] = [0; 2].map(|_| caller.device.device.create_buffer(&desc));
        let rays = bytemuck::cast_slice(&list);
        caller.device.queue.write_buffer(&caller.rays, 0, rays);
        assert!(caller.trace(Query::Closest, true) == expected, "{size}");
    }
    let asked = RayBuffers {
        rays: &caller.rays,
        count: (most / ray) as usize + 1,
        results: None,
    };
    let said = (caller.tracer.step(0.0)).trace_buffers(asked, Query::Closest);
    assert!(matches!(said, Err(Error::Misuse(_))), "{said:?}");
}
