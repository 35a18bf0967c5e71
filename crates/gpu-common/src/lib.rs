//! One compute backend over any GPU interface.
//!
//! [`ComputeBackend`] implements [`backend::Backend`] over a [`GpuDevice`]: which kernels run, over which buffers, when
//! trees and positions come and go, and what a submission did. A device knows none of that. It makes buffers and
//! pipelines, records dispatches, copies, submits, and waits.
//!
//! - [`Engine`] holds what frames of any kind take: a scene, submissions, traces, positions on their way to the host.
//!   A backend with trees of another kind is written over it.
//! - [`Frames`] keeps one slot more than submissions may be under way, so recording never waits.
//! - Buffers are found by [`shaders::BufferName`], never by text.
//!
//! To add a GPU interface, implement [`GpuDevice`]; its documentation says what may wait and what must not.

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
