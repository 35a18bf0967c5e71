//! Requests trees, passes vertices to the builder thread, and evaluates and adopts the trees that it builds.

use super::Driver;
use super::next_tree::{CandidateTree, Evaluation, Event, NextTreeState, Request, Verdict};
use super::pause::RequestPause;
use crate::builder_thread::BuildResult;
use crate::error::PipelineError;
use crate::frame::ms;
use crate::tree_builder::{BuildInput, Built, Vertices};
use backend::{FrameReport, Generation, Ticket};
use geom::Pose;
use std::time::Instant;

/// The trees of a driver.
#[derive(Default)]
pub(super) struct Trees {
    /// `None` before the first frame.
    pub(super) current: Option<CurrentTree>,
    pub(super) next: NextTreeState,
    /// Generation of the last requested tree; 0 before the first request. Generations only increase.
    pub(super) newest: Generation,
    /// Pause between requests after trees were rejected.
    pause: RequestPause,
    /// Pose for which the last build produced no better tree than the current one.
    no_better_at: Option<Pose>,
}

/// The tree that frames are traced with.
pub(super) struct CurrentTree {
    pub(super) request: Request,
    /// Cost at the vertices that the tree was built from; 0 if the device built it.
    pub(super) cost: f64,
}

impl Driver {
    /// Passes vertices to the builder, takes finished trees and uploads them. Does not wait for a build.
    pub(super) fn poll_builder(&mut self) -> Result<(), PipelineError> {
        self.poll_read_back()?;
        if let Some(result) = self.builder.thread.try_take() {
            self.take_result(result);
        }
        self.upload_next().map(drop)
    }

    /// Polls the builder after a frame was submitted or has finished. An error must not discard this frame. The next
    /// frame repeats a failed upload and returns its error.
    pub(super) fn poll_builder_after_frame(&mut self) {
        let _ = self.poll_builder();
    }

    fn take_result(&mut self, result: BuildResult<Built>) {
        let event = result.map_or_else(|_| Event::BuildFailed, Event::BuildFinished);
        self.trees.next.advance(event);
    }

    /// Uploads a finished tree while frames are rendered. Rejects the tree if it exceeds the memory or a limit of the
    /// device. Returns `false` while the upload is unfinished.
    fn upload_next(&mut self) -> Result<bool, PipelineError> {
        let NextTreeState::Waiting(tree) = &self.trees.next else {
            return Ok(true);
        };
        let (topology, generation) = (&tree.built.topology, tree.request.generation);
        match self.backend.upload_tree(topology, generation) {
            Err(e) if e.is_too_large() => {
                self.trees.next.advance(Event::UploadFailed);
                self.pause_if_rejected();
                Ok(true)
            }
            uploaded => Ok(uploaded?),
        }
    }

    /// Adopts or drops the next tree and requests another one, before the frame at `pose` is recorded. At most one
    /// build is in flight.
    pub(super) fn update_trees(&mut self, pose: Pose) -> Result<(), PipelineError> {
        let Some(current) = &self.trees.current else {
            return self.build_first(pose);
        };
        let request = self.trees.next.request();
        let newest_pose = request.map_or(current.request.pose, |request| request.pose);
        self.review_next()?;
        let target = self.target_pose(pose);
        let is_done = newest_pose == target || self.trees.no_better_at == Some(target);
        let should_request = self.options.update.requests_trees() && !is_done && self.may_request();
        if self.is_swap_due() {
            self.swap()?;
        }
        if should_request && self.trees.next.is_idle() {
            self.request_tree(target)?;
        }
        Ok(())
    }

    /// Returns whether this frame adopts or drops the next tree. In lockstep, the tree may be unfinished.
    fn is_swap_due(&self) -> bool {
        let (next, number) = (&self.trees.next, self.recording.number);
        match self.options.update.lockstep() {
            Some(k) => next
                .request()
                .is_some_and(|request| number >= request.frame + u64::from(k)),
            None => next.is_decided(),
        }
    }

    /// Returns the pose that a tree should be built for if the frame at `pose` requests it.
    fn target_pose(&self, pose: Pose) -> Pose {
        if self.predicts() {
            self.animation.pose(self.predictor.target_time())
        } else {
            pose
        }
    }

    fn poses(&self, times: [f64; 2]) -> [Pose; 2] {
        times.map(|time| self.animation.pose(time))
    }

