//! The frame loop: follows the schedule's plan for each frame and never waits for the builder thread.

mod candidate;
mod patience;
mod read_back;
mod run;
mod trees;
mod warm_up;

use crate::builder_thread::{BuilderPool, BuilderThread, BuilderThreads};
use crate::frame::{Frame, FrameRecord};
use crate::latency::LatencyPredictor;
use crate::schedule::plan;
use backend::{
    Backend, BackendError, FRAMES_IN_FLIGHT, Generation, Intersector, Opener, Palette, Policy,
    Query, Ticket,
};
use bvh_layout::Spare;
use candidate::Candidate;
use geom::{Animation, Point, Pose};
use patience::Patience;
pub use run::{Answers, LOOK_AHEAD, Wanted};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;
use trees::{FIRST, Tree};
pub use warm_up::{WarmUp, Warmed, warm_up};

/// Reason why rendering stopped.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The backend failed.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// The first tree could not be built.
    #[error("the first tree: {0}")]
    FirstTree(String),
    /// The builder's threads could not be started.
    #[error("no builder threads: {0}")]
    Threads(String),
}

/// Options of a [`Driver`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriverOptions {
    /// Intersector of the backend.
    pub intersector: Intersector,
    /// Policy that updates trees as vertices move.
    pub update: Policy,
    /// First and last time to render, in key frames. Predicted times stay within this range.
    pub time_range: [f64; 2],
    /// With [`Policy::Async`]: build each tree from key frames, for the middle of the time in which it will be used.
    /// Otherwise trees are built from the positions of the frame that requests them, read back from the backend.
    pub predict: bool,
}

/// A submitted frame whose results have not been returned yet.
struct Pending {
    ticket: Ticket,
    record: FrameRecord,
    /// Divisor of the refitted cost in [`FrameRecord::sah_ratio`]; `None` if the tree was built for the frame's pose.
    cost_before: Option<f64>,
}

/// Owns a backend and renders frames with it.
pub struct Driver {
    backend: Box<dyn Backend>,
    animation: Arc<Animation>,
    options: DriverOptions,
    predictor: LatencyPredictor,
    builder_pool: Arc<BuilderPool>,
    builder_thread: BuilderThread,
    /// Whether the backend shades frames.
    shades: bool,
    /// Whether the animation contains the key frames that the backend interpolates.
    knows_key_frames: bool,
    /// Current tree; `None` before the first frame.
    tree: Option<Tree>,
    /// Tree that was requested and is neither adopted nor rejected yet.
    candidate: Option<Candidate>,
    /// Generation of the last requested tree. Generations only increase.
    newest: Generation,
    /// Pause between requests after trees were rejected.
    patience: Patience,
    /// Memory of the last adopted topology, for reuse by the next build.
    spare: Spare,
    /// Pose for which the last build made no better tree than the current one.
    has_best_for: Option<Pose>,
    /// Whether the builder's last tree was dropped unused. The next job reports this to the builder.
    left_last: bool,
    /// Pose of the backend's positions; `None` if unknown.
    pose: Option<Pose>,
    /// Target of the current frame's shadow rays. Builders order the children of nodes for these rays.
    light: Option<Point>,
    /// Statistics of the current frame.
    record: FrameRecord,
    pending: VecDeque<Pending>,
    /// Whether a frame's positions and boxes are recorded, but the backend refused its queries.
    has_refused: bool,
    frames: u64,
}

impl Driver {
    /// Loads `animation` into `backend`. The first frame builds the first tree. Other drivers may share `threads`.
    ///
    /// # Errors
    /// The backend does not support the scene.
    pub fn new(
        mut backend: Box<dyn Backend>,
        animation: Arc<Animation>,
        options: DriverOptions,
        threads: BuilderThreads,
    ) -> Result<Self, PipelineError> {
        backend.load(Arc::clone(&animation), options.intersector)?;
        if options.update.builds_on_device() {
            backend.check_rebuild()?;
        }
        let builder_pool = Arc::new(BuilderPool::new(threads, backend.tree_format()));
        let builder_thread = {
            let (builder_pool, animation) = (Arc::clone(&builder_pool), Arc::clone(&animation));
            BuilderThread::new(move |job, cancel| {
                builder_pool.with(|builder| builder.carry_out(&animation, job, cancel))
            })
        };
        let agreed = options.update.lockstep();
        Ok(Self {
            backend,
            animation,
            options,
            predictor: LatencyPredictor::new(options.time_range, agreed),
            builder_pool,
            builder_thread,
            shades: false,
            knows_key_frames: true,
            tree: None,
            candidate: None,
            patience: Patience::default(),
            newest: FIRST,
            spare: Spare::default(),
            has_best_for: None,
            left_last: false,
            pose: None,
            light: None,
            record: FrameRecord::begin(Frame::default(), Instant::now()),
            pending: VecDeque::with_capacity(FRAMES_IN_FLIGHT),
            has_refused: false,
            frames: 0,
        })
    }

