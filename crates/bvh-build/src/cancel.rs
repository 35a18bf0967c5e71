//! Cancellation of a build.

use std::sync::atomic::{AtomicBool, Ordering};

/// Reason for a failed build.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BuildError {
    /// The build was cancelled by [`Cancel::cancel`].
    #[error("the build was cancelled")]
    Cancelled,
    /// A key frame cannot be read.
    #[error(transparent)]
    KeyFrame(#[from] geom::KeyFrameError),
}

/// Cancellation flag of a build. It cannot be reset. Large nodes check it, small nodes run to completion.
#[derive(Debug, Default)]
pub struct Cancel(AtomicBool);

impl Cancel {
    /// Creates a flag that is not set.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Requests that the build stops.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Returns whether the flag is set.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
