//! The frame loop: carries out what the schedule says, and never waits for the builder.

mod candidate;
mod patience;
mod read_back;
mod retained;
mod run;
mod trees;
mod warm_up;

use crate::builder_thread::{BuilderPool, BuilderThread, BuilderThreads};
use crate::frame::{Frame, FrameRecord};
use crate::latency::LatencyPredictor;
use crate::schedule::{Pace, Update};
use crate::tree_builder::Forms;
use backend::{
    Backend, BackendError, FRAMES_IN_FLIGHT, Generation, Method, Opener, Palette, Query, Ticket,
};
use bvh_layout::Spare;
use candidate::Candidate;
use geom::{Animation, Point, Pose};
use patience::Patience;
use retained::Retained;
pub use run::{Answers, LOOK_AHEAD, Wanted};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;
use trees::{FIRST, Tree};
pub use warm_up::{Warmed, warm_up};

/// Why rendering stopped.
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

/// What a driver is to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriverOptions {
    /// How the backend traces.
    pub method: Method,
    /// How trees follow the motion.
    pub update: Update,
    /// First and last time that will be rendered, in key frames: what
    /// [`Update::TSah`] builds its tree for, and what no prediction goes beyond.
    pub time_range: [f64; 2],
    /// With [`Update::Async`]: build each tree for the middle of the time it is going to be used, from key frames,
    /// instead of for the frame that asks, from the backend's vertices.
    pub predict: bool,
}

/// A frame submitted and not finished.
struct Pending {
    ticket: Ticket,
    record: FrameRecord,
    /// What the refitted cost is to be divided by; `None` if the tree is fresh.
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
    /// Whether the backend shades.
    shades: bool,
    /// Whether the host's key frames are the backend's.
    knows_key_frames: bool,
    /// The tree in use; none before the first frame.
    tree: Option<Tree>,
    /// The tree to come; at most one.
    candidate: Option<Candidate>,
    /// The tree before the current one, while it is on the device and the motion is unknown.
    retained: Option<Retained>,
    /// The last tree that was asked for; generations only rise.
    newest: Generation,
    /// Whether trees may be requested, after others were rejected.
    patience: Patience,
    /// The last adopted record's memory, for the next one.
    spare: Spare,
    /// The pose for which the last build made no better tree than the current one.
    has_best_for: Option<Pose>,
    /// Whether the builder's last tree was never used, which it does not know yet.
    left_last: bool,
    /// The pose of the backend's positions.
    pose: Option<Pose>,
    /// Where shadow rays of the frame at hand go; trees are made to face it.
    light: Option<Point>,
    /// Of the frame at hand.
    record: FrameRecord,
    pending: VecDeque<Pending>,
    /// Whether positions and boxes are recorded of a frame whose queries the backend refused.
    has_refused: bool,
    frames: u64,
}

impl Driver {
    /// Loads `animation` into `backend`. The first frame builds the first tree. Others may build in these threads, too.
    ///
    /// # Errors
    /// The backend refuses the scene or the method.
    pub fn new(
        mut backend: Box<dyn Backend>,
        animation: Arc<Animation>,
        options: DriverOptions,
        threads: BuilderThreads,
    ) -> Result<Self, PipelineError> {
        admit(backend.as_ref(), options.update)?;
        backend.load(Arc::clone(&animation), options.method)?;
        if options.update == Update::DeviceRebuild {
            backend.check_rebuild()?;
        }
        let forms = Forms {
            treelets: backend.wants_treelets(),
            blocks: backend.wants_blocks(),
        };
        let builder_pool = Arc::new(BuilderPool::new(threads, forms));
        let builder_thread = {
            let (builder_pool, animation) = (Arc::clone(&builder_pool), Arc::clone(&animation));
            BuilderThread::new(move |job, cancel| {
                builder_pool.with(|builder| builder.carry_out(&animation, job, cancel))
            })
        };
        let agreed = match options.update {
            Update::Async(Pace::Lockstep(k)) => Some(k),
            _ => None,
        };
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
            retained: None,
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

    /// The backend's description and views.
    pub fn backend(&mut self) -> &mut (dyn Backend + 'static) {
        self.backend.as_mut()
    }

    /// What makes a further backend on its device: see [`Backend::another`].
    pub fn another_backend(&self) -> Option<Opener> {
        self.backend.another()
    }

    /// Has the backend make ready, beside other work, what frames with this query will take.
    pub fn prepare(&mut self, query: Query<'_>) {
        let makes_trees = self.makes_trees();
        self.backend.prepare(query, makes_trees);
    }

    /// Has the backend shade each frame from now on, if it can; says whether it does.
    ///
    /// # Errors
    /// The backend's.
    pub fn shade(&mut self, palette: &Palette) -> Result<bool, PipelineError> {
        self.shades = self.backend.load_palette(palette)?;
        Ok(self.shades)
    }

    /// From now on positions come to the backend alone, and trees are built from those that it gives back.
    pub fn forget_key_frames(&mut self) {
        self.knows_key_frames = false;
    }

    /// Forgets frames of these tickets, which were given up before they ran.
    ///
    /// The next frame uploads positions again. A build that waits for positions is cancelled. A finished tree is evaluated
    /// again, because the device dropped its boxes.
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
        self.retained = None;
    }

