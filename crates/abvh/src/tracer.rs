//! A scene on a device, with the trees that follow its motion.

use crate::loaded::{Loaded, find};
use crate::replacement::Disposal;
use crate::{
    Device, Error, Hits, Intersector, Layout, Mesh, MeshId, QueryId, Result, Scene, Step, StepId,
};
use backend::{Backend, DeviceKind, Method, Query};
use geom::lock;
use pipeline::{BuilderThreads, DriverOptions, Pace, Threads};
use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

/// How trees follow the motion. None of them changes a hit, only how fast it is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Update {
    /// [`Update::Refit`] if no mesh can move, else [`Update::Async`].
    #[default]
    Auto,
    /// A new tree before each step's queries.
    Rebuild,
    /// Likewise, made by the GPU itself from the vertices that it has: plainer trees, far sooner. For motion after which an
    /// older tree is of no use. A device that makes none, such as the host, refuses it.
    DeviceRebuild,
    /// The first tree for ever, its boxes refitted to each step's vertices.
    Refit,
    /// The newest tree that is finished, refitted, while the host builds the next for where the motion is going.
    Async,
    /// Likewise, with each tree taken up exactly so many steps after it was asked for, and waited for if it must be: then each
    /// run goes through the same trees. With 0, each step waits for its own.
    Lockstep(u32),
}

/// What a tracer is to be.
#[derive(Clone, Debug)]
pub struct Builder {
    device: Device,
    update: Update,
    pub(crate) method: Method,
    threads: Option<usize>,
    builder_threads: Option<usize>,
    time_range: [f64; 2],
    predict: bool,
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
    /// two cores builds: the program needs some, too. Where the host traces while the next tree is built, a quarter of four
    /// or more cores builds and the others trace; of threads that are given here, all trace, and a quarter more build.
    #[must_use]
    pub fn threads(self, threads: usize) -> Self {
        let threads = Some(threads.max(1));
        Self { threads, ..self }
    }

    /// Threads of the host that build trees beside those that trace; see [`Builder::threads`] if nothing is said.
    #[must_use]
    pub fn builder_threads(mut self, threads: usize) -> Self {
        self.builder_threads = Some(threads.max(1));
        self
    }

    /// The first and the last time of all steps to come, in key frames, as far as that is known: no tree is built for others.
    #[must_use]
    pub fn time_range(self, time_range: [f64; 2]) -> Self {
        Self { time_range, ..self }
    }

    /// Whether trees are built for where the motion is going; else for where it was when they were asked for, to measure by.
    #[must_use]
    pub fn predict(self, predict: bool) -> Self {
        Self { predict, ..self }
    }

    /// Opens the device and loads the scene.
    ///
    /// # Errors
    /// [`Error::NoDevice`]; [`Error::Unsupported`] if the scene is beyond its limits; [`Error::OutOfMemory`] if trees over it
    /// take more memory than the system grants (some 345 bytes a triangle), as far as that is known before; [`Error::Device`].
    pub fn build(self, scene: Scene) -> Result<Tracer> {
        let backend = self.open(self.policy(&scene.meshes))?;
        self.build_on(backend, scene)
    }

    /// Likewise, on the device that a tracer has open: its kernels stay ready. What was said of a device counts for nothing, nor
    /// that of threads where the host traces.
    ///
    /// # Errors
    /// [`Error::Unsupported`], [`Error::Device`].
    pub fn build_in_place_of(self, former: Tracer, scene: Scene) -> Result<Tracer> {
        let former = former.state.into_inner();
        let former = former.unwrap_or_else(PoisonError::into_inner);
        self.build_on(former.current.driver.into_backend(), scene)
    }

    /// Likewise, on a device that is open, as of a backend of the program's own. The trait is one of the crates that promise
    /// nothing: it may change with each version. Only [`Device`]s have meshes [replaced](Tracer::replace).
    ///
    /// # Errors
    /// [`Error::Unsupported`], [`Error::Device`].
    pub fn build_on(self, backend: Box<dyn Backend>, scene: Scene) -> Result<Tracer> {
        let update = self.policy(&scene.meshes);
        let (device, kind) = (name(backend.as_ref()), backend.device().kind);
        let builders = self.builders(kind, update)?;
        let steps = TRACERS.fetch_add(1, Ordering::Relaxed) << 40;
        let state = State {
            current: Loaded::new(scene.meshes, backend, self.options(update), builders)?,
            former: Vec::new(),
            builder: self,
            commits: 0,
            replaced: BTreeMap::new(),
            device: device.clone(),
            kind,
            steps,
            submitted: steps,
            last: None,
            disposal: Arc::default(),
        };
        Ok(Tracer {
            device,
            state: Mutex::new(state),
        })
    }

