//! The reference backend: every stage on the host's cores, by rayon.
//!
//! Plain, and exact to the letter of what a hit is (`docs/design/hits.md`): other
//! backends are held against it bit for bit. One room a stage, by the stage's
//! name: `interpolate`, `preprocess`, `refit`, `trace`; one room a
//! triangle test. Work runs in a pool of the backend's own when it is
//! submitted, so `wait` never blocks; and where a list of rays is to be traced, before that call returns, so that no
//! copy of the list is kept.

#[cfg(test)]
mod contract_tests;
mod exact;
mod extreme;
mod interpolate;
#[cfg(test)]
mod law;
#[cfg(test)]
mod misuse_tests;
mod moller_trumbore;
mod moving;
#[cfg(test)]
mod moving_tests;
mod nodes;
mod packets;
mod preprocess;
mod ray;
mod recording;
mod refit;
mod scale;
mod scene;
mod search;
mod shadow;
#[cfg(test)]
mod shadow_tests;
mod simd;
mod slab;
mod snapshots;
mod submission;
#[cfg(test)]
mod testing;
mod trace;
#[cfg(test)]
mod trace_tests;
mod traverse;
mod triangle_test;
mod watertight;
#[cfg(test)]
mod watertight_tests;
mod wide;
mod woop;

use backend::{
    Arithmetic, Backend, BackendError, Device, DeviceKind, FRAMES_IN_FLIGHT, FrameReport,
    Generation, Hits, Inspect, Method, Query, QueryKind, Rays, Result, Snapshot, Ticket,
};
use bvh_layout::Topology;
use geom::{Aabb, Animation, Point, Pose, Ray};
use rayon::{ThreadPool, ThreadPoolBuilder};
use recording::Recording;
use scene::SceneState;
use simd::Level;
use snapshots::Snapshots;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;
use submission::Submission;

/// The backend's name on the command line.
const NAME: &str = "cpu";

/// Interpolates, preprocesses, refits and traces on the host.
pub struct CpuBackend {
    device: Device,
    pool: ThreadPool,
    /// The instructions that layout `fast` is traced with.
    level: Level,
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

impl CpuBackend {
    /// A backend with a pool of `threads` threads, or of one a core.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] for no threads, [`BackendError::NoDevice`] if they cannot be started.
    pub fn new(threads: Option<usize>) -> Result<Self> {
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
            level: Level::best(),
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

    /// Does what was recorded and not done yet, a trace of a list with `rays`.
    fn carry_out(&mut self, rays: &[Ray]) {
        let at = (Ticket(self.submitted), self.epoch);
        let submission = &mut self.next;
        let (scene, snapshots) = (loaded(&mut self.scene), &mut self.snapshots);
        let recorded = (self.recording.take_new(), rays);
        self.pool
            .install(|| submission.run(at, recorded, scene, snapshots));
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

/// Makes room for `count` entries in all.
fn reserve<T>(memory: &mut Vec<T>, count: usize, what: &str) -> Result<()> {
    let more = count.saturating_sub(memory.len());
    let bytes = (count as u64).saturating_mul(size_of::<T>() as u64);
    memory
        .try_reserve_exact(more)
        .map_err(|_| BackendError::OutOfMemory {
            what: what.to_owned(),
            bytes,
        })
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
        let level = self.level;
        self.scene = Some(
            self.pool
                .install(|| SceneState::new(animation, method, level))?,
        );
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
        self.scene.as_ref().is_some_and(SceneState::is_wide)
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
        let count = query.rays.count();
        let hits = &mut self.next.hits;
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
        Ok(self.scene().boxes())
    }
}
