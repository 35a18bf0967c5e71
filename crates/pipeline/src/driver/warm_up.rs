//! Frames that nobody counts: a device that was idle is slow at first.

use super::{Driver, PipelineError};
use crate::schedule::{Pace, Update};
use crate::tree_builder::TreeBuilder;
use backend::{FRAMES_IN_FLIGHT, FrameReport, Query};
use bvh_build::Cancel;
use std::collections::VecDeque;

impl Driver {
    /// Traces `query` with the last frame's tree at the last frame's positions, again and again as long as `again`
    /// wants, which hears what the device says of each. As many as the backend allows are under way, so that the device
    /// never waits for the host.
    ///
    /// No tree ages, no time goes on, nobody is asked for a tree: the frames to come are what they would have been.
    /// (A build in flight goes on meanwhile; there is none yet after the first frame.) A builder that runs free first
    /// makes a tree that is thrown away, so that those to come find their memory: see `TreeBuilder::warm_up`.
    ///
    /// # Errors
    /// The backend's.
    ///
    /// # Panics
    /// Before the first frame, or while a frame is under way.
    pub fn warm_up(
        &mut self,
        query: Query<'_>,
        again: impl FnMut(&FrameReport) -> bool,
    ) -> Result<(), PipelineError> {
        self.warm_up_builder();
        self.over_and_over(|driver| Ok(driver.backend.trace(query)?), again)
    }

    /// Warms the builder up, if one is to run free and has nothing to do.
    fn warm_up_builder(&self) {
        let runs_free = self.options.update == Update::Async(Pace::Free);
        if let Some(pose) = self.pose.filter(|_| runs_free && self.build.is_none()) {
            // Nothing comes of it either way; the first tree that counts will tell what is wrong.
            let animation = &self.animation;
            let warmed =
                |builder: &mut TreeBuilder| builder.warm_up(animation, pose, &Cancel::new());
            let _ = self.builder_pool.with(warmed);
        }
    }

    /// Likewise, with all that comes before the rays: the last frame as a whole, with the tree that it had. Where the
    /// backend makes a tree in each frame, it makes that again, by the next generation.
    ///
    /// Rays then find in the device's caches what they find there in any frame, not what the last rays left.
    ///
    /// # Errors
    /// The backend's.
    ///
    /// # Panics
    /// As [`Driver::warm_up`].
    pub fn repeat(
        &mut self,
        query: Query<'_>,
        again: impl FnMut(&FrameReport) -> bool,
    ) -> Result<(), PipelineError> {
        self.over_and_over(|driver| driver.record_once_more(query), again)
    }

    fn over_and_over(
        &mut self,
        mut record: impl FnMut(&mut Self) -> Result<(), PipelineError>,
        mut again: impl FnMut(&FrameReport) -> bool,
    ) -> Result<(), PipelineError> {
        assert!(self.tree.is_some(), "a frame comes first");
        assert!(self.pending.is_empty(), "a frame is under way");
        let mut under_way = VecDeque::with_capacity(FRAMES_IN_FLIGHT);
        let mut wanted = true;
        loop {
            while wanted && under_way.len() < FRAMES_IN_FLIGHT {
                record(self)?;
                under_way.push_back(self.backend.submit()?);
            }
            let Some(ticket) = under_way.pop_front() else {
                return Ok(());
            };
            let report = self.backend.wait(ticket)?;
            wanted = wanted && again(&report);
        }
    }

    /// Records the last frame's stages as if it had moved to where it stands.
    fn record_once_more(&mut self, query: Query<'_>) -> Result<(), PipelineError> {
        let pose = self.pose.take().expect("a frame comes first");
        let asked_at = self.tree.as_ref().map(|tree| tree.frame);
        let stale = if self.makes_trees() {
            self.record_own_tree(pose)?
        } else {
            self.record_geometry(pose)?
        };
        // A tree made again is none of a frame to come.
        if let (Some(tree), Some(frame)) = (&mut self.tree, asked_at) {
            tree.frame = frame;
        }
        self.record_stages(stale, query)
    }
}
