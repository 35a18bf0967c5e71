//! Errors of drivers.

use backend::BackendError;

/// Reason why rendering stopped.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The backend failed.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// The first tree could not be built.
    #[error("the first tree cannot be built: {0}")]
    FirstTree(String),
    /// The builder's threads could not be started.
    #[error("builder threads cannot be started: {0}")]
    Threads(String),
}
