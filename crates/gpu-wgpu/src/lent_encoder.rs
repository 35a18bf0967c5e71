//! Submissions recorded into a command encoder that the program submits itself.

use crate::gpu::OpenGpu;
use backend::{Result, Ticket};
use std::collections::VecDeque;
use wgpu::{CommandEncoder, SubmissionIndex};

/// The encoder for the next submission, and the submissions recorded into earlier encoders.
#[derive(Default)]
pub(crate) struct LentEncoder {
    pub(crate) encoder: Option<CommandEncoder>,
    /// Unfinished submissions, oldest first. Each has the index of a later submission to the queue, if one is known.
    pub(crate) under_way: VecDeque<(Ticket, Option<SubmissionIndex>)>,
}

impl LentEncoder {
    /// Returns whether no encoder contains an unfinished submission up to `ticket`. Queue writes would run before such
    /// a submission.
    pub(crate) fn is_past(&self, ticket: u64) -> bool {
        self.under_way.iter().all(|(of, _)| of.0 > ticket)
    }

    /// Waits for a submission in an encoder, if it is known to be in the queue.
    pub(crate) fn wait(&mut self, gpu: &OpenGpu, ticket: Ticket) -> Result<()> {
        let of = self.under_way.iter_mut().find(|(of, _)| *of == ticket);
        match of.and_then(|(_, place)| place.take()) {
            Some(place) => gpu.wait_for(place),
            None => Ok(()),
        }
    }

    /// Notes that a submission and all before it have finished.
    pub(crate) fn finished(&mut self, ticket: Ticket) {
        self.under_way.retain(|(of, _)| *of > ticket);
    }

    /// Notes that a submission was dropped with its encoder.
    pub(crate) fn dropped(&mut self, ticket: Ticket) {
        self.under_way.retain(|(of, _)| *of != ticket);
    }
}
