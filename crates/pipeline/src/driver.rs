//! The frame loop. Waits for a build only for the first tree, with the policy `rebuild`, and in lockstep.

mod adoption;
mod next_tree;
mod pause;
mod read_back;
mod run;
mod trees;
mod warm_up;

use crate::builder_thread::BuilderThreads;
use crate::error::PipelineError;
use crate::frame::{Frame, FrameRecord, ms};
use crate::host_builder::HostBuilder;
use crate::latency::LatencyPredictor;
use backend::{
    Backend, BackendError, FRAMES_IN_FLIGHT, Generation, Intersector, Policy, Query, Ticket,
};
use geom::{Animation, Point, Pose};
use next_tree::Event;
pub use run::{FrameOutputs, LOOK_AHEAD, OutputSelection};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;
use trees::{CurrentTree, Trees};
pub use warm_up::{WarmUp, Warmed};

/// Options of a [`Driver`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriverOptions {
    /// Intersector of the backend.
    pub intersector: Intersector,
    /// Policy that updates trees as vertices move.
    pub update: Policy,
    /// First and last time to render, in key frames. Predicted times stay within this range.
    pub time_range: [f64; 2],
    /// Build each tree for the middle of the time in which it will be used. Applies to [`Policy::Async`], and to
    /// [`Policy::Lockstep`] with a latency above 0. Trees are then built from key frames. If only the backend has the
    /// positions, `Async` extrapolates them. In all other cases, trees are built from the positions of the frame that
    /// requests them, read back from the backend.
    pub predict: bool,
}

impl DriverOptions {
    /// Returns whether the options allow trees for a future time. `Driver::predicts` also requires key frames, because
    /// without them only `async` builds such trees.
    fn builds_ahead(&self) -> bool {
        self.predict && !self.update.waits_for_tree()
    }
}

/// A submitted frame whose results have not been returned yet.
struct PendingFrame {
    ticket: Ticket,
    record: FrameRecord,
    /// Cost of the tree at the vertices that it was built from: the divisor of
    /// [`FrameTreeStats::sah_ratio`](crate::FrameTreeStats::sah_ratio). `None` if it was built for the frame's pose.
    cost_when_built: Option<f64>,
}

/// The frame that is being recorded.
#[derive(Default)]
struct FrameRecording {
    /// Number of frames begun before it.
    number: u64,
    /// Pose of the backend's positions; `None` if unknown.
    pose: Option<Pose>,
    /// Position of the light, where shadow rays end. Builders order the children of nodes for these rays.
    light: Option<Point>,
    /// Statistics of the frame.
    record: FrameRecord,
    /// Whether the frame's positions are recorded, but a later stage failed or the backend refused the queries.
    is_refused: bool,
}

/// Owns a backend and renders frames with it.
pub struct Driver {
    backend: Box<dyn Backend>,
    animation: Arc<Animation>,
    options: DriverOptions,
    /// Whether the animation contains the key frames that the backend interpolates.
    knows_key_frames: bool,
    predictor: LatencyPredictor,
    builder: HostBuilder,
    trees: Trees,
    recording: FrameRecording,
    pending: VecDeque<PendingFrame>,
}

impl Driver {
    /// Loads `animation` into `backend`. The first frame builds the first tree. Other drivers may share `threads`.
    ///
    /// # Errors
    /// Those of [`Backend::load`]. If the policy builds trees on the device, also that of
    /// [`device_rebuild`](backend::Capabilities::device_rebuild).
    pub fn new(
        mut backend: Box<dyn Backend>,
        animation: Arc<Animation>,
        options: DriverOptions,
        threads: BuilderThreads,
    ) -> Result<Self, PipelineError> {
        backend.load(Arc::clone(&animation), options.intersector)?;
        let capabilities = &backend.device().capabilities;
        if options.update.builds_on_device() {
            capabilities.device_rebuild.clone()?;
        }
        Ok(Self {
            builder: HostBuilder::new(&animation, threads, capabilities.tree_format),
            predictor: LatencyPredictor::new(options.time_range, options.update.lockstep()),
            backend,
            animation,
            options,
            knows_key_frames: true,
            trees: Trees::default(),
            recording: FrameRecording::default(),
            pending: VecDeque::with_capacity(FRAMES_IN_FLIGHT),
        })
    }

