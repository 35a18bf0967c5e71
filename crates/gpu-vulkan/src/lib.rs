//! The Vulkan backend: compute kernels through ash, with no link-time dependency.
//!
//! The loader is opened at run time. Work goes to one compute queue, a frame a
//! submission, ordered by a timeline semaphore whose values are the tickets.
//! Trees go up and vertices come back on a transfer queue of their own where
//! the device has one, so that neither delays a frame. All `unsafe` of the GPU
//! side lives here.

mod backend_impl;
mod device;
mod encode;
mod errors;
mod instance;
mod memory;
mod method;
mod pipelines;
mod scene;
mod selftest;
mod slot;
mod snapshots;
mod transfer;
mod tree;

pub use backend_impl::{Options, VulkanBackend};
pub use instance::{Adapter, adapters};
pub use method::supports;
