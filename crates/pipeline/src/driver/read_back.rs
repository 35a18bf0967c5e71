//! Reads positions back from the backend for builds: those of the requesting frame. If only the backend has the
//! positions, also those of the next frame that moves, to extrapolate the motion.

use super::candidate::Request;
use super::trees::bytes;
use super::{Driver, PipelineError};
use crate::builder_thread::{BuildInput, Observed};
use crate::frame::Submission;
use crate::tree_builder::{Vertices, pose_between};
use backend::{Query, Snapshot};
use geom::Pose;
use std::time::Instant;

/// Number of frames without motion after which a scene is considered at rest.
const AT_REST: u64 = 32;

impl Driver {
    /// Returns whether a build uses the positions of two frames. In lockstep a tree may be due before the second frame.
    fn observes(&self) -> bool {
        let is_free = self.options.update.adopts_by_cost();
        is_free && !self.knows_key_frames && self.builds_ahead()
    }

    /// Returns whether the range of coordinates must be measured because only the backend has the positions. The range
    /// determines the offset of shadow rays.
    pub(super) fn needs_look(&self, queries: &[Query<'_>]) -> bool {
        let casts_shadows = || queries.iter().any(|query| query.kind.light().is_some());
        !self.knows_key_frames && casts_shadows()
    }

    /// Reads positions at `pose` back and measures their range, unless it is known.
    pub(super) fn look(&mut self, pose: Pose, queries: &[Query<'_>]) -> Result<(), PipelineError> {
        if !self.needs_look(queries) || self.animation.known_range(pose).is_some() {
            return Ok(());
        }
        let positions = self.read_now(pose)?;
        self.animation.measure(pose, &positions);
        // The frame itself records `interpolate` and the later stages again.
        self.pose = None;
        Ok(())
    }

    /// Returns the positions at `pose`, from a separate submission that the frame waits for.
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

    /// Returns whether the builder needs the positions of the current frame.
    pub(super) fn wants_positions(&mut self, moved: bool) -> bool {
        let (observes, frame) = (self.observes(), self.frames);
        let time = self.record.frame.time;
        let Some(request) = self.waiting_request() else {
            return false;
        };
        let is_first = request.frame == frame;
        let is_second = observes && moved && !is_first && request.moved_at.is_none();
        if is_second {
            request.moved_at = Some(time);
        }
        is_first || is_second
    }

    /// Starts the build that waits for positions, once all have arrived or the scene is at rest.
    pub(super) fn poll_read_back(&mut self) -> Result<(), PipelineError> {
        let waits = self.waiting_request().is_some();
        if waits && let Some((_, positions)) = self.backend.take_positions()? {
            self.take_read_back(positions)?;
        }
        let frames = self.frames;
        let at_rest = self.waiting_request().filter(|request| {
            let since = frames - request.frame;
            request.moved_at.is_none() && since > AT_REST
        });
        match at_rest.and_then(|request| request.observed.take()) {
            Some(positions) => self.build_read_back(positions),
            None => Ok(()),
        }
    }

    /// Returns the request whose vertices have not all arrived.
    fn waiting_request(&mut self) -> Option<&mut Request> {
        let request = self.candidate.as_mut().map(|c| &mut c.request);
        request.filter(|request| request.vertices_arrived.is_none())
    }

    fn take_read_back(&mut self, positions: Snapshot) -> Result<(), PipelineError> {
        let observes = self.observes();
        let Some(candidate) = &mut self.candidate else {
            return Ok(());
        };
        let request = &mut candidate.request;
        let seen = request.observed.take().zip(request.moved_at);
        let Some((earlier, moved_at)) = seen else {
            if !observes {
                return self.build_read_back(positions);
            }
            request.observed = Some(positions);
            return Ok(());
        };
        let times = [request.time, moved_at];
        let at = |time| pose_between(times, time);
        let input = BuildInput {
            vertices: Vertices::KeyFrames(at(request.middle)),
            halves: Some(request.halves.map(at)),
            observed: Some(Observed {
                frames: [earlier, positions],
                times,
            }),
        };
        self.start_build(input, 2 * bytes(self.animation.vertex_count()))
    }

    /// Starts a build from the positions of the frame that requested the tree.
    fn build_read_back(&mut self, positions: Snapshot) -> Result<(), PipelineError> {
        let input = self.input(Vertices::ReadBack(positions));
        self.start_build(input, bytes(self.animation.vertex_count()))
    }
}
