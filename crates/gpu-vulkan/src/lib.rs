//! The Vulkan backend: compute kernels through ash, with no link-time dependency.
//!
//! The loader is opened at run time. Work goes to one compute queue, a frame a
//! submission, ordered by a timeline semaphore whose values are the tickets.
//! Trees go up and vertices come back on queues of their own where the device
//! has them, each ordered by a timeline of its own, so that neither delays a
//! frame: vertices set out as soon as they are interpolated, while their frame
//! goes on to trace; a tree sets out when it is adopted, while the frames
//! before still run. The host waits in `wait` and `hits` alone, and in `submit`
//! when too many frames are under way. All `unsafe` of the GPU side lives here.

mod adapters;
mod backend_impl;
mod clock;
mod commands;
mod device;
mod errors;
mod extras;
mod frames;
mod inspect;
mod instance;
mod limits;
mod memory;
mod pages;
mod pipelines;
mod queues;
mod rebuild;
mod rt;
mod scene;
mod selftest;
mod slot;
mod snapshots;
mod stages;
#[cfg(test)]
mod tests;
mod timeline;
mod traces;
mod transfer;
mod tree;
mod validation;
mod vulkan;

pub use adapters::{AdapterInfo, Options, adapters};
pub use rt::{DriverTreeBackend, Prefer, driver_tree_supports, ray_adapters};
pub use shaders::supports;
pub use validation::Validation;
pub use vulkan::VulkanBackend;

#[cfg(test)]
fn main() -> std::process::ExitCode {
    tests::run()
}
