//! The wgpu backend: the same kernels as `gpu-vulkan` runs, on whatever wgpu reaches (Vulkan, Metal, DirectX 12).
//!
//! It is `gpu-common`'s [`ComputeBackend`](gpu_common::ComputeBackend) over a [`WgpuDevice`].
//!
//! All work goes through wgpu's one queue, a frame a submission, so order needs no semaphores: a tree written before a
//! submission is there when it runs, and vertices copied at its end are those it made. What is read by the host (counts,
//! timestamps, vertices) is mapped asynchronously and looked at when it has arrived.
//!
//! Where the adapter takes SPIR-V as it is, it gets the words that `gpu-vulkan` loads; elsewhere WGSL whose arithmetic no
//! translator can see through. Both are put to the test when the device is opened, and both give the same bits.
//!
//! An engine that has a wgpu device already lends it by [`from_device`].

mod adapters;
mod buffers;
mod faults;
mod gpu;
mod launches;
mod lent;
mod lent_encoder;
mod limits;
mod marks;
mod pipelines;
mod slot;
mod staging;
mod wgpu_device;

pub use adapters::adapters;
pub use gpu_common::LentRays;
pub use lent::{TracedScene, traced_scene};
pub use limits::{required_features, required_limits, useful_features};
/// WGSL that shaders of the program's own call; it reads a [`TracedScene`], which is bound in group 0.
pub use shaders::MODULE as SHADER_MODULE;
pub use wgpu_device::{WgpuBackend, WgpuDevice, from_device};
