//! [`Backend`] on the host: work runs in a pool of the backend's own when it is submitted, so `wait` never blocks; where
//! a list of rays is to be traced, before that call returns, so that no copy of the list is kept.

use crate::Accelerator;
use crate::bvh2::Bvh2;
use crate::interpolate::copy;
use crate::recording::{Command, Recording};
use crate::reserve;
use crate::scene::SceneState;
use crate::snapshots::Snapshots;
use crate::tiles::Output;
use backend::{
    Arithmetic, Backend, BackendError, Device, DeviceKind, FRAMES_IN_FLIGHT, FrameReport,
    Generation, Hits, Inspect, Layout, Method, Query, QueryKind, Rays, Result, Snapshot, Ticket,
};
use bvh_layout::Topology;
use geom::{Aabb, Animation, Hit, Point, Pose, Ray};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

/// The backend's name on the command line.
const NAME: &str = "cpu";

/// Makes the tree that a layout is traced by.
type NewTree = Box<dyn Fn(Layout) -> Box<dyn Accelerator> + Send>;

/// Interpolates, preprocesses, refits and traces on the host.
pub struct CpuBackend {
    device: Device,
    pool: ThreadPool,
    new_tree: NewTree,
    scene: Option<SceneState>,
    generation: Option<Generation>,
    recording: Recording,
    /// From the oldest that is kept to the newest.
    submissions: VecDeque<Submission>,
    /// The one being recorded; its memory was an older one's.
    next: Submission,
    submitted: u64,
    /// Submissions with a trace so far.
    traces: u64,
    snapshots: Snapshots,
    /// Where the device's clock begins.
    epoch: Instant,
}

/// A ticket with what came of it; its memory is used again by a later one.
#[derive(Debug, Default)]
struct Submission {
    /// `None` until some of it was carried out.
    ticket: Option<Ticket>,
    /// Submissions with a trace, up to and including this one.
    traces: u64,
    report: FrameReport,
    hits: Hits,
}

impl CpuBackend {
    /// The reference: a backend with a pool of `threads` threads, or of one a core.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] for no threads, [`BackendError::NoDevice`] if they cannot be started.
    pub fn new(threads: Option<usize>) -> Result<Self> {
        Self::with_trees(threads, |_| Box::new(Bvh2::default()))
    }

    /// Likewise, where `new_tree` makes the tree that a layout is traced by.
    ///
    /// # Errors
    /// See [`CpuBackend::new`].
    pub fn with_trees(
        threads: Option<usize>,
        new_tree: impl Fn(Layout) -> Box<dyn Accelerator> + Send + 'static,
    ) -> Result<Self> {
        if threads == Some(0) {
            return Err(BackendError::Unsupported {
                backend: NAME,
                what: "0 threads".to_owned(),
            });
        }
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads.unwrap_or(0))
            .thread_name(|i| format!("{NAME}-{i}"))
            .build()
            .map_err(|e| BackendError::NoDevice(format!("cannot start threads: {e}")))?;
        let device = Device {
            backend: NAME,
            adapter: format!("host ({})", std::env::consts::ARCH),
            driver: String::new(),
            kind: DeviceKind::Cpu,
            threads: pool.current_num_threads(),
            arithmetic: Arithmetic::IEEE,
        };
        Ok(Self {
            device,
            pool,
            new_tree: Box::new(new_tree),
            scene: None,
            generation: None,
            recording: Recording::default(),
            submissions: VecDeque::new(),
            next: Submission::default(),
            submitted: 0,
            traces: 0,
            snapshots: Snapshots::default(),
            epoch: Instant::now(),
        })
    }

    fn scene(&mut self) -> &mut SceneState {
        loaded(&mut self.scene)
    }

    /// Carries out what was recorded and not done yet, a trace of a list with `rays`.
    fn carry_out(&mut self, rays: &[Ray]) {
        let start = Instant::now();
        let ticket = Ticket(self.submitted);
        let (next, scene) = (&mut self.next, loaded(&mut self.scene));
        if next.ticket != Some(ticket) {
            next.begin(ticket, (start - self.epoch).as_secs_f64() * 1e3);
        }
        let (commands, snapshots) = (self.recording.take_new(), &mut self.snapshots);
        self.pool.install(|| {
            for &command in commands {
                next.carry_out(command, rays, scene, snapshots);
            }
        });
        let report = &mut next.report;
        report.times.device_ms += ms_since(start);
        report.inactive = scene.unhittable.inactive;
        report.degenerate = scene.unhittable.degenerate;
        report.sah_cost = scene.sah_cost;
        report.settled += scene.take_settled();
    }

    /// Keeps what was submitted until enough with a trace came after it.
    fn keep(&mut self) {
        let mut done = std::mem::take(&mut self.next);
        done.traces = self.traces;
        self.submissions.push_back(done);
        let old = |s: &Submission| self.traces - s.traces >= FRAMES_IN_FLIGHT as u64;
        while self.submissions.front().is_some_and(old) {
            let forgotten = self.submissions.pop_front().unwrap_or_default();
            if forgotten.hits.closest.capacity() >= self.next.hits.closest.capacity() {
                self.next = forgotten;
            }
        }
    }

    fn finished(&self, ticket: Ticket) -> &Submission {
        let found = self.submissions.iter().find(|s| s.ticket == Some(ticket));
        found.unwrap_or_else(|| {
            panic!(
                "ticket {} was never given, or too long ago: the last {FRAMES_IN_FLIGHT} with a trace are kept",
                ticket.0
            )
        })
    }
}

fn loaded(scene: &mut Option<SceneState>) -> &mut SceneState {
    scene
        .as_mut()
        .expect("no scene is current: load comes first")
}