    /// Gives the backend back, to be loaded anew. A build under way is cancelled.
    pub fn into_backend(self) -> Box<dyn Backend> {
        self.backend
    }

    /// Trees so far that frames were traced with.
    pub fn generation(&self) -> Generation {
        self.tree.as_ref().map_or(Generation(0), |t| t.generation)
    }

    /// Whether a tree is being built, or waits to be taken up at a frame's begin.
    pub fn is_building(&self) -> bool {
        self.candidate.is_some()
    }

    /// Submits one frame, whose results its ticket stands for: of one query, or of several that the backend
    /// [traces together](Backend::traces_together). With trees built at once (`rebuild`, lockstep 0) the frame before
    /// must be finished: each takes two submissions.
    ///
    /// # Errors
    /// The backend's.
    pub fn begin(&mut self, frame: Frame, queries: &[Query<'_>]) -> Result<Ticket, PipelineError> {
        let begun = self.record_and_submit(frame, queries);
        if begun.is_err() {
            // Nobody knows how far the backend came.
            self.pose = None;
            if let Some(candidate) = &mut self.candidate {
                candidate.abandoned();
            }
            if let Some(retained) = &mut self.retained {
                retained.abandoned();
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
        let stale = if self.makes_trees() {
            self.record_own_tree(pose)?
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
        // Where a key frame cannot be read, nothing of the frame is recorded.
        if let Err(PipelineError::Backend(e)) = &recorded
            && !matches!(e, BackendError::KeyFrame(_))
        {
            self.has_refused = true;
            // Positions that it requested come with its submission.
            self.frames += 1;
        }
        recorded?;
        self.record.traced.handed_in = Instant::now();
        let ticket = self.backend.submit()?;
        if let Some(candidate) = &mut self.candidate {
            candidate.submitted(ticket);
        }
        if let Some(retained) = &mut self.retained {
            retained.submitted(ticket);
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

    /// Submits the frame whose queries were refused. Otherwise the next frame would add its commands to the same recording,
    /// and no tree could be adopted.
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

    /// Has a tree for the frame: the one in use, or what the schedule says.
    fn bring_tree(&mut self, pose: Pose) -> Result<(), PipelineError> {
        let Some(tree) = &self.tree else {
            return self.first_tree(pose);
        };
        let tree_pose = tree.pose;
        self.return_cheaper()?;
        let newest = self
            .candidate
            .as_ref()
            .map_or(tree_pose, |c| c.request.pose);
        let in_flight = self.in_flight()?;
        let wanted = self.wanted(pose);
        let is_best = newest == wanted || self.has_best_for == Some(wanted);
        let outdated = !is_best && self.may_ask();
        let plan = self.options.update.plan(self.frames, in_flight, outdated);
        self.follow(plan, wanted)
    }

    /// Brings positions to `pose`; says whether records and boxes must follow.
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
        Ok(moved || self.record.adopted.is_some() || self.record.returned)
    }

    /// Whether the backend makes the trees.
    fn makes_trees(&self) -> bool {
        let asked = self.options.update == Update::DeviceRebuild;
        asked || self.backend.makes_own_trees()
    }

    /// Records positions at `pose` and, in the first frame and wherever all are to be rebuilt, a
    /// tree of them; says whether a refit must follow.
    fn record_own_tree(&mut self, pose: Pose) -> Result<bool, PipelineError> {
        let moved = self.record_geometry(pose)?;
        let anew = matches!(self.options.update, Update::Rebuild | Update::DeviceRebuild);
        let generation = match &self.tree {
            None => FIRST,
            Some(tree) if moved && anew => Generation(tree.generation.0 + 1),
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
            returned: false,
        });
        Ok(true)
    }
}

/// Refuses what has no meaning for a backend that makes all its trees itself.
fn admit(backend: &dyn Backend, update: Update) -> Result<(), BackendError> {
    let takes_trees = matches!(update, Update::Async(_) | Update::TSah);
    if !takes_trees || !backend.makes_own_trees() {
        return Ok(());
    }
    let policy = update.name();
    Err(BackendError::Unsupported {
        backend: backend.device().backend,
        what: format!(
            "update policy '{policy}': it makes its trees itself, within each frame, and takes none that \
             others built; rebuild and refit it does"
        ),
    })
}

#[cfg(test)]
mod tests;
