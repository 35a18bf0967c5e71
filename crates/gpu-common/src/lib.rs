//! The compute backend, generic over the GPU interface.
//!
//! [`ComputeBackend`] implements [`backend::Backend`] over a [`GpuDevice`]. It decides which kernels run over which
//! buffers, when trees and positions are transferred, and what a submission reports. A device only creates buffers and
//! pipelines, copies, executes recordings and waits.
//!
//! - [`Engine`] holds the state that does not depend on the kind of tree: a scene, submissions, traces, and copies of
//!   positions to the host. A backend for another kind of tree can reuse it.
//! - A [`Recording`] holds the commands of a submission as data, with the buffers that they use. [`Recorder`] adds the
//!   commands of each stage. [`GpuDevice::submit`] executes them, so recording a command does not wait for the device.
//! - Buffers are looked up by [`shaders::BufferName`], never by text.
//!
//! To add a GPU interface, implement [`GpuDevice`]. Its documentation states which methods may block.

mod buffers;
pub mod cache_file;
mod clock;
mod compute;
mod device;
mod engine;
mod external_points;
mod frames;
#[cfg(feature = "inspect")]
mod inspect;
mod key_slots;
mod pipelines;
mod pool;
mod recorder;
mod recording;
mod scene;
mod snapshots;
mod traces;
mod tree;

use buffers::BufferTable;
pub use buffers::check_limit;
pub use clock::{Clock, Stage};
pub use compute::ComputeBackend;
pub use device::{
    BufferSize, DeviceInfo, GpuDevice, KernelLimit, LentBuffers, LentRays, MemoryReport, Options,
    Outcome, PendingWork, PointsCopy, ReadPart, RecordingOf, Staging, SubmissionOutput, Upload,
    Validation, check_kernels, read_parts,
};
pub use engine::{Engine, NextStage};
pub use external_points::{ExternalPoints, PointsSource};
pub use frames::Frames;
pub use pipelines::{KernelCode, Pipelines, lock_compilation, lock_device_lifetime};
pub use pool::{LastUse, Pool, with_slack};
pub use recorder::Recorder;
pub use recording::{BoundBuffer, Dispatch, PositionsCopy, RecordedCommand, Recording};
pub use scene::AnimationBuffers;
pub use traces::{TraceBuffers, reads_ray_buffer};
