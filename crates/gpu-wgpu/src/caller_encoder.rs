//! Submissions recorded into a command encoder that the program submits itself.

use crate::gpu::OpenGpu;
use backend::{Result, Ticket};
use std::collections::BTreeMap;
use wgpu::{CommandEncoder, SubmissionIndex};

/// The encoder for the next submission, and the submissions recorded into earlier encoders.
#[derive(Default)]
pub(crate) struct CallerEncoder {
    pub(crate) encoder: Option<CommandEncoder>,
    /// Unfinished submissions. wgpu does not return the index of the program's own submission, so an entry has the index
    /// of a later one, or `None` if it is not known.
    pub(crate) under_way: BTreeMap<Ticket, Option<SubmissionIndex>>,
}

impl CallerEncoder {
    /// Returns whether all unfinished submissions in encoders are later than `ticket`. If not, a queue write could run
    /// before a submission that still uses the buffer.
    pub(crate) fn is_past(&self, ticket: u64) -> bool {
        let oldest = self.under_way.first_key_value();
        oldest.is_none_or(|(oldest, _)| oldest.0 > ticket)
    }

    /// Waits for a submission in an encoder, if it is known to be in the queue.
    pub(crate) fn wait(&mut self, gpu: &OpenGpu, ticket: Ticket) -> Result<()> {
        let submission = self.under_way.get_mut(&ticket);
        match submission.and_then(Option::take) {
            Some(submission) => gpu.wait_for(submission),
            None => Ok(()),
        }
    }
}
