//! The Vulkan backend: compute kernels through ash, without a link-time dependency.
//!
//! It is `gpu-common`'s [`ComputeBackend`](gpu_common::ComputeBackend) over a [`VulkanDevice`]. The Vulkan loader is
//! opened at run time. Most `unsafe` code of the GPU crates is here. The buffers, command buffers and device
//! that the crate `rivals` uses are public.
//!
//! Each frame is one submission to one compute queue. A timeline semaphore orders submissions; its values are the
//! tickets. Trees are uploaded and vertices are read back on queues of their own if the device has them. Each of these
//! queues has its own timeline. A submission waits for the uploads whose data it reads, and for all earlier uploads.
//! The host does not wait for these copies:
//!
//! - The copy of vertices starts as soon as they are interpolated, while their frame continues.
//! - The upload of a tree starts when the tree is built. The tree is adopted once it has arrived.
//!
//! [`GpuDevice`](gpu_common::GpuDevice) lists the methods that may block the host.

#![expect(unsafe_code, reason = "calls of Vulkan, each with a safety comment")]

mod adapters;
mod allocator;
pub mod commands;
mod descriptors;
mod encoder;
pub mod errors;
pub mod external;
mod external_inputs;
pub mod gpu;
mod host_memory;
pub mod instance;
mod interop;
mod limits;
pub mod memory;
mod pipeline_cache;
mod pipelines;
mod queues;
mod sharing;
mod staging;
pub mod timeline;
mod timestamps;
pub mod transfer;
mod validation;
mod vulkan_device;

pub use adapters::{adapters, adapters_of};
pub use encoder::{NativeCommand, RayBindings, RecordingEncoder};
pub use gpu_common::LentRays;
pub use interop::ExternalVertices;
pub use pipelines::{Layouts, descriptor_type, with_module};
pub use vulkan_device::{VulkanBackend, VulkanDevice, open};