impl Submission {
    fn begin(&mut self, ticket: Ticket, begun_ms: f64) {
        self.ticket = Some(ticket);
        self.report = FrameReport::default();
        self.report.times.begun_ms = Some(begun_ms);
        self.hits.closest.clear();
        self.hits.blocked.clear();
    }

    /// Runs in the pool that the caller installed.
    fn carry_out(
        &mut self,
        command: Command,
        rays: &[Ray],
        scene: &mut SceneState,
        snapshots: &mut Snapshots,
    ) {
        let start = Instant::now();
        let times = &mut self.report.times;
        let stage = match command {
            Command::Interpolate(pose) => {
                scene.interpolate(pose);
                &mut times.interpolate_ms
            }
            Command::Preprocess => {
                scene.preprocess();
                &mut times.preprocess_ms
            }
            Command::Refit => {
                scene.refit();
                &mut times.refit_ms
            }
            Command::Trace(camera, kind) => {
                let rays = camera.as_ref().map_or(Rays::List(rays), Rays::Camera);
                self.trace(scene, Query { rays, kind });
                // A ray's hit and its shadow are one task's, so there is one time for both.
                &mut self.report.times.trace_primary_ms
            }
            Command::CopyPositions => {
                let mut positions = snapshots.buffer();
                positions.resize(scene.positions().len(), [0.0; 3]);
                copy(scene.positions(), &mut positions);
                self.report.readback_bytes += size_of_val(&positions[..]) as u64;
                let ticket = self.ticket.expect("it has begun");
                return snapshots.push(ticket, positions);
            }
        };
        // A stage may be recorded twice.
        *stage = Some(stage.unwrap_or_default() + ms_since(start));
    }

    fn trace(&mut self, scene: &SceneState, query: Query<'_>) {
        let Hits { closest, blocked } = &mut self.hits;
        let count = query.rays.count();
        if query.kind != QueryKind::Any {
            closest.resize(count, Hit::MISS);
        }
        if query.kind != QueryKind::Closest {
            blocked.resize(count, 0);
        }
        let counts = scene.trace(query, Output::new(query.kind, closest, blocked));
        (self.report.hits, self.report.blocked) = match query.kind {
            QueryKind::Any => (counts.blocked, 0),
            QueryKind::Closest | QueryKind::ClosestAndShadow { .. } => {
                (counts.hits, counts.blocked)
            }
        };
    }
}

fn ms_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

impl Backend for CpuBackend {
    fn device(&self) -> &Device {
        &self.device
    }

    fn load(&mut self, animation: Arc<Animation>, method: Method) -> Result<()> {
        self.scene = None;
        self.generation = None;
        self.recording.reset();
        self.submissions.clear();
        self.next = Submission::default();
        self.snapshots = Snapshots::default();
        let tree = (self.new_tree)(method.layout);
        let new = || SceneState::new(animation, method.intersector, tree);
        self.scene = Some(self.pool.install(new)?);
        Ok(())
    }

    fn adopt(&mut self, tree: &Topology, generation: Generation) -> Result<()> {
        self.recording.assert_between_submissions();
        assert!(
            self.generation < Some(generation),
            "generations rise: {} comes after {:?}",
            generation.0,
            self.generation
        );
        let scene = loaded(&mut self.scene);
        self.pool.install(|| scene.adopt(tree))?;
        self.generation = Some(generation);
        self.recording.adopted();
        Ok(())
    }

    fn wants_blocks(&self) -> bool {
        self.scene.as_ref().is_some_and(|s| s.tree.wants_blocks())
    }

    fn interpolate(&mut self, pose: Pose) -> Result<()> {
        self.scene();
        self.recording.interpolate(pose);
        Ok(())
    }

    fn preprocess(&mut self) -> Result<()> {
        self.recording.preprocess();
        Ok(())
    }

    fn refit(&mut self) -> Result<()> {
        self.recording.refit();
        Ok(())
    }

    fn trace(&mut self, query: Query<'_>) -> Result<()> {
        let (count, hits) = (query.rays.count(), &mut self.next.hits);
        if query.kind != QueryKind::Any {
            reserve(&mut hits.closest, count, "hits")?;
        }
        if query.kind != QueryKind::Closest {
            reserve(&mut hits.blocked, count, "hits")?;
        }
        self.recording.trace(query);
        if let Rays::List(rays) = query.rays {
            self.carry_out(rays);
        }
        Ok(())
    }

    fn request_positions(&mut self) -> Result<()> {
        self.recording.copy_positions();
        Ok(())
    }

    fn submit(&mut self) -> Result<Ticket> {
        if !self.recording.is_done() {
            self.carry_out(&[]);
        }
        let ticket = Ticket(self.submitted);
        self.traces += u64::from(self.recording.has_trace());
        self.recording.clear();
        self.submitted += 1;
        self.keep();
        Ok(ticket)
    }

    fn wait(&mut self, ticket: Ticket) -> Result<FrameReport> {
        Ok(self.finished(ticket).report.clone())
    }

    fn hits(&mut self, ticket: Ticket, out: &mut Hits) -> Result<()> {
        let hits = &self.finished(ticket).hits;
        out.closest.clone_from(&hits.closest);
        out.blocked.clone_from(&hits.blocked);
        Ok(())
    }

    fn take_positions(&mut self) -> Result<Option<(Ticket, Snapshot)>> {
        Ok(self.snapshots.pop())
    }

    fn inspect(&mut self) -> &mut dyn Inspect {
        self
    }
}

impl Inspect for CpuBackend {
    fn positions(&mut self) -> Result<Vec<Point>> {
        Ok(self.scene().positions().to_vec())
    }

    fn boxes(&mut self) -> Result<Vec<Aabb>> {
        self.scene().boxes()
    }
}