    /// Returns the backend, for its description and inspection.
    pub fn backend(&mut self) -> &mut (dyn Backend + 'static) {
        self.backend.as_mut()
    }

    /// Returns a function that creates another backend on the same device. See [`Backend::another`].
    pub fn another_backend(&self) -> Option<Opener> {
        self.backend.another()
    }

    /// Starts to compile, on other threads, the kernels that frames with this query need.
    pub fn prepare(&mut self, query: Query<'_>) {
        self.backend.prepare(query, self.has_device_trees());
    }

    /// Enables shading of all further frames. Returns `false` if the backend does not shade.
    ///
    /// # Errors
    /// Those of [`Backend::load_palette`].
    pub fn shade(&mut self, palette: &Palette) -> Result<bool, PipelineError> {
        self.shades = self.backend.load_palette(palette)?;
        Ok(self.shades)
    }

    /// Switches to positions that only the backend receives. Trees are then built from positions read back from it.
    pub fn forget_key_frames(&mut self) {
        self.knows_key_frames = false;
    }

    /// Drops the frames of these tickets, which were abandoned before they ran.
    ///
    /// The next frame uploads positions again. A build that waits for positions is cancelled. A finished tree is
    /// evaluated again, because the device dropped its boxes.
    pub fn give_up(&mut self, dropped: &[Ticket]) {
        self.pending
            .retain(|frame| !dropped.contains(&frame.ticket));
        self.pose = None;
        self.candidate.take_if(|candidate| {
            candidate.is_building() && candidate.request.vertices_arrived.is_none()
        });
        if let Some(candidate) = &mut self.candidate {
            candidate.advance(candidate::State::Arrived);
        }
    }

    /// Returns the backend, which can load another scene. Cancels a build in progress.
    pub fn into_backend(self) -> Box<dyn Backend> {
        self.backend
    }

    /// Returns the generation of the current tree, or 0 before the first frame.
    pub fn generation(&self) -> Generation {
        self.tree.as_ref().map_or(Generation(0), |t| t.generation)
    }

    /// Returns whether a tree is requested and is neither adopted nor rejected yet.
    pub fn is_building(&self) -> bool {
        self.candidate.is_some()
    }

