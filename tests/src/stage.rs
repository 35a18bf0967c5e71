//! Traces of an animation on a backend, scenes, cameras, and a wgpu device that the caller opened.

use crate::is_full;
use abvh::own_device::{OwnDevice, wgpu};
use backend::{Backend, Hits, Query, QueryKind, Rays};
use conformance::stage::{interpolate_and_refit, trace_and_wait};
use cpu_ref::CpuBackend;
use geom::{Animation, Camera, CameraPose, Hit, Point, Ray};
use scene::Viewpoint;
use std::sync::{Arc, LazyLock};

/// Creates backend `cpu-ref` with two threads.
pub fn host() -> CpuBackend {
    CpuBackend::new(Some(2)).expect("threads are available")
}

/// Traces a query at `time` with the current tree.
pub fn trace(
    backend: &mut dyn Backend,
    animation: &Animation,
    time: f64,
    query: Query<'_>,
) -> Hits {
    let done = interpolate_and_refit(backend, animation, time)
        .and_then(|()| trace_and_wait(backend, query.rays, query.kind));
    done.expect("the device does not fail").hits
}

/// Returns the closest hits of rays at `time` with the current tree.
pub fn closest(
    backend: &mut dyn Backend,
    animation: &Animation,
    time: f64,
    rays: &[Ray],
) -> Vec<Hit> {
    let (rays, kind) = (Rays::List(rays), QueryKind::Closest);
    trace(backend, animation, time, Query { rays, kind }).closest
}

/// Creates triangles without shared vertices, from key frames with three vertices per triangle.
pub fn separate_triangles(keys: Vec<Vec<Point>>) -> Arc<Animation> {
    let triangles = 0..keys[0].len() as u32 / 3;
    let triangles = triangles.map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let animation = Animation::new(keys, triangles);
    Arc::new(animation.expect("key frames have equal lengths"))
}

/// Returns the camera that the program would choose.
pub fn camera(animation: &Animation, size: [u32; 2]) -> Camera {
    let view = Viewpoint::framing(animation, 40.0, size);
    view.camera(size).expect("every scene can be framed")
}

/// Returns a camera of more pixels than any device has memory for.
pub fn vast_camera() -> Camera {
    let pose = CameraPose::new([0.0, 0.0, 3.0], [0.0; 3]);
    Camera {
        width: u32::MAX,
        height: u32::MAX,
        ..Camera::look_at(pose, [2, 2]).expect("eye and target differ")
    }
}

/// Returns the rays of [`camera`]: 240 by 160 pixels in the full tier, else 120 by 80.
pub fn picture_rays(animation: &Animation) -> Vec<Ray> {
    let size = if is_full() { [240, 160] } else { [120, 80] };
    camera(animation, size).rays().collect()
}

/// Returns the light that the program would choose.
pub fn light(animation: &Animation) -> Point {
    Viewpoint::framing(animation, 40.0, [64, 64]).light
}

/// Returns `count` colours. They repeat after 256.
pub fn colours(count: usize) -> Vec<[u8; 3]> {
    let of = |t: usize| [t, t * 37, t * 101].map(|channel| channel as u8);
    (0..count).map(of).collect()
}

/// Opens a device on wgpu's first adapter, as a program would, with those of `features` that it has, and with `limits`.
pub fn own_device_with(features: wgpu::Features, limits: wgpu::Limits) -> OwnDevice {
    static ADAPTER: LazyLock<wgpu::Adapter> = LazyLock::new(|| {
        let mut desc = wgpu::InstanceDescriptor::new_without_display_handle();
        desc.flags = wgpu::InstanceFlags::empty();
        let instance = wgpu::Instance::new(desc);
        let all = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
        all.into_iter().next().expect("wgpu has an adapter")
    });
    let desc = wgpu::DeviceDescriptor {
        required_features: features & ADAPTER.features(),
        required_limits: limits,
        ..Default::default()
    };
    let (device, queue) = pollster::block_on(ADAPTER.request_device(&desc)).expect("it opens");
    let info = ADAPTER.get_info();
    OwnDevice {
        device,
        queue,
        info,
    }
}
