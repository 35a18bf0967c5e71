//! What can go wrong.

use crate::MeshId;
use backend::BackendError;
use pipeline::PipelineError;

/// Shorthand.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Why something was not done. Nothing panics that a caller could cause.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Parts of a mesh do not fit together.
    #[error("the mesh does not fit together: {0}")]
    Mesh(String),
    /// A step gave a mesh another number of vertices or matrices than it has.
    #[error("mesh {} takes {expected} {what}, {found} were given", mesh.index())]
    Count {
        /// Whose they are.
        mesh: MeshId,
        /// Of what: vertices, or matrices.
        what: &'static str,
        /// How many it has.
        expected: usize,
        /// How many were given.
        found: usize,
    },
    /// The mesh belongs to another scene.
    #[error("mesh {} is of another scene", .0.index())]
    ForeignMesh(MeshId),
    /// The mesh moves in another way: vertices are for streamed meshes, matrices for rigid ones.
    #[error("mesh {} takes no {what}", mesh.index())]
    Motion {
        /// Whose they were to be.
        mesh: MeshId,
        /// Vertices, or matrices.
        what: &'static str,
    },
    /// Meshes were moved after a query of the same step, or the step was to be encoded after one of the host's rays or a
    /// picture.
    #[error("the step has begun to trace")]
    TooLate,
    /// The replacement of this mesh was prepared for another tracer.
    #[error("the replacement of mesh {} is of another tracer", .0.index())]
    ForeignReplacement(MeshId),
    /// The replacement of this mesh was begun before another replacement of the same mesh was committed.
    #[error("the replacement of mesh {} was begun before another of the same mesh was committed", .0.index())]
    Conflict(MeshId),
    /// The query is of another step or tracer, or its result was dropped. A result can be read any number of times until the
    /// second step after its own is submitted. Steps that are dropped have no results and do not count.
    #[error("there is no result of this query any more, or it is of another step")]
    NoResult,
    /// A key frame cannot be read, or a file that is to have some.
    #[error("{0}")]
    KeyFrame(String),
    /// No device suits, or the one named cannot run here.
    #[error("{0}")]
    NoDevice(String),
    /// The device does not do what was asked, or the scene is beyond its limits; or so many threads are beyond the machine's.
    #[error("{0}")]
    Unsupported(String),
    /// The program broke a rule of the interface, which the message names. The tracer stays usable.
    #[error("{0}")]
    Misuse(String),
    /// Vertices of this mesh that only the device had are gone, because a step that used them failed or was dropped. The next
    /// step has to give them again.
    #[error("a step that failed or was dropped had vertices of mesh {} on the device: they have to come again", .0.index())]
    VerticesLost(MeshId),
    /// The memory of the device or of the host is too small. A smaller request may succeed.
    #[error("{0}")]
    OutOfMemory(String),
    /// The device is gone for good, unplugged or reset: only a new tracer helps.
    #[error("{0}")]
    DeviceLost(String),
    /// The driver refused a call, or a build of a tree failed: a fault in the driver or in the library.
    #[error("{0}")]
    Device(String),
}

// No `From`: what is inside is no promise.
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

    pub(crate) fn of_reading(e: geom::KeyFrameError) -> Self {
        Self::KeyFrame(e.0)
    }

    pub(crate) fn of_keys(e: geom::KeyFrameError) -> Self {
        Self::Mesh(e.to_string())
    }
}