    /// How trees follow the motion of such meshes.
    pub(crate) fn policy(&self, meshes: &[Mesh]) -> pipeline::Update {
        match self.update {
            Update::Auto if meshes.iter().all(|m| m.motion.is_fixed()) => pipeline::Update::Refit,
            Update::Auto | Update::Async => pipeline::Update::Async(Pace::Free),
            Update::Lockstep(steps) => pipeline::Update::Async(Pace::Lockstep(steps)),
            Update::Rebuild => pipeline::Update::Rebuild,
            Update::DeviceRebuild => pipeline::Update::DeviceRebuild,
            Update::Refit => pipeline::Update::Refit,
        }
    }

    /// What a driver is to do.
    pub(crate) fn options(&self, update: pipeline::Update) -> DriverOptions {
        DriverOptions {
            method: self.method,
            update,
            time_range: self.time_range,
            predict: self.predict,
        }
    }

    pub(crate) fn open(&self, update: pipeline::Update) -> Result<Box<dyn Backend>> {
        self.device
            .open(self.share(DeviceKind::Cpu, update)?.render)
    }

    /// Threads that build trees beside such a device.
    pub(crate) fn builders(
        &self,
        kind: DeviceKind,
        update: pipeline::Update,
    ) -> Result<BuilderThreads> {
        let asked = self.threads.or(self.builder_threads);
        let threads = match (asked, self.share(kind, update)?.build) {
            // With all of them steps wait for cores longer than they gain by trees.
            (None, all) if kind == DeviceKind::Gpu => all.div_ceil(2),
            (_, shared) => shared,
        };
        BuilderThreads::new(threads).map_err(Error::of_driver)
    }

    fn share(&self, kind: DeviceKind, update: pipeline::Update) -> Result<Threads> {
        let asked = [self.threads, self.builder_threads];
        match asked.into_iter().flatten().max() {
            Some(most) if most > MOST_THREADS => {
                let why = format!("{most} threads are too many: {MOST_THREADS} may be asked for");
                Err(Error::Unsupported(why))
            }
            _ => Ok(Threads::share(host::cores(), kind, update, asked)),
        }
    }
}

pub(crate) fn moment(time: f64) -> f64 {
    // Far beyond all key frames, and differences do not overflow.
    let time = time.clamp(-1e100, 1e100);
    if time.is_nan() { 0.0 } else { time }
}

/// A device's name.
pub(crate) fn name(backend: &dyn Backend) -> String {
    let device = backend.device();
    format!("{} ({})", device.backend, device.adapter)
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
    /// Whether the next tree is being built, or waits for the step that will take it up.
    pub building: bool,
    /// Triangles with a vertex that is not finite: they are never hit.
    pub inactive: u64,
    /// Triangles without area, which are never hit either.
    pub degenerate: u64,
}

/// Threads that may be asked for: many more would take minutes to start.
const MOST_THREADS: usize = 4096;

/// Tracers so far.
static TRACERS: AtomicU64 = AtomicU64::new(0);

/// A scene that rays are traced through. Steps need it alone; results are read through a shared reference, by several threads
/// one after another.
pub struct Tracer {
    device: String,
    /// Steps have it without a lock.
    state: Mutex<State>,
}

