//! Traces on a wgpu device that the program opened, and shares buffers with the program's shaders.
//!
//! Vertices and rays may come from the program's buffers: see [`Source::Wgpu`](crate::Source::Wgpu) and
//! [`Step::trace_buffers`](crate::Step::trace_buffers).
//!
//! [`Step::encode`](crate::Step::encode) records a step into the program's command encoder, which the program submits.
//! The program's shaders trace rays with [`shader_module`](crate::shader_module).
//!
//! The device needs the features [`required_features`] and the limits [`required_limits`], and is faster with
//! [`useful_features`]. The library and the program submit to the same queue, whose work runs in order. So a shader can
//! read a query's results without a wait on the host: see [`Tracer::hits_buffer`](crate::Tracer::hits_buffer).

use crate::joined::JoinedScene;
use crate::{Device, Error, Query, Ray, Result, Scene};
use backend::Backend;
use gpu_wgpu::{WgpuDevice, from_device};
pub use gpu_wgpu::{required_features, useful_features};
/// The version of wgpu that the library uses.
pub use wgpu;

/// A wgpu device with its queue and adapter information. Buffers and encoders must belong to the same wgpu instance.
/// Otherwise wgpu panics or uses a wrong buffer or encoder. It also panics if the queue belongs to another device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OwnDevice {
    /// The device. Its error and device-lost callbacks are not changed.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Information about the adapter that the device was opened on.
    pub info: wgpu::AdapterInfo,
}

impl From<OwnDevice> for Device {
    fn from(device: OwnDevice) -> Self {
        Self::Own(Box::new(device))
    }
}

impl OwnDevice {
    pub(crate) fn open(&self) -> Result<Box<dyn Backend>> {
        let own = self.clone();
        let opened = from_device(own.device, own.queue, own.info);
        Ok(Box::new(opened.map_err(Error::of_backend)?))
    }
}

/// Returns the smallest limits that suffice for a scene and queries of up to `rays` rays. The program merges them with
/// its own limits.
///
/// # Errors
/// [`Error::Mesh`] if all meshes together have too many vertices or triangles.
pub fn required_limits(scene: &Scene, rays: usize) -> Result<wgpu::Limits> {
    let joined = JoinedScene::of(scene.meshes.clone())?;
    Ok(gpu_wgpu::required_limits(&joined.animation, rays))
}

/// A buffer of rays, and an optional buffer for their results, both created by the program.
#[derive(Clone, Copy, Debug)]
pub struct RayBuffers<'a> {
    /// Rays, with usage `STORAGE`. A ray is eight floats in the memory layout of [`Ray`]: origin, `t_min`, direction,
    /// `t_max`.
    pub rays: &'a wgpu::Buffer,
    /// Number of rays, from the start of the buffer.
    pub count: usize,
    /// Results, with usages `STORAGE` and `COPY_DST`, and also `COPY_SRC` for [`Tracer::hits`](crate::Tracer::hits).
    /// [`Query::Closest`] writes the format of [`Tracer::hits_buffer`](crate::Tracer::hits_buffer), and [`Query::Any`]
    /// a `u32` per ray, which is not 0 for a hit. Without this buffer, the library uses its own.
    pub results: Option<&'a wgpu::Buffer>,
}

impl RayBuffers<'_> {
    pub(crate) fn check(&self, query: Query, gpu: &WgpuDevice) -> Result<()> {
        use wgpu::BufferUsages as Usage;
        Error::check_separate(self.results != Some(self.rays))?;
        let rays = (self.rays, size_of::<Ray>(), Usage::STORAGE);
        let written = Usage::STORAGE | Usage::COPY_DST;
        let results = |buffer| (buffer, query.result_bytes(), written);
        for (buffer, bytes, usage) in [rays].into_iter().chain(self.results.map(results)) {
            let is_large = (bytes as u64)
                .checked_mul(self.count as u64)
                .is_some_and(|all| all <= gpu.bindable_bytes(buffer));
            if !is_large || !buffer.usage().contains(usage) {
                let why = format!(
                    "a buffer of {} rays or results needs {bytes} bytes per element, within the limit \
                     max_storage_buffer_binding_size, and the usage {usage:?}",
                    self.count
                );
                return Err(Error::Misuse(why));
            }
        }
        Ok(())
    }
}
