//! The frame loop: carries out what the schedule says, and never waits for the builder.

use crate::frame::{Adopted, Frame, FrameRecord, add_fetched};
use crate::schedule::{Plan, Schedule, Swap, Update};
use crate::workbench::{Built, Workbench};
use crate::workshop::{BuildFailed, Job, Workshop};
use backend::{
    Backend, BackendError, FRAMES_IN_FLIGHT, FrameReport, Generation, Hits, Method, Query,
    Snapshot, Ticket,
};
use bvh_build::Cancel;
use geom::{Animation, Pose};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// How the backend traces.
    pub method: Method,
    /// How trees follow the motion.
    pub update: Update,
    /// Threads a build may use, beside the backend's own.
    pub builder_threads: usize,
}

/// Owns a backend and renders frames with it.
pub struct Driver {
    backend: Box<dyn Backend>,
    animation: Arc<Animation>,
    schedule: Schedule,
    bench: Arc<Bench>,
    workshop: Workshop,
    /// The tree in use; none before the first frame.
    tree: Option<Tree>,
    /// The build in flight: which tree, for which frame and pose.
    flight: Option<Flight>,
    /// The last finished tree that waits for its boundary.
    finished: Option<Built>,
    /// The pose of the backend's positions.
    pose: Option<Pose>,
    /// What the submission that fetched vertices for a frame's own tree did.
    fetched: Option<FrameReport>,
    pending: VecDeque<Pending>,
    frames: u64,
}

/// The tools of the first build, of `rebuild` and of the workshop, in a pool of their own.
struct Bench {
    pool: rayon::ThreadPool,
    tools: Mutex<Workbench>,
}

struct Tree {
    generation: Generation,
    /// Count of frames begun when its vertices were interpolated.
    frame: u64,
    pose: Pose,
    cost: f64,
}

struct Flight {
    generation: Generation,
    frame: u64,
    pose: Pose,
    /// Whether the vertices have reached the workshop.
    started: bool,
}

/// A frame submitted and not finished.
struct Pending {
    ticket: Ticket,
    frame: Frame,
    begun_ms: f64,
    tree_generation: Generation,
    tree_age_frames: u64,
    adopted: Option<Adopted>,
    fetched: Option<FrameReport>,
    /// What the refitted cost is to be divided by; `None` if the tree is fresh.
    cost_before: Option<f64>,
}

impl Driver {
    /// Loads `animation` into `backend`. The first frame builds the first tree.
    ///
    /// # Errors
    /// The backend refuses the scene or the method, or no threads can be had.
    pub fn new(
        mut backend: Box<dyn Backend>,
        animation: Arc<Animation>,
        options: Options,
    ) -> Result<Self, PipelineError> {
        backend.load(Arc::clone(&animation), options.method)?;
        let bench = Arc::new(Bench::new(options.builder_threads)?);
        let workshop = {
            let (bench, animation) = (Arc::clone(&bench), Arc::clone(&animation));
            Workshop::new(move |job, cancel| bench.build(&animation, &job.positions, cancel))
        };
        Ok(Self {
            backend,
            animation,
            schedule: Schedule::new(options.update, FIRST),
            bench,
            workshop,
            tree: None,
            flight: None,
            finished: None,
            pose: None,
            fetched: None,
            pending: VecDeque::with_capacity(FRAMES_IN_FLIGHT),
            frames: 0,
        })
    }

    /// The backend's description and views.
    pub fn backend(&mut self) -> &mut dyn Backend {
        self.backend.as_mut()
    }

    /// Whether a builder thread was ever started.
    #[must_use]
    pub fn has_builder(&self) -> bool {
        self.workshop.is_open()
    }

    /// Renders `frames` in order, keeping as many under way as the backend allows,
    /// and hands each to `on_frame` when it is done. Hits are read back only if `read_hits`.
    ///
    /// # Errors
    /// The backend's, or whatever `on_frame` returns.
    pub fn run<E: From<PipelineError>>(
        &mut self,
        frames: impl IntoIterator<Item = Frame>,
        query: Query<'_>,
        read_hits: bool,
        mut on_frame: impl FnMut(&FrameRecord, &Hits) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut hits = Hits::default();
        // A frame that waits for its own tree takes two submissions, so none may be left open before it.
        let under_way = if self.schedule.waits_at_once() {
            1
        } else {
            FRAMES_IN_FLIGHT
        };
        for frame in frames {
            self.begin(frame, query)?;
            if self.pending.len() >= under_way {
                let record = self.finish(read_hits.then_some(&mut hits))?;
                if let Some(record) = record {
                    on_frame(&record, &hits)?;
                }
            }
        }
        while let Some(record) = self.finish(read_hits.then_some(&mut hits))? {
            on_frame(&record, &hits)?;
        }
        Ok(())
    }

