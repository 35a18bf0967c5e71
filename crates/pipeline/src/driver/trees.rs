//! Requests trees, hands vertices to the builder, and evaluates and adopts the trees that it makes.

use super::candidate::{Candidate, Evaluation, Request, State, Verdict, file};
use super::retained::Retained;
use super::{Driver, PipelineError};
use crate::builder_thread::{BuildInput, BuildResult, Job};
use crate::frame::{Adopted, TreeMoments, ms};
use crate::schedule::{FramePlan, InFlight, Pace, Update};
use crate::tree_builder::for_all::samples;
use crate::tree_builder::{Built, TreeBuilder, Vertices};
use backend::{FrameReport, Generation, Ticket};
use bvh_build::{BuildError, Cancel};
use geom::{Animation, Point, Pose};
use std::time::Instant;

/// The generation of the tree that the first frame builds.
pub(super) const FIRST: Generation = Generation(1);

/// The tree in use.
pub(super) struct Tree {
    pub(super) generation: Generation,
    /// Count of frames begun when it was asked for.
    pub(super) frame: u64,
    /// What it was built for.
    pub(super) pose: Pose,
    /// The moment that it is best used at.
    pub(super) middle: f64,
    pub(super) cost: f64,
    /// Whether it replaced a newer tree that came to cost more.
    pub(super) returned: bool,
}

impl Driver {
    /// Hands vertices to the builder and takes finished trees. Never waits.
    pub(super) fn poll_builder(&mut self) -> Result<(), PipelineError> {
        self.poll_read_back()?;
        if let Some(result) = self.builder_thread.try_take() {
            self.candidate = file(self.candidate.take(), result);
        }
        self.bring_candidate().map(drop)
    }

    /// Sends a finished tree on its way to the device, piece by piece. Returns whether nothing is on its way.
    fn bring_candidate(&mut self) -> Result<bool, PipelineError> {
        let candidate = self.candidate.as_ref();
        let arrived = candidate.and_then(|c| Some((c.arrived()?, c.request.generation)));
        match arrived {
            Some((built, generation)) => Ok(self.backend.bring(&built.topology, generation)?),
            None => Ok(true),
        }
    }

    /// The pose that a tree asked for now should be built for, at a frame that stands at `pose`.
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

    /// Returns the candidate as the schedule sees it.
    pub(super) fn in_flight(&mut self) -> Result<Option<InFlight>, PipelineError> {
        if self.bring_candidate()? {
            self.review_candidate();
        }
        Ok(self.candidate.as_ref().map(|candidate| InFlight {
            asked_at: candidate.request.frame,
            is_adoptable: candidate.is_decided(),
        }))
    }

    /// Decides what becomes of a tree that has arrived on the device: it is evaluated once its moment is nearer than that of the
    /// current tree. If a newer tree would be there before that, it is dropped.
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

    /// Has a finished tree never be used, because it costs more at a pose or came too early.
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

