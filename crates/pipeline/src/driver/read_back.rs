//! Positions that the backend gives back for trees: of the frame that asks, or, where the backend alone knows where vertices
//! are, also of the next that moves, which shows where they go.

use super::trees::bytes;
use super::{Driver, PipelineError};
use crate::builder_thread::BuildInput;
use crate::frame::Submission;
use crate::schedule::{Pace, Update};
use crate::tree_builder::{Vertices, pose_between};
use backend::{Query, Snapshot};
use geom::Pose;
use std::time::Instant;

/// Frames after which a scene is taken to be at rest.
const AT_REST: u64 = 32;

impl Driver {
    /// Whether two frames' positions are read back for a tree. In lockstep it may be due before the second.
    fn observes(&self) -> bool {
        let is_free = self.options.update == Update::Async(Pace::Free);
        is_free && !self.knows_key_frames && self.builds_ahead()
    }

    /// Whether the host has to know how far coordinates reach, by which shadow rays are offset, of vertices that it does not.
    pub(super) fn needs_look(&self, queries: &[Query<'_>]) -> bool {
        let casts_shadows = || queries.iter().any(|query| query.kind.light().is_some());
        !self.knows_key_frames && casts_shadows()
    }

    /// Reads positions at `pose` back for that, unless somebody looked at them.
    pub(super) fn look(&mut self, pose: Pose, queries: &[Query<'_>]) -> Result<(), PipelineError> {
        if !self.needs_look(queries) || self.animation.known_range(pose).is_some() {
            return Ok(());
        }
        let positions = self.read_now(pose)?;
        self.animation.measure(pose, &positions);
        // Whatever follows from positions comes with the frame.
        self.pose = None;
        Ok(())
    }

    /// Positions at `pose`, which a submission of its own brings while the frame waits.
    pub(super) fn read_now(&mut self, pose: Pose) -> Result<Snapshot, PipelineError> {
        self.backend.interpolate(pose)?;
        self.backend.request_positions()?;
        let handed_in = Instant::now();
        let ticket = self.backend.submit()?;
        let report = self.backend.wait(ticket)?;
        self.record.fetched = Some(Submission {
            handed_in,
            seen: Instant::now(),
            times: report.times,
        });
        self.record.report = report;
        loop {
            match self.backend.take_positions()? {
                Some((t, positions)) if t == ticket => return Ok(positions),
                Some((_, positions)) => self.take_read_back(positions)?,
                None => std::thread::yield_now(),
            }
        }
    }

    /// Whether the builder needs the positions of the frame at hand.
    pub(super) fn wants_positions(&mut self, moved: bool) -> bool {
        let (observes, frame) = (self.observes(), self.frames);
        let pending = self.build.as_mut().filter(|f| f.arrived.is_none());
        let Some(pending) = pending else {
            return false;
        };
        let is_first = pending.frame == frame;
        let is_second = observes && moved && !is_first && pending.moved_at.is_none();
        if is_second {
            pending.moved_at = Some(self.record.frame.time);
        }
        is_first || is_second
    }

    /// Begins the build that waits for positions, once all are there.
    pub(super) fn poll_read_back(&mut self) -> Result<(), PipelineError> {
        let waits = self.build.as_ref().is_some_and(|f| f.arrived.is_none());
        if waits && let Some((_, positions)) = self.backend.take_positions()? {
            self.take_read_back(positions)?;
        }
        let frames = self.frames;
        let at_rest = self.build.as_mut().filter(|f| {
            let since = frames - f.frame;
            f.moved_at.is_none() && since > AT_REST
        });
        match at_rest.and_then(|f| f.observed.take()) {
            Some(positions) => self.build_read_back(positions),
            None => Ok(()),
        }
    }

    fn take_read_back(&mut self, positions: Snapshot) -> Result<(), PipelineError> {
        let observes = self.observes();
        let Some(pending) = &mut self.build else {
            return Ok(());
        };
        let seen = pending.observed.take().zip(pending.moved_at);
        let Some((earlier, moved_at)) = seen else {
            if !observes {
                return self.build_read_back(positions);
            }
            pending.observed = Some(positions);
            return Ok(());
        };
        let at = |time| pose_between([pending.time, moved_at], time);
        let middle = at(pending.middle);
        let input = BuildInput {
            vertices: Vertices::KeyFrames(middle),
            halves: Some(pending.halves.map(at)),
            rival_at: Some(middle),
            observed: Some([earlier, positions]),
        };
        self.start_build(input, 2 * bytes(self.animation.vertex_count()))
    }

    /// Begins a build for the frame that asked.
    fn build_read_back(&mut self, positions: Snapshot) -> Result<(), PipelineError> {
        let input = self.input(Vertices::ReadBack(positions));
        self.start_build(input, bytes(self.animation.vertex_count()))
    }
}