    /// Submits one frame. With trees built at once (`rebuild`, lockstep 0) the
    /// frame before must be finished: each takes two submissions.
    ///
    /// # Errors
    /// The backend's.
    pub fn begin(&mut self, frame: Frame, query: Query<'_>) -> Result<(), PipelineError> {
        let start = Instant::now();
        let pose = self.animation.pose(frame.time);
        self.hear_from_builder()?;
        let adopted = match &self.tree {
            None => Some(self.first_tree(pose)?),
            Some(tree) => {
                let outdated = tree.pose != pose;
                let plan = self.schedule.begin_frame(self.frames, outdated);
                self.follow(plan, pose)?
            }
        };
        if self.record_geometry(pose, adopted.is_some())? {
            self.backend.preprocess()?;
            self.backend.refit()?;
        }
        self.backend.trace(query)?;
        let ticket = self.backend.submit()?;
        self.hear_from_builder()?;
        self.push_pending(ticket, frame, start, adopted);
        Ok(())
    }

    /// Waits for the oldest frame under way; `None` if there is none.
    ///
    /// # Errors
    /// The backend's.
    pub fn finish(
        &mut self,
        hits: Option<&mut Hits>,
    ) -> Result<Option<FrameRecord>, PipelineError> {
        let Some(pending) = self.pending.pop_front() else {
            return Ok(None);
        };
        let start = Instant::now();
        let mut report = self.backend.wait(pending.ticket)?;
        if let Some(fetched) = &pending.fetched {
            add_fetched(&mut report, fetched);
        }
        let wall_ms = pending.begun_ms + ms_since(start);
        if let Some(hits) = hits {
            self.backend.hits(pending.ticket, hits)?;
        }
        self.hear_from_builder()?;
        let sah_ratio = report.sah_cost.map(|now| {
            let before = pending.cost_before.filter(|&c| c > 0.0);
            before.map_or(1.0, |before| now / before)
        });
        Ok(Some(FrameRecord {
            frame: pending.frame,
            report,
            wall_ms,
            tree_generation: pending.tree_generation,
            tree_age_frames: pending.tree_age_frames,
            adopted: pending.adopted,
            sah_ratio,
        }))
    }

    /// Passes vertices on to the builder and takes finished trees. Never waits.
    fn hear_from_builder(&mut self) -> Result<(), PipelineError> {
        if self.flight.as_ref().is_some_and(|f| !f.started)
            && let Some((_, positions)) = self.backend.take_positions()?
        {
            self.start_build(positions);
        }
        if let Some((generation, result)) = self.workshop.try_take() {
            self.file(generation, result);
        }
        Ok(())
    }

    fn start_build(&mut self, positions: Snapshot) {
        let Some(flight) = self.flight.as_mut() else {
            return;
        };
        flight.started = true;
        let generation = flight.generation;
        if self
            .workshop
            .start(Job {
                generation,
                positions,
            })
            .is_err()
        {
            self.give_up(generation);
        }
    }

    /// Puts a finished tree aside for its boundary, or forgets a failed one.
    fn file(&mut self, generation: Generation, result: Result<Built, BuildFailed>) {
        match result {
            Ok(built) => {
                self.finished = Some(built);
                self.schedule.finished(generation);
            }
            Err(_) => self.give_up(generation),
        }
    }

    fn give_up(&mut self, generation: Generation) {
        self.schedule.failed(generation);
        self.flight.take_if(|f| f.generation == generation);
    }

    /// Does what the plan says before the frame is traced; returns the tree swapped to.
    fn follow(&mut self, plan: Plan, pose: Pose) -> Result<Option<Adopted>, PipelineError> {
        let mut adopted = None;
        if let Some(swap) = plan.swap {
            adopted = self.swap(swap)?;
        }
        let Some(generation) = plan.ask else {
            return Ok(adopted);
        };
        if plan.at_once {
            let built = self.build_now(pose)?;
            self.schedule.swapped_at_once(generation);
            return Ok(match built {
                Ok(built) => Some(self.adopt(built, generation, self.frames, pose)?),
                Err(_) => adopted,
            });
        }
        self.flight = Some(Flight {
            generation,
            frame: self.frames,
            pose,
            started: false,
        });
        Ok(adopted)
    }