    /// Records the evaluation of a candidate that is due, at positions that stand.
    pub(super) fn record_evaluation(&mut self) -> Result<(), PipelineError> {
        let builds_ahead = self.builds_ahead();
        let (Some(candidate), Some(pose)) = (&mut self.candidate, self.pose) else {
            return self.record_evaluation_of_retained();
        };
        let State::Due(built) = &candidate.state else {
            return self.record_evaluation_of_retained();
        };
        // The candidate takes its place on the device.
        self.retained = None;
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

    /// Records the evaluation of the replaced tree if it is due.
    fn record_evaluation_of_retained(&mut self) -> Result<(), PipelineError> {
        let Some(retained) = self.retained.as_mut().filter(|retained| retained.is_due()) else {
            return Ok(());
        };
        match self.backend.evaluate_retained()? {
            true => retained.recorded(),
            false => self.retained = None,
        }
        Ok(())
    }

    /// Makes the replaced tree current again if it costs less than the one that replaced it.
    pub(super) fn return_cheaper(&mut self) -> Result<(), PipelineError> {
        let Some(retained) = self.retained.take_if(|retained| retained.is_cheaper()) else {
            return Ok(());
        };
        self.backend.adopt_retained()?;
        self.record.returned = true;
        let mut tree = retained.into_tree();
        tree.returned = true;
        let middle = self.record.frame.time;
        let replaced = self.tree.replace(Tree { middle, ..tree });
        // A scene at rest needs no further tree for its pose.
        let built_for = replaced.as_ref().map(|newer| newer.pose);
        self.has_best_for = built_for.filter(|_| built_for == self.pose);
        self.retained = replaced.map(Retained::new);
        // The newer tree was built in vain.
        let frames = self.predictor.frames_of_use();
        self.patience.rejected(self.frames, frames);
        Ok(())
    }

    /// Compares costs once the frame that evaluated a candidate is done.
    pub(super) fn judge(&mut self, ticket: Ticket, report: &FrameReport) {
        if let Some(cost) = report.sah_cost {
            self.patience.observe(cost);
        }
        if let Some(retained) = &mut self.retained {
            retained.observe(ticket, report);
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
            Verdict::Accept => candidate.advance(State::Accepted),
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

    /// Whether it is known when a tree asked for now would be in use, or of no account.
    pub(super) fn may_ask(&self) -> bool {
        let is_patient = self.predictor.is_at_rest() || self.patience.is_over(self.frames);
        (self.predictor.has_ground() && is_patient) || !self.weighs()
    }

    /// Whether trees are adopted by their cost. In lockstep each is, whatever it costs.
    fn weighs(&self) -> bool {
        self.options.update == Update::Async(Pace::Free)
    }

    fn predicts(&self) -> bool {
        self.knows_key_frames && self.builds_ahead()
    }

    /// Whether trees are for moments to come.
    pub(super) fn builds_ahead(&self) -> bool {
        self.options.predict && !self.options.update.waits_at_once()
    }

    /// Does what the plan says before the frame is traced; a tree asked for is built for `pose`.
    pub(super) fn follow(&mut self, plan: FramePlan, pose: Pose) -> Result<(), PipelineError> {
        if plan.swap {
            self.swap(plan.wait)?;
        }
        if !plan.ask {
            return Ok(());
        }
        self.newest.0 += 1;
        let mut request = self.ask(self.newest, pose);
        if self.options.update.waits_at_once() {
            let built = self.build_now(&mut request, None)?;
            return built.map_or(Ok(()), |built| self.adopt(built, &request));
        }
        self.candidate = Some(Candidate::new(request));
        match self.predicts() {
            true => self.start_build(self.input(Vertices::KeyFrames(pose)), 0),
            false => Ok(()),
        }
    }

    /// Builds the first tree, while the first frame waits.
    pub(super) fn first_tree(&mut self, pose: Pose) -> Result<(), PipelineError> {
        let mut request = self.ask(FIRST, pose);
        let built = if self.options.update == Update::TSah {
            let range = self.options.time_range;
            self.build_waiting(&mut request, 0, |builder, animation| {
                let samples = samples(animation, range)?;
                builder.build_for_all(animation, &samples, pose, &Cancel::new())
            })
        } else {
            // Built ahead, it is built for more than the frame.
            let ahead = self.predicts() && self.weighs();
            let halves = self.predictor.halves_of_first_use().filter(|_| ahead);
            request.middle = halves.map_or(request.middle, |[a, b]| f64::midpoint(a, b));
            self.build_now(&mut request, halves.map(|times| self.poses(times)))?
        };
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

    /// Returns what the candidate is built from and for, as far as key frames say.
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
        // Vertices are the builder's to look into: that may cost their first reader.
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

    /// Swaps to a finished tree, waiting for it only where the plan says so.
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
            // A tree that came too early, or for other positions, says nothing about this pose.
            self.has_best_for = dearer_at.filter(|&pose| pose == candidate.request.pose);
            return Ok(());
        }
        match candidate.take() {
            Some(built) => self.adopt(built, &candidate.request),
            None => Ok(()),
        }
    }

    /// Blocks until the candidate is finished or given up. Only lockstep comes here.
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

    /// Builds from the backend's vertices at the build's pose while the frame waits, or from what lies between `halves`.
    fn build_now(
        &mut self,
        request: &mut Request,
        halves: Option<[Pose; 2]>,
    ) -> Result<BuildResult<Built>, PipelineError> {
        let positions = self.read_now(request.pose)?;
        self.pose = Some(request.pose);
        let read_back = bytes(positions.len());
        let from = (Vertices::ReadBack(positions), halves);
        Ok(
            self.build_waiting(request, read_back, |builder, animation| {
                builder.build(animation, from, &Cancel::new())
            }),
        )
    }

    /// Builds while the frame waits, from so many bytes that were read back.
    fn build_waiting(
        &mut self,
        request: &mut Request,
        read_back: u64,
        build: impl FnOnce(&mut TreeBuilder, &Animation) -> Result<Built, BuildError> + Send,
    ) -> BuildResult<Built> {
        let arrived = Instant::now();
        request.vertices_arrived = Some((arrived, read_back));
        let (animation, light) = (&self.animation, self.light);
        let spare = std::mem::take(&mut self.spare);
        let built = self.builder_pool.with(|builder| {
            builder.order_toward(light);
            builder.reuse(spare);
            build(builder, animation)
        });
        self.record.build_wait_ms += ms(arrived.elapsed());
        built
    }

    fn adopt(&mut self, built: Built, request: &Request) -> Result<(), PipelineError> {
        let taken = Instant::now();
        self.backend.adopt(&built.topology, request.generation)?;
        let (adopted, moments) = (Instant::now(), built.moments);
        let replaced = self.tree.replace(Tree {
            generation: request.generation,
            frame: request.frame,
            pose: request.pose,
            middle: request.middle,
            cost: built.cost,
            returned: false,
        });
        // A tree that returned may return again: only one that stayed ends the pauses between requests.
        if replaced.as_ref().is_none_or(|tree| !tree.returned) {
            self.patience.adopted();
        }
        let may_return = self.weighs() && !self.predicts();
        self.retained = replaced.filter(|_| may_return).map(Retained::new);
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

/// Bytes of so many positions.
pub(super) fn bytes(vertices: usize) -> u64 {
    (vertices * size_of::<Point>()) as u64
}