    /// Applies the adoption rule to a tree that has arrived on the device.
    pub(super) fn review_next(&mut self) -> Result<(), PipelineError> {
        if !self.upload_next()? {
            return Ok(());
        }
        let current = self.trees.current.as_ref();
        let current = current.map_or(f64::NAN, |tree| tree.request.target_time);
        let NextTreeState::Waiting(tree) = &mut self.trees.next else {
            return Ok(());
        };
        if !std::mem::replace(&mut tree.has_arrived, true) {
            let latency = self.recording.number - tree.request.frame;
            self.predictor.observe_latency(latency, tree.built.strategy);
            self.predictor.next_strategy_is(tree.built.next);
        }
        if let Some(event) = self.options.review(tree, current, &self.predictor) {
            self.trees.next.advance(event);
        }
        Ok(())
    }

    /// Records the evaluation of a tree that is due, at the positions recorded for this frame.
    pub(super) fn record_evaluation(&mut self) -> Result<(), PipelineError> {
        let (NextTreeState::Due(tree), Some(pose)) = (&self.trees.next, self.recording.pose) else {
            return Ok(());
        };
        let (topology, generation) = (&tree.built.topology, tree.request.generation);
        let approach = self.predictor.approach(tree.request.target_time);
        let event = if self.backend.evaluate(topology, generation)? {
            Event::EvaluationRecorded(Evaluation {
                ticket: None,
                frame: self.recording.number,
                pose,
                approach: approach.filter(|_| self.options.builds_ahead()),
            })
        } else {
            Event::Admitted
        };
        self.trees.next.advance(event);
        Ok(())
    }

    /// Processes the costs of the current and the next tree in a finished frame's report.
    pub(super) fn process_costs(&mut self, ticket: Ticket, report: &FrameReport) {
        if let Some(cost) = report.sah_cost {
            self.trees.pause.observe_cost(cost);
        }
        let Some(evaluation) = self.trees.next.evaluation_in(ticket) else {
            return;
        };
        let frames = self.recording.number - evaluation.frame;
        self.predictor.observe_evaluation(frames);
        let verdict = Verdict::of(report, &evaluation);
        self.trees.next.advance(Event::Evaluated(verdict));
        self.pause_if_rejected();
    }

    /// Begins a pause if the next tree was rejected just now.
    fn pause_if_rejected(&mut self) {
        let number = self.recording.number;
        if let NextTreeState::Rejected(tree, _) = &self.trees.next {
            let frames = number - tree.request.frame;
            self.trees.pause.rejected(number, frames);
        }
    }

    /// Returns whether trees may be requested. If trees are adopted by cost, this requires a latency estimate. A pause
    /// after rejections then prevents requests, unless the scene is at rest.
    fn may_request(&self) -> bool {
        let is_paused = self.trees.pause.covers(self.recording.number);
        let is_allowed = self.predictor.is_at_rest() || !is_paused;
        (self.predictor.has_estimate() && is_allowed) || !self.options.update.adopts_by_cost()
    }

    /// Returns whether trees are built from key frames, for a future time.
    fn predicts(&self) -> bool {
        self.knows_key_frames && self.options.builds_ahead()
    }

    /// Requests a tree for `pose`. With `rebuild` or lockstep 0, also builds and adopts it.
    fn request_tree(&mut self, pose: Pose) -> Result<(), PipelineError> {
        self.trees.newest.0 += 1;
        let request = self.request(self.trees.newest, pose);
        if self.options.update.waits_for_tree() {
            let built = self.build_now(request, None)?;
            return built.map_or(Ok(()), |tree| self.adopt(tree));
        }
        let swept_times = request.swept_times;
        self.trees.next.advance(Event::Requested(request));
        if self.predicts() {
            let is_swept = self.options.update.adopts_by_cost();
            self.start_build(BuildInput {
                swept_poses: is_swept.then(|| self.poses(swept_times)),
                key_frames: self.animation.streamed_keys(pose),
                ..BuildInput::of(Vertices::AtPose(pose))
            });
        }
        Ok(())
    }

    /// Builds the first tree while the first frame waits.
    fn build_first(&mut self, pose: Pose) -> Result<(), PipelineError> {
        // The backend may have uploaded a tree that could not be adopted, so each attempt has its own generation.
        self.trees.newest.0 += 1;
        let mut request = self.request(self.trees.newest, pose);
        // If `async` predicts from key frames, the first tree is built for a time interval instead of one frame.
        let ahead = self.predicts() && self.options.update.adopts_by_cost();
        let swept_times = self.predictor.swept_times_of_first_tree().filter(|_| ahead);
        if let Some([a, b]) = swept_times {
            request.target_time = f64::midpoint(a, b);
        }
        let mut built = self.build_now(request, swept_times.map(|times| self.poses(times)))?;
        if built.is_err() && swept_times.is_some() {
            // A key frame of a later time may be unreadable. The frame itself does not need it.
            built = self.build_now(self.request(self.trees.newest, pose), None)?;
        }
        let tree = built.map_err(PipelineError::FirstTree)?;
        self.predictor.observe_first_build(tree.built.total_time);
        self.adopt(tree)
    }