    /// Submits one frame and returns the ticket of its results. Accepts one query, or several that the backend
    /// [traces together](Backend::traces_together). If each frame builds its own tree (`rebuild`, lockstep 0), finish
    /// the previous frame first: such a frame takes two submissions.
    ///
    /// # Errors
    /// Those of the backend, and [`PipelineError::FirstTree`] if the first tree cannot be built.
    pub fn begin(&mut self, frame: Frame, queries: &[Query<'_>]) -> Result<Ticket, PipelineError> {
        let begun = self.record_and_submit(frame, queries);
        if begun.is_err() {
            // The last call that the backend completed is unknown.
            self.pose = None;
            if let Some(candidate) = &mut self.candidate {
                candidate.abandoned();
            }
        }
        begun
    }

    fn record_and_submit(
        &mut self,
        frame: Frame,
        queries: &[Query<'_>],
    ) -> Result<Ticket, PipelineError> {
        let begun = Instant::now();
        self.submit_refused()?;
        self.record = FrameRecord::begin(frame, begun);
        let pose = self.animation.pose(frame.time);
        self.light = queries[0].kind.light();
        self.predictor.frame(frame.time, begun);
        self.poll_builder()?;
        self.look(pose, queries)?;
        let stale = if self.has_device_trees() {
            self.record_device_tree(pose)?
        } else {
            self.bring_tree(pose)?;
            let is_stale = self.record_geometry(pose)?;
            self.record_evaluation()?;
            is_stale
        };
        if stale {
            self.backend.preprocess()?;
            self.backend.refit()?;
        }
        let recorded = self.record_traces(queries);
        // If a key frame cannot be read, nothing of the frame is recorded.
        if let Err(PipelineError::Backend(e)) = &recorded
            && !matches!(e, BackendError::KeyFrame(_))
        {
            self.has_refused = true;
            // Its submission delivers the positions that it requested.
            self.frames += 1;
        }
        recorded?;
        self.record.traced.handed_in = Instant::now();
        let ticket = self.backend.submit()?;
        if let Some(candidate) = &mut self.candidate {
            candidate.submitted(ticket);
        }
        self.poll_builder()?;
        let tree = self.tree.as_ref().expect("a frame is traced with a tree");
        self.record.tree_generation = tree.generation;
        self.record.tree_age_frames = self.frames - tree.frame;
        self.record.moments.submitted = Instant::now();
        self.pending.push_back(Pending {
            ticket,
            cost_before: (Some(tree.pose) != self.pose).then_some(tree.cost),
            record: std::mem::replace(&mut self.record, FrameRecord::begin(frame, begun)),
        });
        self.frames += 1;
        Ok(ticket)
    }

    /// Submits the frame whose queries were refused. Otherwise the next frame would add its commands to the same
    /// recording, and no tree could be adopted.
    fn submit_refused(&mut self) -> Result<(), PipelineError> {
        if std::mem::take(&mut self.has_refused) {
            let ticket = self.backend.submit()?;
            self.backend.release(ticket);
        }
        Ok(())
    }

    /// Records the traces of a frame, after its positions and boxes.
    fn record_traces(&mut self, queries: &[Query<'_>]) -> Result<(), PipelineError> {
        let &[query] = queries else {
            return Ok(self.backend.trace_together(queries)?);
        };
        self.backend.trace(query)?;
        match self.shades {
            true => Ok(self.backend.shade(query)?),
            false => Ok(()),
        }
    }

    /// Provides a tree for the frame: the current one, or another if the schedule swaps trees.
    fn bring_tree(&mut self, pose: Pose) -> Result<(), PipelineError> {
        let Some(tree) = &self.tree else {
            return self.first_tree(pose);
        };
        let newest = self
            .candidate
            .as_ref()
            .map_or(tree.pose, |c| c.request.pose);
        let in_flight = self.in_flight()?;
        let wanted = self.wanted(pose);
        let is_best = newest == wanted || self.has_best_for == Some(wanted);
        let outdated = !is_best && self.may_ask();
        let plan = plan(self.options.update, self.frames, in_flight, outdated);
        self.follow(plan, wanted)
    }

    /// Brings the backend's positions to `pose`. Returns whether `preprocess` and `refit` must follow.
    fn record_geometry(&mut self, pose: Pose) -> Result<bool, PipelineError> {
        let moved = self.pose != Some(pose);
        let asked = self.wants_positions(moved);
        if moved {
            self.backend.interpolate(pose)?;
            self.pose = Some(pose);
        }
        if asked {
            self.backend.request_positions()?;
        }
        Ok(moved || self.record.adopted.is_some())
    }

    /// Returns whether the device builds the trees.
    fn has_device_trees(&self) -> bool {
        self.options.update.builds_on_device()
    }

    /// Records positions at `pose` and, if they moved, a tree over them. Returns whether a refit must follow.
    fn record_device_tree(&mut self, pose: Pose) -> Result<bool, PipelineError> {
        let moved = self.record_geometry(pose)?;
        let generation = match &self.tree {
            None => FIRST,
            Some(tree) if moved => Generation(tree.generation.0 + 1),
            Some(_) => return Ok(moved),
        };
        self.backend.rebuild(generation)?;
        self.record.made = true;
        self.tree = Some(Tree {
            generation,
            frame: self.frames,
            pose,
            middle: f64::NAN,
            cost: 0.0,
        });
        Ok(true)
    }
}

#[cfg(test)]
mod tests;
