//! Submissions recorded into a command encoder that the program submits itself.

use crate::gpu::OpenGpu;
use backend::{Result, Ticket};
use std::collections::BTreeMap;
use wgpu::{CommandEncoder, SubmissionIndex};

/// The encoder for the next submission, and the submissions recorded into earlier encoders.
#[derive(Default)]
pub(crate) struct CallerEncoder {
    pub(crate) encoder: Option<CommandEncoder>,
    /// Unfinished submissions. Each has the index of a later submission to the queue, if one is known.
    pub(crate) under_way: BTreeMap<Ticket, Option<SubmissionIndex>>,
}

impl CallerEncoder {
    /// Returns whether no encoder contains an unfinished submission up to `ticket`. A queue write could run before such
    /// a submission.
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
