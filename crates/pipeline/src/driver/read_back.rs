//! Reads positions back from the backend, for trees that are not built from key frames and for the coordinate range.

use super::Driver;
use super::next_tree::{Event, NextTreeState};
use crate::error::PipelineError;
use crate::tree_builder::{BuildInput, Observed, Vertices, pose_between};
use backend::{Query, Snapshot};
use geom::Pose;

/// Number of frames without motion after which a scene is considered at rest.
const AT_REST: u64 = 32;

impl Driver {
    /// Returns whether a build uses the positions of two frames. In lockstep it does not, because a tree may be due
    /// before the second frame.
    fn observes_two_frames(&self) -> bool {
        let options = &self.options;
        options.update.adopts_by_cost() && options.builds_ahead() && !self.knows_key_frames
    }

    /// Returns whether the range of coordinates must be measured because only the backend has the positions. The range
    /// determines the offset of shadow rays.
    pub(super) fn must_measure_coordinate_range(&self, queries: &[Query<'_>]) -> bool {
        let casts_shadows = || queries.iter().any(|query| query.kind.light().is_some());
        !self.knows_key_frames && casts_shadows()
    }

    /// Reads positions at `pose` back and measures their range, if it must be measured and is not known.
    pub(super) fn measure_coordinate_range(
        &mut self,
        pose: Pose,
        queries: &[Query<'_>],
    ) -> Result<(), PipelineError> {
        if !self.must_measure_coordinate_range(queries)
            || self.animation.known_range(pose).is_some()
        {
            return Ok(());
        }
        let positions = self.read_now(pose)?;
        self.animation.measure(pose, &positions);
        // The frame itself records `interpolate` and the later stages again.
        self.recording.pose = None;
        Ok(())
    }

    /// Returns the positions at `pose`, from a separate submission that the frame waits for.
    pub(super) fn read_now(&mut self, pose: Pose) -> Result<Snapshot, PipelineError> {
        self.backend.interpolate(pose)?;
        self.backend.request_positions()?;
        let ticket = self.backend.submit()?;
        let report = self.backend.wait(ticket)?;
        self.recording.record.complete(report);
        loop {
            match self.backend.take_positions()? {
                Some((t, positions)) if t == ticket => return Ok(positions),
                Some((_, positions)) => self.take_read_back(positions),
                None => std::thread::yield_now(),
            }
        }
    }

    /// Returns whether the builder needs the positions of the current frame.
    pub(super) fn wants_positions(&mut self, moved: bool) -> bool {
        let observes_two_frames = self.observes_two_frames();
        let NextTreeState::Requested(request, observation) = &mut self.trees.next else {
            return false;
        };
        let number = self.recording.number;
        let is_first = request.frame == number;
        // If a frame fails before it is submitted, the next one has the same number and requests the positions again.
        let has_second = observation.second.is_some_and(|second| second != number);
        let is_second = observes_two_frames && moved && !is_first && !has_second;
        if is_second {
            observation.second = Some(number);
            request.last_time = self.recording.record.frame.time;
            request.last_pose = self.animation.pose(request.last_time);
        }
        is_first || is_second
    }

    /// Starts the build that waits for positions, once all have arrived or the scene is at rest.
    pub(super) fn poll_read_back(&mut self) -> Result<(), PipelineError> {
        let waits = matches!(self.trees.next, NextTreeState::Requested(..));
        if waits {
            let arrived = self.backend.take_positions().inspect_err(|_| {
                // Withdraws the request. A later frame requests another tree, with its own positions.
                self.trees.next.advance(Event::ResultsLost);
            });
            if let Some((_, positions)) = arrived? {
                self.take_read_back(positions);
            }
        }
        let NextTreeState::Requested(request, observation) = &mut self.trees.next else {
            return Ok(());
        };
        let is_at_rest = self.recording.number - request.frame > AT_REST;
        if is_at_rest
            && observation.second.is_none()
            && let Some(positions) = observation.first.take()
        {
            self.start_build(BuildInput::of(Vertices::ReadBack(positions)));
        }
        Ok(())
    }

    /// Starts the build that waits for these positions. If the build observes two frames, stores the positions of the
    /// first until those of the second arrive.
    fn take_read_back(&mut self, positions: Snapshot) {
        if !self.observes_two_frames() {
            return self.start_build(BuildInput::of(Vertices::ReadBack(positions)));
        }
        let NextTreeState::Requested(request, observation) = &mut self.trees.next else {
            return;
        };
        let seen = observation.first.take().zip(observation.second);
        let Some((earlier, _)) = seen else {
            observation.first = Some(positions);
            return;
        };
        // The tree is built for this time, not for the requesting frame.
        request.pose = self.animation.pose(request.target_time);
        let times = [request.time, request.last_time];
        let at = |time| pose_between(times, time);
        let input = BuildInput {
            swept_poses: Some(request.swept_times.map(at)),
            observed: Some(Observed {
                frames: [earlier, positions],
                times,
            }),
            ..BuildInput::of(Vertices::AtPose(at(request.target_time)))
        };
        self.start_build(input);
    }
}
