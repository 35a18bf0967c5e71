//! The tracer: a scene on a device, with the trees that follow its motion.

use crate::loaded::{Batch, Loaded, find};
use crate::replacement::Disposal;
use crate::{
    Device, Error, Hits, Intersector, Layout, Mesh, MeshId, QueryId, Result, Scene, Step, StepId,
    Update,
};
use backend::{Backend, DeviceKind, Method};
use geom::lock;
use pipeline::{BuilderThreads, DriverOptions, Threads};
use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

/// Configures and creates a [`Tracer`].
#[derive(Clone, Debug)]
pub struct Builder {
    device: Device,
    /// `None` leaves the choice to [`Builder::policy`].
    update: Option<Update>,
    pub(crate) method: Method,
    threads: Option<usize>,
    builder_threads: Option<usize>,
    time_range: [f64; 2],
    predict: bool,
}

impl Builder {
    /// Sets the device. The default is [`Device::Auto`].
    #[must_use]
    pub fn device(self, device: Device) -> Self {
        Self { device, ..self }
    }

    /// Sets how trees follow the motion. The default is [`Update::Refit`] if no mesh can move, else [`Update::Async`].
    #[must_use]
    pub fn update(self, update: Update) -> Self {
        let update = Some(update);
        Self { update, ..self }
    }

    /// Sets the ray-triangle test. The default is [`Intersector::Watertight`].
    #[must_use]
    pub fn intersector(mut self, intersector: Intersector) -> Self {
        self.method.intersector = intersector;
        self
    }

    /// Sets the memory layout of trees. The default is [`Layout::Fast`].
    #[must_use]
    pub fn layout(mut self, layout: Layout) -> Self {
        self.method.layout = layout;
        self
    }

    /// Sets the number of host threads that trace or, if a GPU traces, build trees.
    ///
    /// By default, the host traces with one thread per core. For a GPU, one thread per two cores builds trees, which
    /// leaves cores for the program. If the host traces and builds at the same time, a quarter of four or more cores
    /// builds and the others trace. Threads that are set here all trace, and a quarter as many more threads build.
    #[must_use]
    pub fn threads(self, threads: usize) -> Self {
        let threads = Some(threads.max(1));
        Self { threads, ..self }
    }

    /// Sets the number of host threads that build trees. The default is described at [`Builder::threads`].
    #[must_use]
    pub fn builder_threads(mut self, threads: usize) -> Self {
        self.builder_threads = Some(threads.max(1));
        self
    }

    /// Sets the first and the last time of all future steps, in key frames. No tree is built for a time outside this
    /// range. The default is all times from 0 on.
    #[must_use]
    pub fn time_range(self, time_range: [f64; 2]) -> Self {
        Self { time_range, ..self }
    }

    /// Sets whether trees are built for the predicted positions, which is the default. Otherwise they are built for the
    /// positions at their request, for comparison.
    #[must_use]
    pub fn predict(self, predict: bool) -> Self {
        Self { predict, ..self }
    }

    /// Opens the device and loads the scene.
    ///
    /// # Errors
    /// [`Error::NoDevice`]. [`Error::Unsupported`] if the scene exceeds the device's limits. [`Error::OutOfMemory`] if
    /// the system is known to have too little memory for its trees (about 345 bytes per triangle). [`Error::Device`].
    pub fn build(self, scene: Scene) -> Result<Tracer> {
        let backend = self.open(self.policy(&scene.meshes))?;
        self.build_on(backend, scene)
    }

    /// Loads the scene on the device of another tracer, whose kernels stay ready. Ignores [`Builder::device`], and also
    /// [`Builder::threads`] if the host traces.
    ///
    /// # Errors
    /// [`Error::Unsupported`], [`Error::Device`].
    pub fn build_in_place_of(self, former: Tracer, scene: Scene) -> Result<Tracer> {
        let former = former.state.into_inner();
        let former = former.unwrap_or_else(PoisonError::into_inner);
        self.build_on(former.current.driver.into_backend(), scene)
    }

    /// Loads the scene on an open backend, such as the program's own. The trait `Backend` is in a crate without
    /// stability guarantees: it may change with each version. Only on a [`Device`] can meshes be
    /// [replaced](Tracer::replace).
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

    /// Returns the policy for a scene of `meshes`.
    pub(crate) fn policy(&self, meshes: &[Mesh]) -> Update {
        self.update.unwrap_or_else(|| {
            let is_fixed = meshes.iter().all(|m| m.motion.is_fixed());
            if is_fixed {
                Update::Refit
            } else {
                Update::Async
            }
        })
    }

    /// Returns the options of the driver.
    pub(crate) fn options(&self, update: Update) -> DriverOptions {
        DriverOptions {
            method: self.method,
            update,
            time_range: self.time_range,
            predict: self.predict,
        }
    }

    pub(crate) fn open(&self, update: Update) -> Result<Box<dyn Backend>> {
        self.device
            .open(self.share(DeviceKind::Cpu, update)?.render)
    }

    /// Creates the threads that build trees for a device of this kind.
    pub(crate) fn builders(&self, kind: DeviceKind, update: Update) -> Result<BuilderThreads> {
        let requested = self.threads.or(self.builder_threads);
        let threads = match (requested, self.share(kind, update)?.build) {
            // With more builder threads, steps wait for cores longer than better trees save.
            (None, all) if kind == DeviceKind::Gpu => all.div_ceil(2),
            (_, shared) => shared,
        };
        BuilderThreads::new(threads).map_err(Error::of_driver)
    }

