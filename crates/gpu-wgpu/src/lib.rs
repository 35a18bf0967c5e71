//! The wgpu backend: the kernels of crate `shaders` on Vulkan, Metal and DirectX 12.
//!
//! It is `gpu-common`'s [`ComputeBackend`](gpu_common::ComputeBackend) over a [`WgpuDevice`].
//!
//! All work goes through wgpu's one queue, with one submission per frame. The queue runs work in order, so submissions
//! and uploads need no semaphores. Data that the host reads (counts, timestamps, vertices) is mapped asynchronously.
//!
//! If the device accepts SPIR-V, wgpu passes it the same SPIR-V as `gpu-vulkan`, unchanged. Otherwise wgpu translates
//! WGSL, which is written so that translators cannot simplify its arithmetic. Both forms produce the same bits, except
//! for textbook intersectors (`docs/design/hits.md`) and areas of boxes. When a device is opened, a test verifies its arithmetic.
//!
//! [`from_device`] creates a backend on a wgpu device that the program owns.

mod adapters;
mod buffer_points;
mod buffers;
mod caller_encoder;
mod caller_resources;
mod faults;
mod gpu;
mod launches;
mod limits;
mod pipeline_cache;
mod pipelines;
mod staging;
mod submission;
mod timestamps;
mod wgpu_device;

pub use adapters::adapters;
pub use caller_resources::{TracedScene, traced_scene};
pub use gpu_common::LentRays;
pub use limits::{required_features, required_limits, useful_features};
/// WGSL functions for shaders of the program. They read a [`TracedScene`], which is bound in group 0.
pub use shaders::MODULE as SHADER_MODULE;
pub use wgpu_device::{WgpuBackend, WgpuDevice, from_device, open};
