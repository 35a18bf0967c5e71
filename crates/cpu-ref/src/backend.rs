//! [`Backend`] on the host. `submit` executes the recorded commands in the backend's own thread pool and returns when
//! they have finished, so `wait` never blocks. `trace` with a list of rays executes all recorded commands immediately,
//! so that the list need not be copied.

use crate::accelerator::{Accelerator, reserve};
use crate::bvh2::Bvh2;
use crate::scene::SceneState;
use crate::submission::{Command, Copies, Submission, ms_since};
use backend::{
    Arithmetic, Backend, BackendError, BackendName, Capabilities, Device, DeviceKind,
    FRAMES_IN_FLIGHT, FrameReport, Generation, Hits, HitsPool, Intersector, Query, QueryKind, Rays,
    Result, Snapshot, Ticket, TreeFormat,
};
use bvh_layout::Topology;
use geom::{Animation, Pose, Ray, run_in, start_library_pool};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

/// Creates an empty tree.
type NewTree = Box<dyn Fn() -> Box<dyn Accelerator> + Send + Sync>;

/// A backend that runs all stages on the host.
pub struct CpuBackend {
    device: Device,
    pool: ThreadPool,
    new_tree: NewTree,
    scene: Option<SceneState>,
    /// Generation of the current tree; 0 before the first.
    generation: Generation,
    /// State of the scene after all recorded commands.
    state: State,
    /// Commands recorded since the last submission and not executed yet.
    commands: Vec<Command>,
    /// Set if a trace was recorded since the last submission.
    has_trace: bool,
    /// Submissions whose results are still available, oldest first.
    submissions: VecDeque<Submission>,
    /// The submission that is being recorded.
    next: Submission,
    /// Memory of earlier traces, for reuse.
    spares: HitsPool,
    submitted: u64,
    copies: Copies,
}

/// The last stage whose results are current once all recorded commands have run. Later values include earlier ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum State {
    Nothing,
    Positions,
    /// Triangle data and boxes of leaves.
    Leaves,
    Boxes,
}

impl CpuBackend {
    /// Creates backend `cpu-ref`, with a pool of `threads` threads, by default one per core.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] for 0 threads, [`BackendError::NoDevice`] if the threads cannot be started.
    pub fn new(threads: Option<usize>) -> Result<Self> {
        Self::with_trees(BackendName::CpuRef, TreeFormat::Binary, threads, || {
            Box::new(Bvh2::default())
        })
    }

    /// Creates a backend called `name`, whose trees `new_tree` creates. `format` is the tree format that
    /// [`Accelerator::adopt`] reads fastest. See [`CpuBackend::new`] for `threads`.
    ///
    /// # Errors
    /// See [`CpuBackend::new`].
    pub fn with_trees(
        name: BackendName,
        format: TreeFormat,
        threads: Option<usize>,
        new_tree: impl Fn() -> Box<dyn Accelerator> + Send + Sync + 'static,
    ) -> Result<Self> {
        if threads == Some(0) {
            return Err(BackendError::unsupported(name.name(), "0 threads"));
        }
        let builder = ThreadPoolBuilder::new()
            .num_threads(threads.unwrap_or(0))
            .thread_name(move |i| format!("{name}-{i}"));
        let pool = start_library_pool(builder)
            .map_err(|e| BackendError::NoDevice(format!("cannot start threads: {e}")))?;
        let device = Device {
            backend: name.name(),
            adapter: format!("host ({})", std::env::consts::ARCH),
            driver: String::new(),
            kind: DeviceKind::Cpu,
            threads: pool.current_num_threads(),
            arithmetic: Arithmetic::IEEE,
            capabilities: Capabilities::minimal(name.name(), format),
        };
        Ok(Self {
            device,
            pool,
            new_tree: Box::new(new_tree),
            scene: None,
            generation: Generation::default(),
            state: State::Nothing,
            commands: Vec::new(),
            has_trace: false,
            submissions: VecDeque::new(),
            next: Submission::default(),
            spares: HitsPool::default(),
            submitted: 0,
            copies: Copies::default(),
        })
    }

    fn require(&self, state: State, why: &str) {
        assert!(self.state >= state, "{why}");
    }

    /// Requires a generation above the current one. So it is never 0, which stands for no tree.
    fn require_later(&self, generation: Generation) {
        assert!(
            generation > self.generation,
            "generation {} is not greater than the current generation {}",
            generation.0,
            self.generation.0
        );
    }

