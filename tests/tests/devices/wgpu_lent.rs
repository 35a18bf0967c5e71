//! Tests devices that the caller opened: with few features, with low limits, or lost.

use crate::scenes::{
    SHADOWED, camera, interpolate_and_refit, open, rays, report, submit_trace, swarm, trace,
    tree_at, wait_for_positions,
};
use abvh::own_device::OwnDevice;
use abvh::{Device, Scene, Tracer};
use backend::{
    Backend, BackendError, Generation, Hits, Inspect, Intersector, Query, QueryKind, Rays,
};
use geom::{Aabb, Animation, Camera, Ray};
use gpu_common::{Options, lock_compilation};
use gpu_wgpu::{WgpuBackend, from_device, required_features, required_limits, useful_features};
use integration::stage::own_device_with;
use std::any::Any;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Duration;
use wgpu::util::{DeviceExt, DownloadBuffer};
use wgpu::{Buffer, BufferUsages, Limits};

/// Opens a device with required features only.
pub(crate) fn own_device(limits: Limits) -> OwnDevice {
    own_device_with(required_features(), limits)
}

/// Creates a backend on the device.
pub(crate) fn backend_on(device: &OwnDevice) -> backend::Result<WgpuBackend> {
    let OwnDevice {
        device,
        queue,
        info,
    } = device.clone();
    from_device(device, queue, info)
}

pub(crate) fn filled(own: &OwnDevice, contents: &[u8], usage: BufferUsages) -> Buffer {
    let desc = wgpu::util::BufferInitDescriptor {
        label: None,
        contents,
        usage,
    };
    own.device.create_buffer_init(&desc)
}

pub(crate) fn bytes_of(own: &OwnDevice, buffer: &Buffer) -> Vec<u8> {
    let (said, heard) = mpsc::channel();
    DownloadBuffer::read_buffer(&own.device, &own.queue, &buffer.slice(..), move |bytes| {
        said.send(bytes.unwrap().to_vec()).unwrap();
    });
    let wait = wgpu::PollType::wait_indefinitely();
    own.device.poll(wait).unwrap();
    heard.recv().unwrap()
}

/// Also compares the forms in which kernels are passed. The lent device gets WGSL without run-time checks.
pub(crate) fn featureless_device_gives_same_hits() {
    let (animation, camera) = (swarm(300), camera());
    let limits = required_limits(&animation, camera.pixels());
    let mut lent = backend_on(&own_device(limits)).unwrap();
    let found = results(&mut lent, &animation, &camera);
    for uses_checked_wgsl in [false, true] {
        let options = Options {
            uses_checked_wgsl,
            ..Options::default()
        };
        let mut opened = gpu_wgpu::open(&options).unwrap();
        assert!(
            results(&mut opened, &animation, &camera) == found,
            "{options:?}"
        );
    }
    interpolate_and_refit(&mut lent, &animation, 0.7);
    let ticket = lent.submit().unwrap();
    let times = lent.wait(ticket).unwrap().times;
    assert!(
        times.refit_ms.is_none() && times.device_ms > 0.0,
        "{times:?}"
    );
}

pub(crate) fn too_large_scene_names_its_limit() {
    let own = own_device(required_limits(&swarm(10), 10));
    let mut backend = backend_on(&own).unwrap();
    let refused = backend.load(swarm(25_000), Intersector::Watertight);
    let said = refused.unwrap_err().to_string();
    let expected = format!(
        "the triangles' records (bytes of one buffer) needs {}, the limit is 1048576",
        48 * swarm(25_000).live_count()
    );
    assert_eq!(said, expected);
    // A scene that fits can still be loaded. Lists of rays are limited in the same way.
    let animation = swarm(10);
    open(&mut backend, &animation);
    interpolate_and_refit(&mut backend, &animation, 0.0);
    let many = rays(40_000);
    let (rays, kind) = (Rays::List(&many), QueryKind::Closest);
    let refused = backend.trace(&[Query { rays, kind }]).unwrap_err();
    let need = match refused {
        BackendError::Limit { need, .. } => need,
        other => panic!("{other}"),
    };
    assert_eq!(need, 1_280_000);
    submit_trace(&mut backend, Rays::List(&many[..100]), QueryKind::Closest);
}

