//! Requests trees, passes vertices to the builder thread, and evaluates and adopts the trees that it builds.

use super::candidate::{Candidate, Evaluation, Request, State, Verdict, file};
use super::{Driver, PipelineError};
use crate::builder_thread::{BuildInput, BuildResult, Job};
use crate::frame::{Adopted, TreeMoments, ms};
use crate::schedule::{FramePlan, InFlight};
use crate::tree_builder::{Built, Vertices};
use backend::{FrameReport, Generation, Ticket};
use bvh_build::Cancel;
use geom::{Point, Pose};
use std::time::Instant;

/// Generation of the first frame's tree.
pub(super) const FIRST: Generation = Generation(1);

/// The current tree.
pub(super) struct Tree {
    pub(super) generation: Generation,
    /// Number of frames begun before the one that requested it.
    pub(super) frame: u64,
    /// Pose that it was built for.
    pub(super) pose: Pose,
    /// Middle of its expected time of use, in key frames.
    pub(super) middle: f64,
    pub(super) cost: f64,
}

impl Driver {
    /// Passes vertices to the builder and takes finished trees. Never blocks.
    pub(super) fn poll_builder(&mut self) -> Result<(), PipelineError> {
        self.poll_read_back()?;
        if let Some(result) = self.builder_thread.try_take() {
            self.candidate = file(self.candidate.take(), result);
        }
        self.bring_candidate().map(drop)
    }

    /// Uploads a finished tree while frames are rendered. Returns `false` while the upload is unfinished.
    fn bring_candidate(&mut self) -> Result<bool, PipelineError> {
        let candidate = self.candidate.as_ref();
        let arrived = candidate.and_then(|c| Some((c.arrived()?, c.request.generation)));
        match arrived {
            Some((built, generation)) => Ok(self.backend.bring(&built.topology, generation)?),
            None => Ok(true),
        }
    }

    /// Returns the pose that a tree should be built for if the frame at `pose` requests it.
    pub(super) fn wanted(&self, pose: Pose) -> Pose {
        if self.predicts() {
            self.animation.pose(self.predictor.middle_of_use())
        } else {
            pose
        }
    }

    fn poses(&self, times: [f64; 2]) -> [Pose; 2] {
        times.map(|time| self.animation.pose(time))
    }

    /// Returns the state of the candidate, for the schedule.
    pub(super) fn in_flight(&mut self) -> Result<Option<InFlight>, PipelineError> {
        if self.bring_candidate()? {
            self.review_candidate();
        }
        Ok(self.candidate.as_ref().map(|candidate| InFlight {
            asked_at: candidate.request.frame,
            is_adoptable: candidate.is_decided(),
        }))
    }

    /// Decides about a candidate that has arrived on the device. It is evaluated once the time is nearer to the middle
    /// of its use than to that of the current tree. It is dropped if a newer tree would arrive before that.
    fn review_candidate(&mut self) {
        let (builds_ahead, weighs) = (self.builds_ahead(), self.weighs());
        let (frames, last) = (self.frames, self.tree.as_ref().map(|tree| tree.middle));
        let Some(candidate) = &mut self.candidate else {
            return;
        };
        let Some((strategy, next)) = candidate
            .arrived()
            .map(|built| (built.strategy, built.next))
        else {
            return;
        };
        let (predictor, request) = (&mut self.predictor, &mut candidate.request);
        if request.latency.is_none() {
            let latency = frames - request.frame;
            request.latency = Some(latency);
            predictor.observe_latency(latency, strategy);
            predictor.next_strategy_is(next);
        }
        let (last, middle) = (last.unwrap_or(f64::NAN), request.middle);
        if !weighs {
            candidate.advance(State::Accepted);
        } else if builds_ahead && !predictor.should_adopt(last, middle) {
            if predictor.newer_tree_due_first(last, middle) {
                self.drop_candidate(None);
            }
        } else if predictor.is_nearer(middle, candidate.dearer_at) {
            candidate.advance(State::Due);
        }
    }

    /// Rejects a finished tree, because it costs more at a pose or was built for a time too far ahead.
    fn drop_candidate(&mut self, dearer_at: Option<Pose>) {
        let Some(candidate) = &mut self.candidate else {
            return;
        };
        if let Some(built) = candidate.take() {
            self.spare = built.topology.into_spare();
            self.left_last = true;
        }
        candidate.state = State::Rejected(dearer_at);
    }

