//! A scene on a device, with the trees that follow its motion.

use crate::motion::Joined;
use crate::step::{QueryId, Step, StepId, find};
use crate::{Device, Error, Hits, Intersector, Layout, Result, Scene};
use backend::{DeviceKind, FRAMES_IN_FLIGHT, Method, Query, Ticket};
use geom::Animation;
use pipeline::{Driver, DriverOptions, Frame, FrameRecord, Pace, Threads};
use std::collections::VecDeque;
use std::fmt;
use std::sync::Arc;

/// How trees follow the motion. None of them changes a hit, only how fast it is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Update {
    /// [`Update::Refit`] if no mesh can move, else [`Update::Async`].
    #[default]
    Auto,
    /// A new tree before each step's queries.
    Rebuild,
    /// The first tree for ever, its boxes refitted to each step's vertices.
    Refit,
    /// The newest tree that is finished, refitted, while the host builds the next for where the motion is going.
    Async,
}

/// What a tracer is to be.
#[derive(Clone, Debug)]
pub struct Builder {
    device: Device,
    update: Update,
    method: Method,
    threads: Option<usize>,
}

impl Builder {
    /// Where the work is done; [`Device::Auto`] if nothing is said.
    #[must_use]
    pub fn device(self, device: Device) -> Self {
        Self { device, ..self }
    }

    /// How trees follow the motion; [`Update::Auto`] if nothing is said.
    #[must_use]
    pub fn update(self, update: Update) -> Self {
        Self { update, ..self }
    }

    /// How rays are tested against triangles; [`Intersector::Watertight`] if nothing is said.
    #[must_use]
    pub fn intersector(mut self, intersector: Intersector) -> Self {
        self.method.intersector = intersector;
        self
    }

    /// How trees lie in memory; [`Layout::Fast`] if nothing is said.
    #[must_use]
    pub fn layout(mut self, layout: Layout) -> Self {
        self.method.layout = layout;
        self
    }

    /// Threads of the host that trace, where it does, or else build trees. If nothing is said, one a core traces, or one for
    /// two cores builds: the program needs some, too. Where the host traces while the next tree is built, a quarter more
    /// build: of the cores, or beside the threads that are given here.
    #[must_use]
    pub fn threads(self, threads: usize) -> Self {
        let threads = Some(threads.max(1));
        Self { threads, ..self }
    }

    /// Opens the device and loads the scene.
    ///
    /// # Errors
    /// [`Error::NoDevice`], or [`Error::Device`] if the scene is beyond its limits.
    pub fn build(self, scene: Scene) -> Result<Tracer> {
        let number = scene.number;
        let (mut joined, animation) = Joined::of(scene.meshes)?;
        let update = match self.update {
            Update::Auto if !joined.moves() => pipeline::Update::Refit,
            Update::Auto | Update::Async => pipeline::Update::Async(Pace::Free),
            Update::Rebuild => pipeline::Update::Rebuild,
            Update::Refit => pipeline::Update::Refit,
        };
        let share = |kind| Threads::share(host::cores(), kind, update, [self.threads, None]);
        let backend = self.device.open(share(DeviceKind::Cpu).render)?;
        let name = format!(
            "{} ({})",
            backend.device().backend,
            backend.device().adapter
        );
        let last = if joined.is_live() {
            f64::MAX
        } else {
            animation.end()
        };
        let options = DriverOptions {
            method: self.method,
            update,
            builder_threads: match (self.threads, share(backend.device().kind).build) {
                // With all of them steps wait for cores longer than they gain by trees.
                (None, all) if backend.device().kind == DeviceKind::Gpu => all.div_ceil(2),
                (_, shared) => shared,
            },
            time_range: [0.0, last],
            predict: true,
        };
        let animation = Arc::new(animation);
        let driver = Driver::new(backend, Arc::clone(&animation), options);
        let mut driver = driver.map_err(Error::of_driver)?;
        joined.prepare(&animation, driver.backend())?;
        Ok(Tracer {
            driver,
            animation,
            joined,
            scene: number,
            device: name,
            waits: update == pipeline::Update::Rebuild,
            steps: 0,
            frames: 0,
            under_way: VecDeque::new(),
            results: VecDeque::new(),
            last: None,
        })
    }
}