    /// Executes the recorded commands. `rays` is the list of a recorded trace, or empty.
    fn execute(&mut self, rays: &[Ray]) -> Result<()> {
        let start = Instant::now();
        let (next, scene) = (&mut self.next, loaded(&mut self.scene));
        if next.ticket.is_none() {
            next.begin(Ticket(self.submitted));
        }
        let (commands, copies) = (&mut self.commands, &mut self.copies);
        let done = run_in(&self.pool, || {
            let mut all = commands.drain(..);
            all.try_for_each(|command| next.execute(command, rays, scene, copies))
        });
        if done.is_err() {
            // The submission is dropped with its copies of positions, and no results are current.
            copies
                .ready
                .retain(|(ticket, _)| next.ticket != Some(*ticket));
            (self.state, self.has_trace) = (State::Nothing, false);
            next.ticket = None;
            return done;
        }
        let report = &mut next.report;
        report.times.device_ms += ms_since(start);
        report.inactive = scene.unhittable.inactive;
        report.degenerate = scene.unhittable.degenerate;
        report.sah_cost = scene.sah_cost;
        // Rays that were resolved in exact arithmetic.
        report.exact_rays += std::mem::take(scene.exact_rays.get_mut());
        Ok(())
    }

    /// Drops submissions that are not retained, once [`FRAMES_IN_FLIGHT`] later submissions have traces that are not
    /// released. A submission that was retained and then released is dropped after [`FRAMES_IN_FLIGHT`] later
    /// submissions of any kind. The memory of dropped hits is reused.
    fn drop_expired(&mut self) {
        let mut later = self.submissions.len();
        let mut later_traced = self.submissions.iter().filter(|s| s.is_traced).count();
        let mut expired = Vec::new();
        self.submissions.retain_mut(|submission| {
            later -= 1;
            later_traced -= usize::from(submission.is_traced);
            let further = if submission.is_released {
                later
            } else {
                later_traced
            };
            let is_available = submission.is_retained || further < FRAMES_IN_FLIGHT;
            if !is_available {
                expired.push(std::mem::take(&mut submission.hits));
            }
            is_available
        });
        expired.into_iter().for_each(|hits| self.spares.put(hits));
    }

    fn finished(&mut self, ticket: Ticket) -> &mut Submission {
        let mut submissions = self.submissions.iter_mut();
        let found = submissions.find(|s| s.ticket == Some(ticket));
        found.unwrap_or_else(|| panic!("ticket {} was not issued, or has expired", ticket.0))
    }
}

fn loaded(scene: &mut Option<SceneState>) -> &mut SceneState {
    scene.as_mut().expect("no scene is loaded: call load first")
}

impl Backend for CpuBackend {
    fn device(&self) -> &Device {
        &self.device
    }

    fn load(&mut self, animation: Arc<Animation>, intersector: Intersector) -> Result<()> {
        self.scene = None;
        self.generation = Generation::default();
        (self.state, self.has_trace) = (State::Nothing, false);
        self.commands.clear();
        self.submissions.clear();
        self.spares.clear();
        self.retain_traces(&[]);
        self.next = Submission::default();
        self.copies = Copies::default();
        let new = || SceneState::new(animation, intersector, &self.new_tree);
        self.scene = Some(run_in(&self.pool, new)?);
        Ok(())
    }

    fn adopt(&mut self, tree: &Topology, generation: Generation) -> Result<()> {
        assert!(
            self.commands.is_empty() && self.next.ticket.is_none(),
            "cannot adopt a tree with unsubmitted commands: call submit first"
        );
        self.require_later(generation);
        let scene = loaded(&mut self.scene);
        run_in(&self.pool, || scene.adopt(tree, generation))?;
        self.generation = generation;
        self.state = self.state.min(State::Positions);
        Ok(())
    }

    fn evaluate(&mut self, tree: &Topology, generation: Generation) -> Result<bool> {
        self.require(
            State::Positions,
            "evaluate needs positions: call interpolate first",
        );
        self.require_later(generation);
        let scene = loaded(&mut self.scene);
        let is_loaded = run_in(&self.pool, || scene.load_candidate(tree, generation))?;
        if is_loaded {
            self.commands.push(Command::Evaluate);
        }
        Ok(is_loaded)
    }

    fn interpolate(&mut self, pose: Pose) -> Result<()> {
        loaded(&mut self.scene);
        self.commands.push(Command::Interpolate(pose));
        self.state = State::Positions;
        Ok(())
    }