    /// Returns the backend, for its description and inspection.
    pub fn backend(&mut self) -> &mut (dyn Backend + 'static) {
        self.backend.as_mut()
    }

    /// Returns whether one frame can trace these queries. See [`backend::Capabilities::can_batch`].
    pub fn can_batch(&self, queries: &[Query<'_>]) -> bool {
        let capabilities = &self.backend.device().capabilities;
        capabilities.can_batch(self.options.intersector, queries)
    }

    /// Starts to compile, on other threads, the kernels that frames with this query need.
    pub fn prepare(&mut self, query: Query<'_>) {
        self.backend.prepare(query, self.has_device_trees());
    }

    /// Declares that from now on only the backend receives positions. Trees are then built from positions that are read
    /// back.
    pub fn forget_key_frames(&mut self) {
        self.knows_key_frames = false;
    }

    /// Removes submitted frames that the device will never run.
    ///
    /// The next frame interpolates positions again. A build that waits for positions is cancelled. Evaluations
    /// are repeated, because the device dropped the boxes of the evaluated tree.
    pub fn abandon(&mut self, dropped: &[Ticket]) {
        self.pending
            .retain(|frame| !dropped.contains(&frame.ticket));
        self.recording.pose = None;
        self.trees.next.advance(Event::ResultsLost);
    }

    /// Returns the backend, which can load another scene. Cancels a build in progress.
    pub fn into_backend(self) -> Box<dyn Backend> {
        self.backend
    }

    /// Returns the generation of the current tree, or 0 before the first frame.
    pub fn generation(&self) -> Generation {
        let current = self.trees.current.as_ref();
        current.map_or(Generation(0), |tree| tree.request.generation)
    }

    /// Returns whether a tree is requested and is neither adopted nor dropped yet.
    pub fn is_building(&self) -> bool {
        !self.trees.next.is_idle()
    }

    /// Submits one frame and returns the ticket of its results. Accepts one query, or several that
    /// [one frame can trace](Self::can_batch). Finish earlier frames first, so that no more than
    /// [`max_in_flight`](Self::max_in_flight) frames are in flight, including this one. A frame that waits for its own
    /// tree or positions takes two submissions, or three if it waits for both.
    ///
    /// # Errors
    /// Those of the backend, and [`PipelineError::FirstTree`] if the first tree cannot be built.
    pub fn begin(&mut self, frame: Frame, queries: &[Query<'_>]) -> Result<Ticket, PipelineError> {
        let begun = self.record_and_submit(frame, queries);
        if begun.is_err() {
            // The last call that the backend completed is unknown.
            self.recording.pose = None;
            self.trees.next.advance(Event::FrameFailed);
        }
        begun
    }

    fn record_and_submit(
        &mut self,
        frame: Frame,
        queries: &[Query<'_>],
    ) -> Result<Ticket, PipelineError> {
        let started = Instant::now();
        self.submit_refused()?;
        self.recording.record = FrameRecord {
            frame,
            ..FrameRecord::default()
        };
        self.recording.light = queries[0].kind.light();
        let pose = self.animation.pose(frame.time);
        self.predictor.frame(frame.time, started);
        self.poll_builder()?;
        self.measure_coordinate_range(pose, queries)?;
        let is_stale = if self.has_device_trees() {
            self.record_device_tree(pose)?
        } else {
            self.update_trees(pose)?;
            self.record_positions(pose)?
        };
        let recorded = self.record_tree_and_trace(is_stale, queries);
        // Backends on the host may run all recorded stages in `trace`. If they cannot read a key frame, they drop the
        // submission, so there is nothing to submit.
        if let Err(e) = &recorded
            && !matches!(e, PipelineError::Backend(BackendError::KeyFrame(_)))
        {
            self.recording.is_refused = true;
            // The refused frame counts, because its positions are still read back. A frame with the same number would
            // request them again.
            self.recording.number += 1;
        }
        recorded?;
        let ticket = self.backend.submit()?;
        self.trees.next.submitted(ticket);
        self.push_pending(ticket, started);
        self.poll_builder_after_frame();
        Ok(ticket)
    }

    /// Records the stages that follow the positions.
    fn record_tree_and_trace(
        &mut self,
        is_stale: bool,
        queries: &[Query<'_>],
    ) -> Result<(), PipelineError> {
        if !self.has_device_trees() {
            self.record_evaluation()?;
        }
        if is_stale {
            self.backend.preprocess()?;
            self.backend.refit()?;
        }
        Ok(self.backend.trace(queries)?)
    }

    /// Stores the statistics of the submitted frame until its results are returned.
    fn push_pending(&mut self, ticket: Ticket, started: Instant) {
        let current = self.trees.current.as_ref();
        let tree = current.expect("a frame is traced with a tree");
        let recording = &mut self.recording;
        let mut record = recording.record.clone();
        record.tree.generation = tree.request.generation;
        record.tree.age_frames = recording.number - tree.request.frame;
        record.wall_ms = ms(started.elapsed());
        self.pending.push_back(PendingFrame {
            ticket,
            cost_when_built: (Some(tree.request.pose) != recording.pose).then_some(tree.cost),
            record,
        });
        recording.number += 1;
    }

    /// Submits the recorded stages of a frame that failed after its positions were recorded. Does nothing if there is
    /// no such frame. [`begin`](Self::begin) calls this first, because [`Backend::adopt`] panics if commands are not
    /// submitted.
    ///
    /// # Errors
    /// Those of the backend. The recorded stages are dropped.
    pub fn submit_refused(&mut self) -> Result<(), PipelineError> {
        if std::mem::take(&mut self.recording.is_refused)
            && let Err(e) = self.backend.submit()
        {
            // Requested positions do not arrive.
            self.trees.next.advance(Event::ResultsLost);
            return Err(e.into());
        }
        Ok(())
    }

    /// Moves the backend's positions to `pose`, and requests a read-back if a build waits for them. Returns whether
    /// `preprocess` and `refit` must follow.
    fn record_positions(&mut self, pose: Pose) -> Result<bool, PipelineError> {
        let moved = self.recording.pose != Some(pose);
        let is_requested = self.wants_positions(moved);
        if moved {
            self.backend.interpolate(pose)?;
            self.recording.pose = Some(pose);
        }
        if is_requested {
            self.backend.request_positions()?;
        }
        Ok(moved || self.recording.record.tree.adopted)
    }

    /// Returns whether the device builds the trees.
    fn has_device_trees(&self) -> bool {
        self.options.update.builds_on_device()
    }

    /// Records positions at `pose` and, if they moved or there is no tree yet, the build of a tree over them. Returns
    /// whether a build was recorded. The caller then calls `preprocess` and `refit`, as after any change. Both do nothing,
    /// because the build includes them.
    fn record_device_tree(&mut self, pose: Pose) -> Result<bool, PipelineError> {
        let moved = self.record_positions(pose)?;
        if self.trees.current.is_some() && !moved {
            return Ok(false);
        }
        self.trees.newest.0 += 1;
        let request = self.request(self.trees.newest, pose);
        self.backend.rebuild(request.generation)?;
        self.recording.record.tree.adopted = true;
        self.trees.current = Some(CurrentTree { request, cost: 0.0 });
        Ok(true)
    }
}

#[cfg(test)]
mod tests;