/// What is known of the tree in use and of the scene, as of the last query that is done.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Statistics {
    /// Trees so far, this one included.
    pub generation: u64,
    /// Queries since the one that asked for it.
    pub age: u64,
    /// The refitted tree's cost by the surface area heuristic over its cost when it was built; `None` where nobody measures it.
    pub cost_ratio: Option<f64>,
    /// Triangles with a vertex that is not finite: they are never hit.
    pub inactive: u64,
    /// Triangles without area, which are never hit either.
    pub degenerate: u64,
}

/// A scene that rays are traced through.
pub struct Tracer {
    pub(crate) driver: Driver,
    animation: Arc<Animation>,
    pub(crate) joined: Joined,
    pub(crate) scene: u64,
    device: String,
    /// Whether a query waits for those before it.
    waits: bool,
    steps: u64,
    frames: u64,
    under_way: VecDeque<QueryId>,
    /// That may be asked for, from the oldest to the newest.
    pub(crate) results: VecDeque<(QueryId, Ticket)>,
    last: Option<FrameRecord>,
}

impl Tracer {
    /// Says what is wanted, step by step.
    #[must_use]
    pub fn builder() -> Builder {
        Builder {
            device: Device::Auto,
            update: Update::Auto,
            method: Method {
                intersector: Intersector::Watertight,
                layout: Layout::Fast,
            },
            threads: None,
        }
    }

    /// The device's name, such as `cpu (host (x86_64))`.
    #[must_use]
    pub fn device(&self) -> &str {
        &self.device
    }

    /// Begins a step, in which meshes with key frames stand at `time`: see [`Mesh::keyframes`](crate::Mesh::keyframes). A
    /// time that is no number counts as 0.
    pub fn step(&mut self, time: f64) -> Step<'_> {
        self.steps += 1;
        let time = if time.is_nan() { 0.0 } else { time };
        Step {
            id: StepId(self.steps),
            tracer: self,
            time,
            queries: 0,
        }
    }

    /// Waits for a query and shows what it found.
    ///
    /// # Errors
    /// [`Error::NoResult`] if it is of another step or was dropped, [`Error::Device`].
    pub fn hits(&mut self, step: StepId, query: QueryId) -> Result<Hits<'_>> {
        let ticket = find(&self.results, step, query)?;
        while self.under_way.contains(&query) {
            self.finish()?;
        }
        let found = self.driver.backend().hits(ticket);
        Ok(Hits {
            found: found.map_err(Error::of_backend)?,
            joined: &self.joined,
            scene: self.scene,
        })
    }

    /// The tree in use, as of the last query that is done; `None` before the first.
    #[must_use]
    pub fn statistics(&self) -> Option<Statistics> {
        self.last.as_ref().map(|record| Statistics {
            generation: record.tree_generation.0,
            age: record.tree_age_frames,
            cost_ratio: record.sah_ratio,
            inactive: record.report.inactive,
            degenerate: record.report.degenerate,
        })
    }

    pub(crate) fn begin(&mut self, id: QueryId, time: f64, query: Query<'_>) -> Result<()> {
        let most = if self.waits { 1 } else { FRAMES_IN_FLIGHT };
        while self.under_way.len() >= most {
            self.finish()?;
        }
        #[cfg(feature = "wgpu")]
        self.release_points();
        let backend = self.driver.backend();
        let time = self.joined.tell(&self.animation, backend, time)?;
        let index = self.frames;
        // This one comes after all of them.
        self.driver.backend().keep(self.results.len() + 1);
        let begun = self.driver.begin(Frame { index, time }, query);
        let ticket = begun.map_err(Error::of_driver)?;
        self.frames += 1;
        self.under_way.push_back(id);
        self.results.push_back((id, ticket));
        Ok(())
    }

    /// Waits for the oldest query under way.
    fn finish(&mut self) -> Result<()> {
        if self.under_way.pop_front().is_some() {
            let finished = self.driver.finish(None).map_err(Error::of_driver)?;
            self.last = finished.or(self.last.take());
        }
        Ok(())
    }

    /// Drops results of all steps but this one and the one before.
    pub(crate) fn end_step(&mut self, id: StepId) {
        let is_old = |(query, _): &(QueryId, Ticket)| query.step.0 + 1 < id.0;
        while self.results.front().is_some_and(is_old) {
            self.results.pop_front();
        }
    }
}

impl fmt::Debug for Tracer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Tracer on {}", self.device)
    }
}
