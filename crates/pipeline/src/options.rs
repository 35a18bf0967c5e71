//! What a driver is asked to do, and why it may stop.

use crate::schedule::Update;
use backend::{BackendError, Method};

/// Why rendering stopped.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The backend failed.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// The first tree could not be built.
    #[error("the first tree: {0}")]
    FirstTree(String),
    /// The builder's threads could not be started.
    #[error("no builder threads: {0}")]
    Threads(String),
}

/// What a driver is to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriverOptions {
    /// How the backend traces.
    pub method: Method,
    /// How trees follow the motion.
    pub update: Update,
    /// Threads a build may use, beside the backend's own.
    pub builder_threads: usize,
    /// First and last time that will be rendered, in key frames: what
    /// [`Update::TSah`] builds its tree for, and what no prediction goes beyond.
    pub time_range: [f64; 2],
    /// With [`Update::Async`]: build each tree for the middle of the time it is
    /// going to be used, from key frames, instead of for the frame that asks,
    /// from the backend's vertices.
    pub predict: bool,
}
