//! The driver's dealings with trees: asking, passing vertices on, hearing, swapping.

use super::{Driver, PipelineError};
use crate::builder_thread::{BuildInput, BuildResult, Job};
use crate::frame::{Adopted, TreeMoments, ms};
use crate::schedule::{FramePlan, InFlight, Pace, Update};
use crate::tree_builder::for_all::samples;
use crate::tree_builder::{Built, Made, TreeBuilder, Vertices};
use backend::{Generation, Snapshot};
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
}

/// A tree on its way: which one, for which frame and pose.
pub(super) struct PendingBuild {
    pub(super) generation: Generation,
    pub(super) frame: u64,
    /// When that frame is.
    pub(super) time: f64,
    /// When the next is that moves, if its positions are read back, too; and those of the first, until then.
    pub(super) moved_at: Option<f64>,
    pub(super) observed: Option<Snapshot>,
    pub(super) pose: Pose,
    /// The moment that it is best used at.
    pub(super) middle: f64,
    asked: Instant,
    /// How many frames it took, once it is finished.
    latency: Option<u64>,
    /// Moments early and late in its use.
    pub(super) halves: [f64; 2],
    /// Where it must be cheaper than the tree in use.
    rival_at: Option<Pose>,
    /// When its vertices were seen on the host and how many bytes they took; none before.
    pub(super) arrived: Option<(Instant, u64)>,
}

impl Driver {
    /// Passes vertices on to the builder and takes finished trees. Never waits.
    pub(super) fn poll_builder(&mut self) -> Result<(), PipelineError> {
        self.poll_read_back()?;
        if let Some(result) = self.builder_thread.try_take() {
            self.file(result);
            self.bring_finished()?;
        }
        Ok(())
    }