    pub(super) fn request(&self, generation: Generation, pose: Pose) -> Request {
        let time = self.recording.record.frame.time;
        Request {
            generation,
            frame: self.recording.number,
            time,
            last_time: time,
            last_pose: self.animation.pose(time),
            pose,
            target_time: self.predictor.target_time(),
            swept_times: self.predictor.swept_times(),
        }
    }

    /// Starts the build of the requested tree from this input.
    pub(super) fn start_build(&mut self, mut input: BuildInput) {
        let NextTreeState::Requested(request, _) = &self.trees.next else {
            return;
        };
        input.is_compared = self.options.update.adopts_by_cost();
        // An error is ignored here: without a writer, `upload_tree` writes the tree itself. If the error persists,
        // `upload_tree` returns it.
        let writer = self.backend.tree_writer(request.generation);
        input.writer = writer.unwrap_or_default();
        input.toward = self.recording.light;
        self.trees.next.advance(Event::BuildStarted);
        if self.builder.thread.start(input).is_err() {
            self.trees.next.advance(Event::BuildFailed);
        }
    }

    /// Adopts or drops the next tree. Blocks until it is built.
    fn swap(&mut self) -> Result<(), PipelineError> {
        if !self.trees.next.is_decided() {
            let start = Instant::now();
            self.wait_for_builder()?;
            self.recording.record.build_wait_ms += ms(start.elapsed());
            self.trees.next.advance(Event::Admitted);
        }
        let number = self.recording.number;
        match std::mem::take(&mut self.trees.next) {
            NextTreeState::Accepted(tree) => {
                let frames = number - tree.request.frame;
                // A predicted tree is usually evaluated before its target time, so the ratio does not show how much it
                // saves there. Its adoption ends the pauses, whatever the ratio is.
                let cost_ratio = tree.cost_ratio.filter(|_| !self.predicts());
                self.adopt(tree)?;
                let cost_ratio = cost_ratio.unwrap_or(0.0);
                self.trees.pause.adopted(number, frames, cost_ratio);
            }
            NextTreeState::Rejected(tree, costlier_pose) => {
                self.recording.record.tree.rejected = true;
                // Another tree may be requested for this pose if this one was superseded, or evaluated at another pose.
                self.trees.no_better_at = costlier_pose.filter(|&pose| pose == tree.request.pose);
                self.builder.discard(tree.built.topology);
            }
            // The build failed.
            _ => (),
        }
        Ok(())
    }

    /// Blocks until the next tree is built or its build fails. Only lockstep calls this.
    fn wait_for_builder(&mut self) -> Result<(), PipelineError> {
        loop {
            self.poll_builder()?;
            match self.trees.next {
                NextTreeState::Requested(..) => std::thread::yield_now(),
                NextTreeState::Building(_) => {
                    let result = self.builder.thread.take();
                    self.take_result(result);
                }
                _ => return Ok(()),
            }
        }
    }

    /// Builds a tree while the frame waits, from the backend's positions at the request's pose. With `swept_poses`,
    /// the tree is built over boxes that contain each triangle at both poses.
    fn build_now(
        &mut self,
        request: Request,
        swept_poses: Option<[Pose; 2]>,
    ) -> Result<BuildResult<CandidateTree>, PipelineError> {
        let positions = self.read_now(request.pose)?;
        self.recording.pose = Some(request.pose);
        let start = Instant::now();
        let input = BuildInput {
            swept_poses,
            toward: self.recording.light,
            ..BuildInput::of(Vertices::ReadBack(positions))
        };
        let built = self.builder.build_now(input);
        self.recording.record.build_wait_ms += ms(start.elapsed());
        Ok(built.map(|built| CandidateTree::new(request, built)))
    }

    fn adopt(&mut self, tree: CandidateTree) -> Result<(), PipelineError> {
        let CandidateTree { request, built, .. } = tree;
        self.backend.adopt(&built.topology, request.generation)?;
        self.trees.current = Some(CurrentTree {
            request,
            cost: built.cost,
        });
        let stats = &mut self.recording.record.tree;
        stats.adopted = true;
        stats.build_ms = Some(ms(built.build_time));
        stats.convert_ms = Some(ms(built.convert_time));
        stats.upload_bytes = built.topology.upload_bytes() as u64;
        self.builder.recycle(built.topology);
        self.trees.no_better_at = None;
        Ok(())
    }
}