    fn share(&self, kind: DeviceKind, update: Update) -> Result<Threads> {
        let requested = [self.threads, self.builder_threads];
        match requested.into_iter().flatten().max() {
            Some(most) if most > MOST_THREADS => {
                let why = format!("{most} threads are too many: {MOST_THREADS} may be asked for");
                Err(Error::Unsupported(why))
            }
            _ => Ok(Threads::share(host::cores(), kind, update, requested)),
        }
    }
}

pub(crate) fn moment(time: f64) -> f64 {
    // The limits are far beyond all key frames, and differences of times do not overflow.
    let time = time.clamp(-1e100, 1e100);
    if time.is_nan() { 0.0 } else { time }
}

/// Returns the name of a backend and its adapter.
pub(crate) fn name(backend: &dyn Backend) -> String {
    let device = backend.device();
    format!("{} ({})", device.backend, device.adapter)
}

/// State of the tree and of the scene after the last finished query.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Statistics {
    /// Number of trees so far, including the current tree.
    pub generation: u64,
    /// Number of queries since the query that requested the current tree.
    pub age: u64,
    /// Cost of the refitted tree by the surface area heuristic, relative to its cost when it was built. `None` if the
    /// backend does not measure costs.
    pub cost_ratio: Option<f64>,
    /// Whether the next tree is being built, or is finished but not yet adopted.
    pub building: bool,
    /// Number of triangles with a vertex that is not finite. They are never hit.
    pub inactive: u64,
    /// Number of triangles without area. They are never hit.
    pub degenerate: u64,
}

/// Maximum number of threads that may be requested. Many more would take minutes to start.
const MOST_THREADS: usize = 4096;

/// Number of tracers created so far.
static TRACERS: AtomicU64 = AtomicU64::new(0);

/// A scene that rays are traced through.
///
/// Steps need exclusive access. Results are read through a shared reference, by one thread at a time.
pub struct Tracer {
    device: String,
    /// Steps have exclusive access and do not lock it.
    state: Mutex<State>,
}

/// State that is changed by steps and by reading results.
pub(crate) struct State {
    pub(crate) current: Loaded,
    /// Scenes from before replacements, while they have results.
    pub(crate) former: Vec<Loaded>,
    pub(crate) builder: Builder,
    /// Number of committed replacements.
    pub(crate) commits: u64,
    /// Number of the newest committed replacement of each mesh, counted from 1.
    pub(crate) replaced: BTreeMap<usize, u64>,
    pub(crate) device: String,
    pub(crate) kind: DeviceKind,
    /// Number of the step begun last. Each tracer counts from a different number, so no two steps have the same number.
    steps: u64,
    /// Number of the step submitted last.
    submitted: u64,
    pub(crate) last: Option<Statistics>,
    /// Shared with the replacements of this tracer.
    pub(crate) disposal: Arc<Disposal>,
}

impl Tracer {
    /// Returns a builder with default options.
    #[must_use]
    pub fn builder() -> Builder {
        Builder {
            device: Device::Auto,
            update: None,
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

    /// Returns the name of the device, such as `cpu (host (x86_64))`.
    #[must_use]
    pub fn device(&self) -> &str {
        &self.device
    }

    pub(crate) fn state(&mut self) -> &mut State {
        self.state.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    /// Locks the state, to read results.
    pub(crate) fn shared_state(&self) -> MutexGuard<'_, State> {
        lock(&self.state)
    }

    /// Builds the first tree, for `time`, and compiles kernels, so that the first step waits for neither. Does nothing
    /// if there is a tree.
    ///
    /// # Errors
    /// [`Error::KeyFrame`] if a key frame cannot be read; [`Error::Device`].
    pub fn warm_up(&mut self, time: f64) -> Result<()> {
        let current = &mut self.state().current;
        if current.has_tree() {
            Ok(())
        } else {
            current.warm_up(moment(time), &[])
        }
    }

    /// Begins a step in which meshes with key frames are at `time`: see [`Mesh::keyframes`](crate::Mesh::keyframes).
    /// NaN counts as 0.
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

    /// Waits for a query and returns its results without a copy. They remain valid while further steps are prepared.
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
    /// // A copy in the program's own memory.
    /// let mut hits = [SceneHit::MISS; 1];
    /// assert_eq!((closest.copy_to(&mut hits), hits[0].t), (1, 3.0));
    /// # Ok::<_, abvh::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::NoResult`] if the query belongs to another step or tracer, or its result was dropped;
    /// [`Error::Device`].
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

    /// Returns whether a query is done, so that [`Tracer::hits`] would not wait. Never blocks. Also returns `false`
    /// while another thread reads a result of this tracer.
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

    /// Returns the index of a mesh's first triangle among the triangles of all meshes. [`Hits::in_scene`] and results
    /// in device memory use these indices. They may change when a mesh is [replaced](Tracer::commit). Hits of earlier
    /// steps keep the former indices.
    ///
    /// # Errors
    /// [`Error::ForeignMesh`].
    pub fn first_triangle(&self, mesh: MeshId) -> Result<u32> {
        let joined = &self.shared_state().current.joined;
        let index = mesh.within(&joined.meshes)?;
        Ok(joined.numbering.starts[index] as u32)
    }

    /// Returns the statistics of the last finished query; `None` before the first.
    #[must_use]
    pub fn statistics(&self) -> Option<Statistics> {
        self.shared_state().last
    }
}

impl State {
    pub(crate) fn begin(&mut self, time: f64, batch: Batch<'_>) -> Result<()> {
        self.current.begin(time, batch, &mut self.last)
    }

    /// Drops the results of all steps except `step`, which is submitted now, and the step submitted before it.
    pub(crate) fn submitted(&mut self, step: StepId) {
        let before = std::mem::replace(&mut self.submitted, step.0);
        self.keep_from(before);
    }

    /// Drops the results of steps before `oldest`, and former scenes without other results.
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