    /// Whether the finished tree, if there is one, is on the device; sends it on its way.
    fn bring_finished(&mut self) -> Result<bool, PipelineError> {
        match (&self.finished, &self.build) {
            (Some(Made::Tree(built)), Some(pending)) => {
                Ok(self.backend.bring(&built.topology, pending.generation)?)
            }
            _ => Ok(true),
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

    /// The build in flight, for the schedule.
    pub(super) fn in_flight(&mut self) -> Result<Option<InFlight>, PipelineError> {
        let is_adoptable = self.review_finished()?;
        Ok(self.build.as_ref().map(|build| InFlight {
            asked_at: build.frame,
            is_adoptable,
        }))
    }

    /// Tells the predictor how long a finished tree took. Says whether to swap to it: at once, but for trees
    /// that were built for a moment to come, if the last one's is nearer still. One whose moment is too far off is left.
    fn review_finished(&mut self) -> Result<bool, PipelineError> {
        if !self.bring_finished()? {
            return Ok(false);
        }
        let ahead = self.predicts() && self.may_reject();
        let (Some(made), Some(pending)) = (&self.finished, &mut self.build) else {
            return Ok(false);
        };
        if pending.latency.is_none() {
            let frames = self.frames - pending.frame;
            pending.latency = Some(frames);
            if let Made::Tree(built) = made {
                self.predictor.observe_latency(frames, built.strategy);
                self.predictor.next_strategy_is(built.next);
            }
        }
        let last = self.tree.as_ref().map_or(f64::NAN, |tree| tree.middle);
        let should_adopt =
            matches!(made, Made::NoBetter) || self.predictor.should_adopt(last, pending.middle);
        if ahead && !should_adopt {
            if !self.predictor.newer_tree_due_first(last, pending.middle) {
                return Ok(false);
            }
            self.leave_finished();
        }
        Ok(true)
    }

    /// Has a finished tree never be used.
    fn leave_finished(&mut self) {
        if let Some(Made::Tree(built)) = self.finished.replace(Made::NoBetter) {
            self.spare = built.topology.into_spare();
            self.left_last = true;
        }
    }

    /// Whether it is known when a tree asked for now would be in use, or of no account.
    pub(super) fn may_ask(&self) -> bool {
        self.predictor.has_ground() || !self.may_reject()
    }

    /// In lockstep each tree is swapped in, whatever its cost.
    fn may_reject(&self) -> bool {
        self.options.update == Update::Async(Pace::Free) && self.knows_key_frames
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
        let mut pending = self.ask(self.newest, pose);
        if self.options.update.waits_at_once() {
            let built = self.build_now(&mut pending, None)?;
            return built.map_or(Ok(()), |built| self.adopt(built, &pending));
        }
        self.build = Some(pending);
        match self.predicts() {
            true => self.start_build(self.input(Vertices::KeyFrames(pose)), 0),
            false => Ok(()),
        }
    }

    /// Builds the first tree, while the first frame waits.
    pub(super) fn first_tree(&mut self, pose: Pose) -> Result<(), PipelineError> {
        let mut pending = self.ask(FIRST, pose);
        let built = if self.options.update == Update::TSah {
            let range = self.options.time_range;
            self.build_waiting(&mut pending, 0, |builder, animation| {
                let samples = samples(animation, range)?;
                builder.build_for_all(animation, &samples, pose, &Cancel::new())
            })
        } else {
            // Built ahead, it is built for more than the frame.
            let ahead = self.predicts() && self.may_reject();
            let halves = self.predictor.halves_of_first_use().filter(|_| ahead);
            pending.middle = halves.map_or(pending.middle, |[a, b]| f64::midpoint(a, b));
            self.build_now(&mut pending, halves.map(|times| self.poses(times)))?
        };
        let built = built.map_err(PipelineError::FirstTree)?;
        let moments = &built.moments;
        self.predictor.first_took(moments.ended - moments.begun);
        self.adopt(built, &pending)
    }

    fn ask(&mut self, generation: Generation, pose: Pose) -> PendingBuild {
        self.record.asked = Some(generation);
        let may_reject = self.may_reject();
        let middle = self.predictor.middle_of_use();
        PendingBuild {
            generation,
            frame: self.frames,
            time: self.record.frame.time,
            moved_at: None,
            observed: None,
            pose,
            middle,
            asked: Instant::now(),
            latency: None,
            halves: self.predictor.halves_of_use(),
            rival_at: may_reject.then(|| self.animation.pose(middle)),
            arrived: None,
        }
    }

    /// What the build in flight is made from and for, as far as key frames tell.
    pub(super) fn input(&self, vertices: Vertices) -> BuildInput {
        let pending = self.build.as_ref();
        let halves = pending.map(|f| f.halves).filter(|_| self.predicts());
        BuildInput {
            vertices,
            halves: halves.map(|times| self.poses(times)),
            rival_at: pending.and_then(|f| f.rival_at),
            observed: None,
        }
    }

    pub(super) fn start_build(
        &mut self,
        input: BuildInput,
        read_back: u64,
    ) -> Result<(), PipelineError> {
        let Some(pending) = self.build.as_mut() else {
            return Ok(());
        };
        // Vertices are the builder's to look into: that may cost their first reader.
        pending.arrived = Some((Instant::now(), read_back));
        let writer = self.backend.tree_writer(pending.generation)?;
        let job = Job {
            input,
            toward: self.light,
            spare: std::mem::take(&mut self.spare),
            left_last: std::mem::take(&mut self.left_last),
            writer,
        };
        if self.builder_thread.start(job).is_err() {
            self.build = None;
        }
        Ok(())
    }

    /// Puts a finished tree aside for its boundary, or forgets a failed one.
    fn file(&mut self, result: BuildResult<Made>) {
        match result {
            Ok(made) => self.finished = Some(made),
            Err(_) => self.build = None,
        }
    }

    /// Swaps to a finished tree, waiting for it only where the plan says so.
    fn swap(&mut self, wait: bool) -> Result<(), PipelineError> {
        if wait {
            let start = Instant::now();
            self.wait_for_builder()?;
            self.record.build_wait_ms += ms(start.elapsed());
        }
        let (Some(made), Some(pending)) = (self.finished.take(), self.build.take()) else {
            return Ok(());
        };
        match made {
            Made::Tree(built) => self.adopt(built, &pending),
            Made::NoBetter => {
                self.record.rejected = Some(pending.generation);
                // One that came too early, or that was weighed elsewhere, says nothing.
                let is_weighed = !self.left_last && pending.rival_at == Some(pending.pose);
                self.has_best_for = is_weighed.then_some(pending.pose);
                Ok(())
            }
        }
    }

    /// Blocks until the tree in flight is finished or given up. Only lockstep comes here.
    fn wait_for_builder(&mut self) -> Result<(), PipelineError> {
        while self.finished.is_none() && self.build.is_some() {
            self.poll_builder()?;
            let building = self.build.as_ref().is_some_and(|f| f.arrived.is_some());
            if building && self.finished.is_none() {
                let result = self.builder_thread.take();
                self.file(result);
            } else {
                std::thread::yield_now();
            }
        }
        Ok(())
    }

    /// Builds from the backend's vertices at the build's pose while the frame waits, or from what lies between `halves`.
    fn build_now(
        &mut self,
        pending: &mut PendingBuild,
        halves: Option<[Pose; 2]>,
    ) -> Result<BuildResult<Built>, PipelineError> {
        let positions = self.read_now(pending.pose)?;
        self.pose = Some(pending.pose);
        let read_back = bytes(positions.len());
        let from = (Vertices::ReadBack(positions), halves);
        Ok(
            self.build_waiting(pending, read_back, |builder, animation| {
                builder.build(animation, from, &Cancel::new())
            }),
        )
    }

    /// Builds while the frame waits, from so many bytes that were read back.
    fn build_waiting(
        &mut self,
        pending: &mut PendingBuild,
        read_back: u64,
        build: impl FnOnce(&mut TreeBuilder, &Animation) -> Result<Built, BuildError> + Send,
    ) -> BuildResult<Built> {
        let arrived = Instant::now();
        pending.arrived = Some((arrived, read_back));
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

    fn adopt(&mut self, built: Built, pending: &PendingBuild) -> Result<(), PipelineError> {
        let taken = Instant::now();
        self.backend.adopt(&built.topology, pending.generation)?;
        let (adopted, moments) = (Instant::now(), built.moments);
        self.tree = Some(Tree {
            generation: pending.generation,
            frame: pending.frame,
            pose: pending.pose,
            middle: pending.middle,
            cost: built.cost,
        });
        let (arrived, snapshot_bytes) = pending.arrived.expect("a tree is built from vertices");
        self.record.adopted = Some(Adopted {
            latency_frames: pending.latency.unwrap_or(0),
            build_ms: ms(moments.built - moments.begun),
            convert_ms: ms(moments.ended - moments.weighed),
            upload_bytes: built.topology.upload_bytes() as u64,
            snapshot_bytes,
            triangles: built.topology.leaf_count(),
            built_for: pending.pose,
            moments: TreeMoments {
                asked: pending.asked,
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
