//! Positions that the backend gives back for trees: of the frame that asks, or, where the backend alone knows where vertices
//! are, also of the next that moves, which shows where they go.

use super::candidate::Request;
use super::trees::bytes;
use super::{Driver, PipelineError};
use crate::builder_thread::{BuildInput, Observed};
use crate::frame::Submission;
use crate::tree_builder::{Vertices, pose_between};
use backend::{Query, Snapshot};
use geom::Pose;
use std::time::Instant;

/// Frames after which a scene is taken to be at rest.
const AT_REST: u64 = 32;

impl Driver {
    /// Whether two frames' positions are read back for a tree. In lockstep it may be due before the second.
    fn observes(&self) -> bool {
        let is_free = self.options.update.adopts_by_cost();
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

    /// Begins the build that waits for positions, once all are there.
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

    /// Begins a build for the frame that asked.
    fn build_read_back(&mut self, positions: Snapshot) -> Result<(), PipelineError> {
        let input = self.input(Vertices::ReadBack(positions));
        self.start_build(input, bytes(self.animation.vertex_count()))
    }
}