pub(crate) fn device_with_few_buffers_is_refused() {
    let refused = backend_on(&own_device(Limits::downlevel_defaults())).err();
    let said = refused.map(|e| e.to_string()).unwrap_or_default();
    assert!(
        said.contains("(max_storage_buffers_per_shader_stage) needs 8, the limit is 4"),
        "{said}"
    );
}

pub(crate) fn lent_device_keeps_its_handlers() {
    let (animation, camera) = (swarm(300), camera());
    let limits = required_limits(&animation, camera.pixels());
    let own = own_device_with(useful_features(), limits);
    let device = &own.device;
    let (heard, lost) = (Arc::new(AtomicU32::new(0)), Arc::new(AtomicU32::new(0)));
    let counter = Arc::clone(&heard);
    device.on_uncaptured_error(Arc::new(move |_| {
        counter.fetch_add(1, Ordering::Relaxed);
    }));
    let counter = Arc::clone(&lost);
    device.set_device_lost_callback(move |_, _| {
        counter.fetch_add(1, Ordering::Relaxed);
    });
    let mut backend = backend_on(&own).unwrap();
    // One scene is refused and one fits. Neither invokes the caller's handlers.
    assert!(
        backend
            .load(swarm(40_000), Intersector::Watertight)
            .is_err()
    );
    open(&mut backend, &animation);
    interpolate_and_refit(&mut backend, &animation, 0.5);
    backend.request_positions().unwrap();
    let ticket = submit_trace(&mut backend, Rays::Camera(&camera), SHADOWED);
    backend.wait(ticket).unwrap();
    device.destroy();
    let _ = backend.wait(ticket);
    drop(backend);
    let heard = [heard.load(Ordering::Relaxed), lost.load(Ordering::Relaxed)];
    assert_eq!(heard, [0, 1], "errors and losses that handlers saw");
}

pub(crate) fn stages_are_timed_within_shared_passes() {
    let (animation, camera) = (swarm(300), camera());
    let within = wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES;
    for features in [useful_features(), useful_features() - within] {
        let limits = required_limits(&animation, camera.pixels());
        let own = own_device_with(features, limits);
        let features = own.device.features();
        let mut backend = backend_on(&own).unwrap();
        open(&mut backend, &animation);
        let is_timed = features.contains(wgpu::Features::TIMESTAMP_QUERY);
        let is_right = |ms: &Option<f64>| ms.map_or(!is_timed, |ms| is_timed && ms > 0.0);
        // In one submission, `interpolate` and `preprocess` overlap, and `preprocess` also refits.
        backend.interpolate(animation.pose(0.7)).unwrap();
        let interpolate = report(&mut backend).times;
        backend.preprocess().unwrap();
        let preprocess = report(&mut backend).times;
        backend.refit().unwrap();
        let ticket = submit_trace(&mut backend, Rays::Camera(&camera), SHADOWED);
        let last = backend.wait(ticket).unwrap().times;
        for (times, stages) in [
            (interpolate, [interpolate.interpolate_ms; 2]),
            (preprocess, [preprocess.preprocess_ms; 2]),
            (last, [last.refit_ms, last.trace_primary_ms]),
        ] {
            assert!(stages.iter().all(is_right), "{times:?}");
        }
        let sum = last.refit_ms.zip(last.trace_primary_ms);
        let sum = sum.map_or(0.0, |(refit, trace)| refit + trace);
        assert!(sum <= last.device_ms, "{last:?}");
    }
}

/// Returns boxes, and hits of a camera and of lists.
fn results(
    backend: &mut WgpuBackend,
    animation: &Arc<Animation>,
    camera: &Camera,
) -> (Vec<Aabb>, [Hits; 3]) {
    open(backend, animation);
    interpolate_and_refit(backend, animation, 0.6);
    let list = rays(500);
    let queries = [
        (Rays::Camera(camera), SHADOWED),
        (Rays::List(&list), QueryKind::Closest),
        (Rays::List(&list), QueryKind::Any),
    ];
    let hits = queries.map(|(rays, kind)| trace(backend, rays, kind));
    assert!(hits[0].closest.iter().any(|h| h.is_hit()));
    (backend.boxes().unwrap(), hits)
}

