//! The wgpu backend: the kernels of `gpu-vulkan` on every interface that wgpu supports (Vulkan, Metal, DirectX 12).
//!
//! It is `gpu-common`'s [`ComputeBackend`](gpu_common::ComputeBackend) over a [`WgpuDevice`].
//!
//! All work goes through wgpu's one queue, one submission per frame, so no semaphores are needed: a tree written before
//! a submission is there when it runs, and vertices copied at its end are its own. Data that the host reads (counts,
//! timestamps, vertices) is mapped asynchronously and read when it has arrived.
//!
//! If the adapter accepts SPIR-V unchanged, it gets the same words as `gpu-vulkan`. Otherwise it gets WGSL whose
//! arithmetic no translator can simplify. Both forms are tested when the device is opened, and both produce the same
//! bits.
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
