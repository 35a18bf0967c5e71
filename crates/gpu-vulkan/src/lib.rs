//! The Vulkan backend: compute kernels through ash, with no link-time dependency.
//!
//! The loader is opened at run time. Work goes to one compute queue, a frame a submission, ordered by a timeline
//! semaphore whose values are the tickets. Trees go up and vertices come back on queues of their own where the
//! device has them, each ordered by a timeline of its own, so that neither delays a frame: vertices set out as soon
//! as they are interpolated, while their frame goes on to trace; a tree sets out when it is built, and is adopted
//! once it is there. The host waits in `wait` and `hits` alone, and in `submit` when too many frames are under way.
//! Most `unsafe` of the GPU side lives here and in `gpu-vulkan-rt`.
//!
//! It is `gpu-common`'s [`ComputeBackend`](gpu_common::ComputeBackend) over a [`VulkanDevice`]. What `gpu-vulkan-rt`
//! needs of that is public: buffers, commands, the device.

#![expect(unsafe_code, reason = "Vulkan's calls, each with its reason")]

pub mod commands;
pub mod errors;
pub mod external;
pub mod gpu;
mod host_memory;
pub mod instance;
mod lent;
mod limits;
mod marks;
pub mod memory;
mod pages;
mod pipelines;
mod queues;
mod slot;
mod staging;
pub mod timeline;
pub mod transfer;
mod validation;
mod vulkan_device;

pub use gpu_common::LentRays;
pub use instance::{adapters, all};
pub use pipelines::{Layouts, descriptor_type, with_module};
pub use slot::Slot;
pub use vulkan_device::{VulkanBackend, VulkanDevice};