/// Runs a frame, and returns the error of the first operation that fails.
fn frame(b: &mut WgpuBackend, animation: &Animation, rays: Option<&[Ray]>) -> backend::Result<()> {
    b.interpolate(animation.pose(0.3))?;
    b.preprocess()?;
    b.refit()?;
    if let Some(rays) = rays.map(Rays::List) {
        let kind = QueryKind::Any;
        b.trace(&[Query { rays, kind }])?;
        let ticket = b.submit()?;
        return b.take_hits(ticket, 0, &mut Hits::default());
    }
    let ticket = b.submit()?;
    b.wait(ticket).map(drop)
}

pub(crate) fn calls_after_device_loss_return_errors() {
    let animation = swarm(100);
    let list = rays(100);
    type Verb = fn(&mut WgpuBackend, &Arc<Animation>, &[Ray]) -> backend::Result<()>;
    let verbs: [(&str, Verb); 8] = [
        ("load", |b, a, _| {
            b.load(Arc::clone(a), Intersector::Watertight)
        }),
        ("adopt", |b, a, _| {
            b.adopt(&tree_at(a, 1.0), Generation(2))?;
            frame(b, a, None)
        }),
        ("a frame", |b, a, _| frame(b, a, None)),
        ("a trace", |b, a, list| frame(b, a, Some(list))),
        ("positions", |b, a, _| {
            b.interpolate(a.pose(0.3))?;
            b.request_positions()?;
            b.submit()?;
            b.take_positions().map(drop)
        }),
        ("nothing", |b, _, _| {
            b.submit().and_then(|t| b.wait(t)).map(drop)
        }),
        ("boxes", |b, _, _| b.boxes().map(drop)),
        ("vertices", |b, _, _| b.positions().map(drop)),
    ];
    for (name, verb) in verbs {
        let limits = required_limits(&animation, 100);
        let own = own_device(limits);
        let mut backend = backend_on(&own).unwrap();
        open(&mut backend, &animation);
        interpolate_and_refit(&mut backend, &animation, 0.5);
        backend.request_positions().unwrap();
        let ticket = submit_trace(&mut backend, Rays::List(&list), QueryKind::Closest);
        backend.wait(ticket).unwrap();
        let (_, held) = wait_for_positions(&mut backend);
        own.device.destroy();
        // wgpu frees destroyed buffers at the next poll.
        let _ = own.device.poll(wgpu::PollType::Poll);
        drop(held);
        let another = Tracer::builder().device(Device::from(own.clone()));
        assert!(another.build(Scene::new()).is_err());
        // The error is permanent.
        for _ in 0..2 {
            let found = verb(&mut backend, &animation, &list);
            let is_lost = matches!(found, Err(BackendError::DeviceLost(_)));
            assert!(is_lost, "{name}: {found:?}");
        }
    }
}

/// When its device is destroyed, reports whether the lock against compilation is held
/// ([`gpu_common::lock_device_lifetime`]).
struct DestructionProbe(mpsc::Sender<bool>);

impl Drop for DestructionProbe {
    fn drop(&mut self) {
        let compilation = thread::spawn(|| drop(lock_compilation()));
        thread::sleep(Duration::from_millis(200));
        let _ = self.0.send(!compilation.is_finished());
    }
}

/// NVIDIA's driver may deadlock if a device is destroyed while another thread compiles kernels.
pub(crate) fn device_is_destroyed_while_no_kernel_compiles() {
    type Keep = fn(&mut WgpuBackend) -> Box<dyn Any>;
    let outliving: [Keep; 3] = [
        |_| Box::new(()),
        |backend| Box::new(wait_for_positions(backend)),
        |backend| Box::new(backend.tree_writer(Generation(2)).unwrap()),
    ];
    let animation = swarm(100);
    for keep in outliving {
        let own = own_device(required_limits(&animation, 100));
        let mut backend = backend_on(&own).unwrap();
        let (said, heard) = mpsc::channel();
        let probe = DestructionProbe(said);
        // wgpu drops the callback together with the device.
        own.device.set_device_lost_callback(move |_, _| {
            let _probe = &probe;
        });
        drop(own);
        open(&mut backend, &animation);
        interpolate_and_refit(&mut backend, &animation, 0.5);
        backend.request_positions().unwrap();
        report(&mut backend);
        let kept = keep(&mut backend);
        drop(backend);
        drop(kept);
        let was_locked = heard.recv_timeout(Duration::from_secs(10));
        assert_eq!(was_locked, Ok(true));
    }
}
