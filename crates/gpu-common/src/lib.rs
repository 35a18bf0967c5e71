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

pub mod cache_file;
mod clock;
mod compute;
mod device;
mod doors;
mod engine;
mod frames;
mod inspect;
mod key_slots;
mod options;
mod pipelines;
mod runs;
mod scene;
mod sent;
mod snapshots;
mod traces;
mod tree;

pub use clock::{Clock, Stage};
pub use compute::ComputeBackend;
pub use device::{
    BufferPurpose, BufferTable, Dispatch, Find, Finished, GpuDevice, GpuSlot, LentRays, parts,
    refuse_above,
};
pub use doors::{compile_door, device_door};
pub use engine::{Engine, Stale};
pub use frames::{Frames, Slot};
pub use options::{KernelForm, Options, Validation};
pub use pipelines::{KernelCode, Pipelines};
pub use runs::without;
pub use scene::SceneBuffers;
pub use sent::Sent;
pub use traces::{Trace, Traces, are_given};
