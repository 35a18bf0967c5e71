//! Inputs from another interface to the GPU: positions, rays and semaphores.

use crate::memory::Buffer;
use crate::timeline::{SemaphoreValue, Timeline};
use backend::Result;
use gpu_common::{ExternalPoints, LentBuffers};
use std::sync::Arc;

/// Inputs in external memory, and the semaphores that order their use.
#[derive(Default)]
pub(crate) struct ExternalInputs {
    pub(crate) points: ExternalPoints<Buffer>,
    /// Buffer for all positions of the scene. Contains the latest external ones.
    pub(crate) positions: Option<Buffer>,
    /// Rays of the next query.
    pub(crate) lent: LentBuffers<Buffer>,
    /// Semaphore values that must be reached before external memory is read or written.
    pub(crate) waits: Vec<SemaphoreValue>,
    /// Signals that are not known to have been reached.
    pub(crate) signals: Vec<Signal>,
}

/// A timeline value to signal for the program. Keeps the timeline alive, because submitted work may still wait for
/// lower values.
#[derive(Clone)]
pub(crate) struct Signal {
    pub(crate) timeline: Arc<Timeline>,
    pub(crate) value: u64,
    pub(crate) is_submitted: bool,
}

impl ExternalInputs {
    /// Waits until the submitted signals are reached.
    pub(crate) fn wait(&self) -> Result<()> {
        let mut submitted = self.signals.iter().filter(|signal| signal.is_submitted);
        submitted.try_for_each(|signal| signal.timeline.wait(signal.value))
    }
}