    /// Records the evaluation of a candidate that is due, at the positions recorded for this frame.
    pub(super) fn record_evaluation(&mut self) -> Result<(), PipelineError> {
        let builds_ahead = self.builds_ahead();
        let (Some(candidate), Some(pose)) = (&mut self.candidate, self.pose) else {
            return Ok(());
        };
        let State::Due(built) = &candidate.state else {
            return Ok(());
        };
        let (tree, generation) = (&built.topology, candidate.request.generation);
        let approach = self.predictor.approach(candidate.request.middle);
        let evaluation = Evaluation {
            ticket: None,
            frame: self.frames,
            pose,
            approach: approach.filter(|_| builds_ahead),
        };
        match self.backend.evaluate(tree, generation)? {
            true => candidate.advance(|built| State::Evaluating(built, evaluation)),
            false => candidate.advance(State::Accepted),
        }
        Ok(())
    }

    /// Processes the costs in a finished frame's report, for the current and the candidate tree.
    pub(super) fn judge(&mut self, ticket: Ticket, report: &FrameReport) {
        if let Some(cost) = report.sah_cost {
            self.patience.observe(cost);
        }
        let Some(candidate) = &mut self.candidate else {
            return;
        };
        let Some(evaluation) = candidate.evaluated_by(ticket) else {
            return;
        };
        self.predictor
            .observe_evaluation(self.frames - evaluation.frame);
        match Verdict::of(report, evaluation.approach.is_some()) {
            Verdict::Accept => {
                let costs = report.candidate_cost.zip(report.sah_cost);
                candidate.share = costs.map(|(candidate, current)| candidate / current);
                candidate.advance(State::Accepted);
            }
            Verdict::Wait => {
                candidate.dearer_at = evaluation.approach;
                candidate.advance(State::Arrived);
            }
            Verdict::Reject => {
                let frames = self.frames - candidate.request.frame;
                self.patience.rejected(self.frames, frames);
                self.drop_candidate(Some(evaluation.pose));
            }
        }
    }

    /// Returns whether trees may be requested. If trees are adopted by cost, this requires a latency estimate. A pause
    /// after rejections then prevents requests, unless the scene is at rest.
    pub(super) fn may_ask(&self) -> bool {
        let is_patient = self.predictor.is_at_rest() || self.patience.is_over(self.frames);
        (self.predictor.has_ground() && is_patient) || !self.weighs()
    }

    /// Returns whether trees are adopted only if they cost less than the current tree. Lockstep adopts every tree.
    fn weighs(&self) -> bool {
        self.options.update.adopts_by_cost()
    }

    fn predicts(&self) -> bool {
        self.knows_key_frames && self.builds_ahead()
    }

    /// Returns whether trees are built for a future time.
    pub(super) fn builds_ahead(&self) -> bool {
        self.options.predict && !self.options.update.waits_for_tree()
    }

    /// Carries out the plan before the frame is traced. A requested tree is built for `pose`.
    pub(super) fn follow(&mut self, plan: FramePlan, pose: Pose) -> Result<(), PipelineError> {
        if plan.swap {
            self.swap(plan.wait)?;
        }
        if !plan.ask {
            return Ok(());
        }
        self.newest.0 += 1;
        let mut request = self.ask(self.newest, pose);
        if self.options.update.waits_for_tree() {
            let built = self.build_now(&mut request, None)?;
            return built.map_or(Ok(()), |built| self.adopt(built, &request));
        }
        self.candidate = Some(Candidate::new(request));
        match self.predicts() {
            true => self.start_build(self.input(Vertices::KeyFrames(pose)), 0),
            false => Ok(()),
        }
    }

    /// Builds the first tree while the first frame waits.
    pub(super) fn first_tree(&mut self, pose: Pose) -> Result<(), PipelineError> {
        let mut request = self.ask(FIRST, pose);
        // With a prediction, the first tree is built for a time interval instead of one frame.
        let ahead = self.predicts() && self.weighs();
        let halves = self.predictor.halves_of_first_use().filter(|_| ahead);
        request.middle = halves.map_or(request.middle, |[a, b]| f64::midpoint(a, b));
        let built = self.build_now(&mut request, halves.map(|times| self.poses(times)))?;
        let built = built.map_err(PipelineError::FirstTree)?;
        let moments = &built.moments;
        self.predictor.first_took(moments.ended - moments.begun);
        self.adopt(built, &request)
    }

    fn ask(&mut self, generation: Generation, pose: Pose) -> Request {
        self.record.asked = Some(generation);
        Request {
            generation,
            frame: self.frames,
            time: self.record.frame.time,
            moved_at: None,
            observed: None,
            pose,
            middle: self.predictor.middle_of_use(),
            halves: self.predictor.halves_of_use(),
            requested: Instant::now(),
            latency: None,
            vertices_arrived: None,
        }
    }

    /// Returns the builder's input for the candidate, with the halves of its use if the key frames are known.
    pub(super) fn input(&self, vertices: Vertices) -> BuildInput {
        let halves = self.candidate.as_ref().map(|c| c.request.halves);
        let halves = halves.filter(|_| self.predicts());
        BuildInput {
            vertices,
            halves: halves.map(|times| self.poses(times)),
            observed: None,
        }
    }

