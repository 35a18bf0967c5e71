//! The wgpu backend: the same kernels as `gpu-vulkan` runs, on whatever wgpu reaches (Vulkan, Metal, DirectX 12).
//!
//! All work goes through wgpu's one queue, a frame a submission, so order needs
//! no semaphores: a tree written before a submission is there when it runs, and
//! vertices copied at its end are those it made. What is read by the host
//! (counts, timestamps, vertices) is mapped asynchronously and looked at when it
//! has arrived.
//!
//! Where the adapter takes SPIR-V as it is, it gets the words that `gpu-vulkan`
//! loads; elsewhere WGSL whose arithmetic no translator can see through. Both
//! are put to the test when the device is opened, and both give the same bits.
//!
//! An engine that has a wgpu device already lends it by
//! [`WgpuBackend::from_device`].

mod adapters;
mod backend_impl;
mod buffers;
mod call_counts;
mod device;
mod faults;
mod frames;
mod groups;
mod inspect;
mod instance;
mod launches;
mod limits;
mod modules;
mod pipelines;
mod queries;
mod rebuild;
mod scene;
mod selftest;
mod slot;
mod snapshots;
mod stages;
mod traces;
mod tree;

pub use adapters::{Adapter, Options, adapters};
pub use backend_impl::WgpuBackend;
pub use call_counts::CallCounts;
pub use limits::{required_features, required_limits, useful_features};
pub use shaders::supports;