    fn preprocess(&mut self) -> Result<()> {
        self.require(
            State::Positions,
            "preprocess needs positions: call interpolate first",
        );
        assert!(
            self.generation > Generation(0),
            "preprocess needs a tree: call adopt first"
        );
        self.commands.push(Command::Preprocess);
        self.state = State::Leaves;
        Ok(())
    }

    fn refit(&mut self) -> Result<()> {
        self.require(
            State::Leaves,
            "refit needs the boxes of leaves: call preprocess first",
        );
        self.commands.push(Command::Refit);
        self.state = State::Boxes;
        Ok(())
    }

    fn trace(&mut self, queries: &[Query<'_>]) -> Result<()> {
        let &[query] = queries else {
            let backend = self.device.backend;
            return Err(BackendError::unsupported(backend, "batches of queries"));
        };
        let (camera, rays) = match query.rays {
            Rays::Camera(camera) => (Some(*camera), None),
            Rays::List(rays) => (None, Some(rays)),
            Rays::OnDevice(_) => {
                return Err(BackendError::no_rays_on_device(self.device.backend));
            }
        };
        assert!(!self.has_trace, "one submission holds at most one trace");
        let count = query.rays.count();
        self.spares.put(std::mem::take(&mut self.next.hits));
        self.next.hits = self.spares.take(count, query.kind);
        let hits = &mut self.next.hits;
        if query.kind != QueryKind::Any {
            reserve(&mut hits.closest, count, "hits")?;
        }
        if query.kind != QueryKind::Closest {
            reserve(&mut hits.blocked, count, "hits")?;
        }
        assert!(
            self.state == State::Boxes,
            "the tree is stale: preprocess and refit come after adopt and interpolate, and before trace"
        );
        self.has_trace = true;
        self.commands.push(Command::Trace(camera, query.kind));
        if let Some(rays) = rays {
            self.execute(rays)?;
        }
        Ok(())
    }

    fn request_positions(&mut self) -> Result<()> {
        self.require(
            State::Positions,
            "there are no positions to copy: call interpolate first",
        );
        self.commands.push(Command::CopyPositions);
        Ok(())
    }

    fn submit(&mut self) -> Result<Ticket> {
        if self.next.ticket.is_none() || !self.commands.is_empty() {
            self.execute(&[])?;
        }
        let ticket = Ticket(self.submitted);
        let mut done = std::mem::take(&mut self.next);
        done.is_traced = std::mem::take(&mut self.has_trace);
        if !done.is_traced {
            // A trace that returned an error may have allocated buffers.
            self.spares.put(std::mem::take(&mut done.hits));
        }
        self.submissions.push_back(done);
        self.submitted += 1;
        self.drop_expired();
        Ok(ticket)
    }

    fn wait(&mut self, ticket: Ticket) -> Result<FrameReport> {
        Ok(self.finished(ticket).report.clone())
    }

    fn take_hits(&mut self, ticket: Ticket, index: usize, hits: &mut Hits) -> Result<()> {
        assert!(index == 0, "a submission has one query");
        let found = std::mem::take(&mut self.finished(ticket).hits);
        self.spares.put(std::mem::replace(hits, found));
        Ok(())
    }

    fn retain_traces(&mut self, tickets: &[Ticket]) {
        self.spares
            .set_capacity(FRAMES_IN_FLIGHT.max(tickets.len() + 1));
        for submission in &mut self.submissions {
            let was_retained = submission.is_retained;
            let ticket = submission.ticket;
            submission.is_retained = ticket.is_some_and(|t| tickets.binary_search(&t).is_ok());
            if was_retained && !submission.is_retained {
                (submission.is_traced, submission.is_released) = (false, true);
                self.spares.put(std::mem::take(&mut submission.hits));
            }
        }
        self.drop_expired();
    }

    fn take_positions(&mut self) -> Result<Option<(Ticket, Snapshot)>> {
        Ok(self.copies.ready.pop_front())
    }
}

#[cfg(feature = "inspect")]
impl backend::Inspect for CpuBackend {
    fn positions(&mut self) -> Result<Vec<geom::Point>> {
        Ok(loaded(&mut self.scene).positions.clone())
    }

    fn boxes(&mut self) -> Result<Vec<geom::Aabb>> {
        loaded(&mut self.scene).boxes()
    }
}