/// Everything that steps change, and that reading results changes.
pub(crate) struct State {
    pub(crate) current: Loaded,
    /// Before meshes were replaced, as long as there are results.
    pub(crate) former: Vec<Loaded>,
    pub(crate) builder: Builder,
    /// Replacements so far.
    pub(crate) commits: u64,
    /// The newest replacement of each mesh, counted from 1.
    pub(crate) replaced: BTreeMap<usize, u64>,
    pub(crate) device: String,
    pub(crate) kind: DeviceKind,
    /// The step begun last. Steps are counted from a number that is the tracer's own.
    steps: u64,
    /// The step submitted last.
    submitted: u64,
    pub(crate) last: Option<Statistics>,
    /// Of this tracer and its replacements.
    pub(crate) disposal: Arc<Disposal>,
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
            builder_threads: None,
            time_range: [0.0, f64::INFINITY],
            predict: true,
        }
    }

    /// The device's name, such as `cpu (host (x86_64))`.
    #[must_use]
    pub fn device(&self) -> &str {
        &self.device
    }

    pub(crate) fn state(&mut self) -> &mut State {
        self.state.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    /// Locks what steps change: for readers of results.
    pub(crate) fn shared_state(&self) -> MutexGuard<'_, State> {
        lock(&self.state)
    }

    /// Builds the first tree, for `time`, and makes kernels ready: then the first step waits for neither. Later it does nothing.
    ///
    /// # Errors
    /// [`Error::KeyFrame`] where one is read; [`Error::Device`].
    pub fn warm_up(&mut self, time: f64) -> Result<()> {
        let current = &mut self.state().current;
        match current.has_tree() {
            true => Ok(()),
            false => current.warm_up(moment(time), &[]),
        }
    }

    /// Begins a step, in which meshes with key frames stand at `time`: see [`Mesh::keyframes`](crate::Mesh::keyframes). A
    /// time that is no number counts as 0.
    pub fn step(&mut self, time: f64) -> Step<'_> {
        let state = self.state();
        state.steps += 1;
        Step {
            id: StepId(state.steps),
            tracer: state,
            time: moment(time),
            queries: 0,
            deferred: Vec::new(),
            is_submitted: false,
        }
    }

    /// Waits for a query and returns its results, which may be held while further steps are prepared. They are not copied.
    /// A result can be read any number of times until the second step after its own is submitted.
    ///
    /// ```
    /// # use abvh::{Device, Mesh, Query, Ray, Scene, SceneHit, Tracer};
    /// let mut scene = Scene::new();
    /// let mesh = scene.add(Mesh::fixed(&[[0., 0., 0.], [2., 0., 0.], [0., 2., 0.]], &[[0, 1, 2]])?);
    /// let mut tracer = Tracer::builder().device(Device::Cpu).build(scene)?;
    /// let rays = [Ray::new([0.5, 0.5, 3.0], [0.0, 0.0, -1.0])];
    /// let mut step = tracer.step(0.0);
    /// let (closest, any) = (step.trace(&rays, Query::Closest)?, step.trace(&rays, Query::Any)?);
    /// let done = step.submit()?;
    /// while !tracer.is_done(done, any)? {
    ///     // Other work.
    /// }
    /// let (closest, any) = (tracer.hits(done, closest)?, tracer.hits(done, any)?);
    /// let step = tracer.step(0.0);
    /// assert_eq!((closest.closest(0).unwrap().mesh, any.any()), (mesh, &[1][..]));
    /// step.submit()?;
    /// // In memory of the program's own.
    /// let mut hits = [SceneHit::MISS; 1];
    /// assert_eq!((closest.copy_to(&mut hits), hits[0].t), (1, 3.0));
    /// # Ok::<_, abvh::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::NoResult`] if the query is of another step or tracer, or its result was dropped; [`Error::Device`].
    pub fn hits(&self, step: StepId, query: QueryId) -> Result<Hits> {
        let State {
            current,
            former,
            last,
            ..
        } = &mut *self.shared_state();
        let (loaded, at) = find(current, former, step, query)?;
        loaded.hits(at, last)
    }

    /// Returns whether a query is done, so that [`Tracer::hits`] would not wait. Never waits: `false` also while another
    /// thread reads a result of this tracer.
    ///
    /// # Errors
    /// As for [`Tracer::hits`].
    pub fn is_done(&self, step: StepId, query: QueryId) -> Result<bool> {
        let mut state = match self.state.try_lock() {
            Ok(state) => state,
            Err(TryLockError::Poisoned(e)) => e.into_inner(),
            Err(TryLockError::WouldBlock) => return Ok(false),
        };
        let State {
            current, former, ..
        } = &mut *state;
        let (loaded, at) = find(current, former, step, query)?;
        loaded.is_done(at)
    }

    /// Returns the number of a mesh's first triangle among those of all meshes, by which [`Hits::in_scene`] and answers in a
    /// device's memory count. It may change when a mesh is [replaced](Tracer::commit). Hits of earlier steps keep the former
    /// numbers.
    ///
    /// # Errors
    /// [`Error::ForeignMesh`].
    pub fn first_triangle(&self, mesh: MeshId) -> Result<u32> {
        let joined = &self.shared_state().current.joined;
        let index = mesh.within(&joined.meshes)?;
        Ok(joined.numbering.starts[index] as u32)
    }

    /// The tree in use, as of the last query that is done; `None` before the first.
    #[must_use]
    pub fn statistics(&self) -> Option<Statistics> {
        self.shared_state().last
    }
}

impl State {
    pub(crate) fn begin(&mut self, time: f64, asked: (&[QueryId], &[Query<'_>])) -> Result<()> {
        self.current.begin(time, asked, &mut self.last)
    }

    /// Drops results of all steps but a step that is submitted now and the one submitted before.
    pub(crate) fn submitted(&mut self, step: StepId) {
        let before = std::mem::replace(&mut self.submitted, step.0);
        self.keep_from(before);
    }

    /// Drops results of steps before one, and scenes that have no others.
    pub(crate) fn keep_from(&mut self, oldest: u64) {
        self.current.keep_from(oldest);
        let is_done = |loaded: &mut Loaded| !loaded.keep_from(oldest);
        for done in self.former.extract_if(.., is_done) {
            self.disposal.begin(move || drop(done));
        }
    }
}

impl fmt::Debug for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "State of a tracer on {}", self.device)
    }
}

impl fmt::Debug for Tracer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Tracer on {}", self.device)
    }
}