    pub(super) fn start_build(
        &mut self,
        input: BuildInput,
        read_back: u64,
    ) -> Result<(), PipelineError> {
        let Some(candidate) = self.candidate.as_mut() else {
            return Ok(());
        };
        let request = &mut candidate.request;
        // Only the builder thread reads the vertices, because the first read of a snapshot may be slow.
        request.vertices_arrived = Some((Instant::now(), read_back));
        let writer = self.backend.tree_writer(request.generation)?;
        let job = Job {
            input,
            weighs: self.weighs(),
            toward: self.light,
            spare: std::mem::take(&mut self.spare),
            left_last: std::mem::take(&mut self.left_last),
            writer,
        };
        if self.builder_thread.start(job).is_err() {
            self.candidate = None;
        }
        Ok(())
    }

    /// Swaps to the finished candidate. Blocks until it is built only if `wait` is set.
    fn swap(&mut self, wait: bool) -> Result<(), PipelineError> {
        if wait {
            let start = Instant::now();
            self.wait_for_builder()?;
            self.record.build_wait_ms += ms(start.elapsed());
        }
        let Some(mut candidate) = self.candidate.take() else {
            return Ok(());
        };
        let generation = candidate.request.generation;
        if let State::Rejected(dearer_at) = candidate.state {
            self.record.rejected = Some(generation);
            // A tree that was dropped early, or evaluated at another pose, gives no information about this pose.
            self.has_best_for = dearer_at.filter(|&pose| pose == candidate.request.pose);
            return Ok(());
        }
        let Some(built) = candidate.take() else {
            return Ok(());
        };
        self.adopt(built, &candidate.request)?;
        // A tree from known key frames is built for the time of its use, so small gains add up.
        let share = candidate.share.filter(|_| !self.predicts());
        let frames = self.frames - candidate.request.frame;
        self.patience
            .adopted(self.frames, frames, share.unwrap_or(0.0));
        Ok(())
    }

    /// Blocks until the candidate is built or its build fails. Only lockstep calls this.
    fn wait_for_builder(&mut self) -> Result<(), PipelineError> {
        while self.candidate.as_ref().is_some_and(Candidate::is_building) {
            self.poll_builder()?;
            let building = self.candidate.as_ref().filter(|c| c.is_building());
            match building.map(|c| c.request.vertices_arrived.is_some()) {
                Some(true) => {
                    let result = self.builder_thread.take();
                    self.candidate = file(self.candidate.take(), result);
                }
                _ => std::thread::yield_now(),
            }
        }
        Ok(())
    }

    /// Builds a tree while the frame waits, from the backend's positions at the request's pose. With `halves`, the tree
    /// is built over boxes that contain each triangle at both poses.
    fn build_now(
        &mut self,
        request: &mut Request,
        halves: Option<[Pose; 2]>,
    ) -> Result<BuildResult<Built>, PipelineError> {
        let positions = self.read_now(request.pose)?;
        self.pose = Some(request.pose);
        let arrived = Instant::now();
        request.vertices_arrived = Some((arrived, bytes(positions.len())));
        let from = (Vertices::ReadBack(positions), halves);
        let (animation, light) = (&self.animation, self.light);
        let spare = std::mem::take(&mut self.spare);
        let built = self.builder_pool.with(|builder| {
            builder.order_toward(light);
            builder.reuse(spare);
            builder.build(animation, from, &Cancel::new())
        });
        self.record.build_wait_ms += ms(arrived.elapsed());
        Ok(built)
    }

    fn adopt(&mut self, built: Built, request: &Request) -> Result<(), PipelineError> {
        let taken = Instant::now();
        self.backend.adopt(&built.topology, request.generation)?;
        let (adopted, moments) = (Instant::now(), built.moments);
        self.tree = Some(Tree {
            generation: request.generation,
            frame: request.frame,
            pose: request.pose,
            middle: request.middle,
            cost: built.cost,
        });
        let (arrived, snapshot_bytes) = request
            .vertices_arrived
            .expect("a tree is built from vertices");
        self.record.adopted = Some(Adopted {
            latency_frames: request.latency.unwrap_or(0),
            build_ms: ms(moments.built - moments.begun),
            convert_ms: ms(moments.ended - moments.weighed),
            upload_bytes: built.topology.upload_bytes() as u64,
            snapshot_bytes,
            triangles: built.topology.leaf_count(),
            built_for: request.pose,
            moments: TreeMoments {
                asked: request.requested,
                arrived,
                build: moments,
                taken,
                adopted,
            },
        });
        self.spare = built.topology.into_spare();
        self.has_best_for = None;
        Ok(())
    }
}

/// Returns the size of `vertices` positions in bytes.
pub(super) fn bytes(vertices: usize) -> u64 {
    (vertices * size_of::<Point>()) as u64
}
