//! Traces that nobody counts: a device that was idle is slow at first.

use super::Driver;
use crate::options::PipelineError;
use backend::{FRAMES_IN_FLIGHT, FrameReport, Query};
use std::collections::VecDeque;

impl Driver {
    /// Traces `query` with the last frame's tree at the last frame's positions, again and again as long as `again`
    /// wants, which hears what the device says of each. As many as the backend allows are under way, so that the device
    /// never waits for the host.
    ///
    /// No tree ages, no time goes on, nobody is asked for a tree: the frames to come are what they would have been.
    /// (A build in flight goes on meanwhile; there is none yet after the first frame.)
    ///
    /// # Errors
    /// The backend's.
    ///
    /// # Panics
    /// Before the first frame, or while a frame is under way.
    pub fn rehearse(
        &mut self,
        query: Query<'_>,
        mut again: impl FnMut(&FrameReport) -> bool,
    ) -> Result<(), PipelineError> {
        assert!(self.tree.is_some(), "a frame comes first");
        assert!(self.pending.is_empty(), "a frame is under way");
        let mut under_way = VecDeque::with_capacity(FRAMES_IN_FLIGHT);
        let mut wanted = true;
        loop {
            while wanted && under_way.len() < FRAMES_IN_FLIGHT {
                self.backend.trace(query)?;
                under_way.push_back(self.backend.submit()?);
            }
            let Some(ticket) = under_way.pop_front() else {
                return Ok(());
            };
            let report = self.backend.wait(ticket)?;
            wanted = wanted && again(&report);
        }
    }
}
