//! One compute backend over any GPU interface.
//!
//! [`ComputeBackend`] implements [`backend::Backend`] over a [`GpuDevice`]. It decides which kernels run over which
//! buffers, when trees and positions are transferred, and what a submission reports. A device only creates buffers and
//! pipelines, records dispatches, copies, submits and waits.
//!
//! - [`Engine`] holds what every kind of frame needs: a scene, submissions, traces, and position copies to the host. A
//!   backend with other trees can be built on it.
//! - [`Frames`] holds one slot more than the maximum number of unfinished submissions, so recording never waits.
//! - Buffers are looked up by [`shaders::BufferName`], never by text.
//!
//! To add a GPU interface, implement [`GpuDevice`]. Its documentation states which methods may block.

mod buffers;
pub mod cache_file;
mod clock;
mod compute;
mod device;
mod engine;
mod frames;
mod inspect;
mod key_slots;
mod pipelines;
mod pool;
mod scene;
mod snapshots;
mod traces;
mod tree;

use buffers::BufferTable;
pub use buffers::{refuse_above, without};
pub use clock::{Clock, Stage};
pub use compute::ComputeBackend;
pub use device::{
    Dispatch, Find, Finished, GpuDevice, GpuSlot, LentRays, Options, PointsCopy, Validation,
};
pub use engine::{Engine, Stale};
pub use frames::{Frames, Slot};
pub use pipelines::{KernelCode, Pipelines, compile_door, device_door};
pub use pool::{LastUse, Pool, with_slack};
pub use scene::SceneBuffers;
pub use traces::{Trace, are_given};
