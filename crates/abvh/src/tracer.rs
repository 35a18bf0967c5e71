//! The tracer: a scene on a device, with the trees that follow its motion.

use crate::builder::{TracerBuilder, device_name};
use crate::loaded::ResidentScene;
use crate::query::{QueryId, StepId};
use crate::state::TracerState;
use crate::step::{Step, clamp_time};
use crate::{Hits, MeshId, Result, Scene, Statistics};
use backend::Backend;
use geom::lock;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

/// Number of tracers created so far.
static TRACERS: AtomicU64 = AtomicU64::new(0);

/// A scene that rays are traced through.
///
/// Steps need exclusive access. Results are read through a shared reference, by one thread at a time.
pub struct Tracer {
    device: String,
    /// Steps have exclusive access and do not lock it.
    state: Mutex<TracerState>,
}

impl Tracer {
    /// Returns a builder with default options.
    #[must_use]
    pub fn builder() -> TracerBuilder {
        TracerBuilder::new()
    }

    /// Returns the name of the device, such as `cpu (host (x86_64))`.
    #[must_use]
    pub fn device(&self) -> &str {
        &self.device
    }

    pub(crate) fn state(&mut self) -> &mut TracerState {
        self.state.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    /// Locks the state, to read results.
    pub(crate) fn shared_state(&self) -> MutexGuard<'_, TracerState> {
        lock(&self.state)
    }

    /// Builds the first tree, for `time`, and compiles the kernels for lists of rays with
    /// [`Query::Closest`](crate::Query::Closest). A first step with such queries waits for neither. Other kernels are
    /// compiled when a step first needs them. Does nothing if there is a tree.
    ///
    /// # Errors
    /// As for [`Step::trace`].
    pub fn warm_up(&mut self, time: f64) -> Result<()> {
        let current = &mut self.state().current;
        if current.has_tree() {
            Ok(())
        } else {
            current.warm_up(clamp_time(time), &[])
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
            time: clamp_time(time),
            queries: 0,
            deferred: Vec::new(),
            is_submitted: false,
        }
    }

    /// Waits for a query and returns its results without a copy. They remain valid while further steps are prepared. A
    /// result can be read any number of times until two more steps are submitted.
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
    /// [`Error::NoResult`](crate::Error::NoResult) if the query belongs to another step or tracer, or its result was
    /// dropped. [`Error::Misuse`](crate::Error::Misuse) if this step or an earlier one was encoded and its commands are
    /// not submitted or were rejected, or if `RayBuffers::results` lacks the usage `COPY_SRC`.
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory). [`Error::DeviceLost`](crate::Error::DeviceLost).
    /// [`Error::Device`](crate::Error::Device).
    pub fn hits(&self, step: StepId, query: QueryId) -> Result<Hits> {
        let mut state = self.shared_state();
        let (loaded, index) = state.find(step, query)?;
        loaded.hits(index)
    }

    /// Returns whether a query is done, so that [`Tracer::hits`] would not wait for it. Never blocks. Also returns
    /// `false` while another thread reads a result of this tracer. With wgpu, `hits` copies the results after all work
    /// in the queue, so it still waits for work that was submitted later.
    ///
    /// # Errors
    /// As for [`Tracer::hits`].
    pub fn is_done(&self, step: StepId, query: QueryId) -> Result<bool> {
        let mut state = match self.state.try_lock() {
            Ok(state) => state,
            Err(TryLockError::Poisoned(e)) => e.into_inner(),
            Err(TryLockError::WouldBlock) => return Ok(false),
        };
        let (loaded, index) = state.find(step, query)?;
        loaded.is_done(index)
    }

    /// Returns the index of a mesh's first triangle among the triangles of all meshes. The closest hits of
    /// [`Hits::in_scene`] and results in device memory use these indices. They may change when a mesh is
    /// [replaced](Tracer::commit). Hits of earlier steps keep the former indices.
    ///
    /// # Errors
    /// [`Error::ForeignMesh`](crate::Error::ForeignMesh).
    pub fn first_triangle(&self, mesh: MeshId) -> Result<u32> {
        let joined = &self.shared_state().current.joined;
        let index = mesh.within(&joined.meshes)?;
        Ok(joined.numbering.starts[index] as u32)
    }

    /// Returns the statistics of the last finished query; `None` before the first.
    #[must_use]
    pub fn statistics(&self) -> Option<Statistics> {
        self.shared_state().statistics()
    }
}

impl TracerBuilder {
    /// Opens the device and loads the scene.
    ///
    /// # Errors
    /// [`Error::NoDevice`](crate::Error::NoDevice). [`Error::Mesh`](crate::Error::Mesh) if all meshes together have too
    /// many vertices or triangles. [`Error::Unsupported`](crate::Error::Unsupported) if the scene exceeds the device's
    /// limits, threads cannot be started, or more than 4096 are requested.
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory), also if the system is known to have too little memory for the
    /// scene's trees (about 345 bytes per triangle). [`Error::DeviceLost`](crate::Error::DeviceLost).
    /// [`Error::Device`](crate::Error::Device).
    pub fn build(self, scene: Scene) -> Result<Tracer> {
        let threads = self.host_threads(self.policy(&scene.meshes))?;
        let backend = self.device.open(threads)?;
        self.load(backend, scene)
    }

    /// Loads the scene on the device of another tracer, whose kernels remain compiled. Ignores
    /// [`TracerBuilder::device`]. If the host traces, the number of threads that trace does not change.
    ///
    /// # Errors
    /// [`Error::Misuse`](crate::Error::Misuse) if a step of `former` was encoded and its commands are not submitted.
    /// The errors of [`TracerBuilder::build`].
    pub fn build_in_place_of(self, former: Tracer, scene: Scene) -> Result<Tracer> {
        let former = former.state.into_inner();
        let former = former.unwrap_or_else(PoisonError::into_inner);
        self.load(former.current.driver.into_backend(), scene)
    }

    /// Loads the scene on an open backend.
    ///
    /// # Errors
    /// Those of [`TracerBuilder::build`], except [`Error::NoDevice`](crate::Error::NoDevice).
    #[cfg(feature = "unstable")]
    pub fn build_on(self, backend: Box<dyn Backend>, scene: Scene) -> Result<Tracer> {
        self.load(backend, scene)
    }

    fn load(self, backend: Box<dyn Backend>, scene: Scene) -> Result<Tracer> {
        let update = self.policy(&scene.meshes);
        let (device, kind) = (device_name(backend.as_ref()), backend.device().kind);
        let builder_threads = self.start_builder_threads(kind, update)?;
        let options = self.options(update);
        // Each tracer has 2^40 step numbers of its own, so no two tracers have a step number in common.
        let steps = TRACERS.fetch_add(1, Ordering::Relaxed) << 40;
        let state = TracerState {
            current: ResidentScene::new(scene.meshes, backend, options, builder_threads)?,
            former: Vec::new(),
            tracer_builder: self,
            commits: 0,
            replaced: BTreeMap::new(),
            kind,
            steps,
            submitted: steps,
            disposal: Arc::default(),
        };
        Ok(Tracer {
            device,
            state: Mutex::new(state),
        })
    }
}

impl fmt::Debug for Tracer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Tracer on {}", self.device)
    }
}
