//! The error type.

use crate::MeshId;
use backend::BackendError;
use pipeline::PipelineError;

/// Result with [`Error`] as the default error type.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Reason for a failed operation. No call panics because of its arguments, except for the panics of wgpu that
/// `OwnDevice` describes.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The parts of a mesh are inconsistent.
    #[error("invalid mesh: {0}")]
    Mesh(String),
    /// A step passed a wrong number of vertices or matrices for a mesh.
    #[error("mesh {} takes {expected} {what}, but {found} were passed", mesh.index())]
    Count {
        /// The mesh.
        mesh: MeshId,
        /// `vertices`, `matrices` or `bytes`.
        what: &'static str,
        /// Number that the mesh takes.
        expected: usize,
        /// Number that was passed.
        found: usize,
    },
    /// The mesh belongs to another scene.
    #[error("mesh {} belongs to another scene", .0.index())]
    ForeignMesh(MeshId),
    /// The mesh does not move in this way: vertices are for streamed meshes, matrices for rigid meshes.
    #[error("mesh {} takes no {what}", mesh.index())]
    Motion {
        /// The mesh.
        mesh: MeshId,
        /// `vertices` or `matrices`.
        what: &'static str,
    },
    /// A mesh was moved, or a semaphore was passed, after a query of the same step. Or a step was encoded after a
    /// picture, or after a query with rays in host memory.
    #[error("too late: the step already has a query or a picture")]
    TooLate,
    /// The replacement of this mesh belongs to another tracer.
    #[error("the replacement of mesh {} belongs to another tracer", .0.index())]
    ForeignReplacement(MeshId),
    /// Another replacement of this mesh was committed after this replacement was started.
    #[error("mesh {} was replaced after this replacement was started", .0.index())]
    Conflict(MeshId),
    /// The query belongs to another step or tracer, or its result was dropped. A result can be read any number of times
    /// until two more steps are submitted. Dropped steps have no results and do not count.
    #[error("no result: the query belongs to another step, or its result was dropped")]
    NoResult,
    /// A key frame or a mesh file cannot be read.
    #[error("{0}")]
    KeyFrame(String),
    /// No device can be used, or the requested device cannot run on this machine.
    #[error("{0}")]
    NoDevice(String),
    /// The device does not support the operation, the scene exceeds its limits, or the threads cannot be started.
    #[error("{0}")]
    Unsupported(String),
    /// The program violated a rule of the interface, which the message names. The tracer remains usable.
    #[error("{0}")]
    Misuse(String),
    /// Vertices of this mesh that only the device had are lost, because a step that used them failed, or because the
    /// encoder of a step was dropped or rejected. The next step must pass them again.
    #[error(
        "the vertices of mesh {} on the device were lost with a failed step or a dropped encoder: pass them again",
        .0.index()
    )]
    VerticesLost(MeshId),
    /// Device or host memory is exhausted. A smaller request may succeed.
    #[error("{0}")]
    OutOfMemory(String),
    /// The device was unplugged or reset. Only a new tracer can recover.
    #[error("{0}")]
    DeviceLost(String),
    /// The driver refused a call, or a tree build failed. This is a bug in the driver or in the library, unless the
    /// process has too many open file descriptors or passed an object of another wgpu device.
    #[error("{0}")]
    Device(String),
}

// Private functions instead of `From`, which would make the inner error types part of the public interface.
impl Error {
    pub(crate) fn of_backend(e: BackendError) -> Self {
        match e {
            BackendError::NoDevice(why) => Self::NoDevice(why),
            BackendError::KeyFrame(e) => Self::of_reading(e),
            BackendError::Unsupported { .. } | BackendError::Limit { .. } => {
                Self::Unsupported(e.to_string())
            }
            BackendError::Misuse(why) => Self::Misuse(why),
            BackendError::OutOfMemory { .. } => Self::OutOfMemory(e.to_string()),
            BackendError::DeviceLost(_) => Self::DeviceLost(e.to_string()),
            other => Self::Device(other.to_string()),
        }
    }

    pub(crate) fn of_driver(e: PipelineError) -> Self {
        match e {
            PipelineError::Backend(e) => Self::of_backend(e),
            PipelineError::Threads(_) => Self::Unsupported(e.to_string()),
            PipelineError::FirstTree(_) => Self::Device(e.to_string()),
        }
    }

    /// Converts the error of reading a key frame.
    pub(crate) fn of_reading(e: geom::KeyFrameError) -> Self {
        Self::KeyFrame(e.0)
    }

    /// Returns [`Error::Misuse`] unless rays and results are in separate buffers.
    #[cfg(any(feature = "vulkan", feature = "wgpu"))]
    pub(crate) fn check_separate(are_separate: bool) -> Result<()> {
        let reason = || Self::Misuse("rays and results need separate buffers".into());
        are_separate.then_some(()).ok_or_else(reason)
    }

    /// Returns [`Error::Count`] if the numbers differ.
    pub(crate) fn check_count(
        mesh: MeshId,
        what: &'static str,
        expected: usize,
        found: usize,
    ) -> Result<()> {
        if expected == found {
            return Ok(());
        }
        Err(Self::Count {
            mesh,
            what,
            expected,
            found,
        })
    }

    /// Converts the error of key frames that cannot be joined or streamed.
    pub(crate) fn of_keys(e: geom::KeyFrameError) -> Self {
        Self::Mesh(e.to_string())
    }
}