    /// Swaps to a finished tree, waiting for it only where the plan says so.
    fn swap(&mut self, swap: Swap) -> Result<Option<Adopted>, PipelineError> {
        while swap.wait && self.finished.is_none() && self.flight.is_some() {
            self.hear_from_builder()?;
            if self.flight.as_ref().is_some_and(|f| f.started) && self.finished.is_none() {
                match self.workshop.take() {
                    Some((generation, result)) => self.file(generation, result),
                    None => self.give_up(swap.generation),
                }
            } else {
                std::thread::yield_now();
            }
        }
        match (self.finished.take(), self.flight.take()) {
            (Some(built), Some(f)) => Ok(Some(self.adopt(built, f.generation, f.frame, f.pose)?)),
            _ => Ok(None),
        }
    }

    /// Builds from the backend's vertices at `pose` while the frame waits.
    fn build_now(&mut self, pose: Pose) -> Result<Result<Built, BuildFailed>, PipelineError> {
        self.backend.interpolate(pose)?;
        self.pose = Some(pose);
        self.backend.request_positions()?;
        let ticket = self.backend.submit()?;
        self.fetched = Some(self.backend.wait(ticket)?);
        let positions = loop {
            match self.backend.take_positions()? {
                Some((t, positions)) if t == ticket => break positions,
                _ => std::thread::yield_now(),
            }
        };
        Ok(self
            .bench
            .build(&self.animation, &positions, &Cancel::new()))
    }

    fn first_tree(&mut self, pose: Pose) -> Result<Adopted, PipelineError> {
        let built = self
            .build_now(pose)?
            .map_err(|e| PipelineError::FirstTree(e.reason))?;
        self.adopt(built, FIRST, self.frames, pose)
    }

    fn adopt(
        &mut self,
        built: Built,
        generation: Generation,
        frame: u64,
        pose: Pose,
    ) -> Result<Adopted, PipelineError> {
        self.backend.adopt(&built.topology, generation)?;
        self.tree = Some(Tree {
            generation,
            frame,
            pose,
            cost: built.cost,
        });
        Ok(Adopted {
            build_ms: built.build_ms,
            convert_ms: built.convert_ms,
            upload_bytes: built.topology.bytes() as u64,
        })
    }

    /// Brings positions to `pose`; says whether records and boxes must follow.
    fn record_geometry(&mut self, pose: Pose, new_tree: bool) -> Result<bool, PipelineError> {
        let asked = self
            .flight
            .as_ref()
            .is_some_and(|f| f.frame == self.frames && !f.started);
        let moved = self.pose != Some(pose);
        if moved {
            self.backend.interpolate(pose)?;
            self.pose = Some(pose);
        }
        if asked {
            self.backend.request_positions()?;
        }
        Ok(moved || new_tree)
    }

    fn push_pending(
        &mut self,
        ticket: Ticket,
        frame: Frame,
        start: Instant,
        adopted: Option<Adopted>,
    ) {
        let tree = self.tree.as_ref().expect("a frame is traced with a tree");
        self.pending.push_back(Pending {
            ticket,
            frame,
            begun_ms: ms_since(start),
            tree_generation: tree.generation,
            tree_age_frames: self.frames - tree.frame,
            adopted,
            fetched: self.fetched.take(),
            cost_before: (Some(tree.pose) != self.pose).then_some(tree.cost),
        });
        self.frames += 1;
    }
}

/// The generation of the tree that the first frame builds.
const FIRST: Generation = Generation(1);

impl Bench {
    fn new(threads: usize) -> Result<Self, PipelineError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.max(1))
            .thread_name(|i| format!("abvh-build-{i}"))
            .build()
            .map_err(|e| PipelineError::Threads(e.to_string()))?;
        Ok(Self {
            pool,
            tools: Mutex::default(),
        })
    }

    fn build(
        &self,
        animation: &Animation,
        positions: &[geom::Point],
        cancel: &Cancel,
    ) -> Result<Built, BuildFailed> {
        self.pool
            .install(|| self.tools().build(animation, positions, cancel))
            .map_err(|e| BuildFailed {
                reason: e.to_string(),
            })
    }

    /// The tools hold no state between builds but memory, so a panic in one leaves nothing broken.
    fn tools(&self) -> MutexGuard<'_, Workbench> {
        self.tools.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn ms_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
