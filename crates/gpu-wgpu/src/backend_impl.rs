//! The seam, carried out.

use crate::adapters::{Options, driver, kind};
use crate::buffers::Window;
use crate::call_counts::CallCounts;
use crate::device::Gpu;
use crate::faults::layer_messages;
use crate::frames::Frames;
use crate::limits::check_trees;
use crate::modules::Modules;
use crate::pipelines::Pipelines;
use crate::queries::Stage;
use crate::scene::SceneBuffers;
use crate::selftest;
use crate::snapshots::Snapshots;
use crate::stages::Also;
use crate::traces::Traces;
use crate::tree::TreeBuffers;
use backend::{
    Backend, Device, DeviceBytes, FrameReport, Generation, Hits, Inspect, Layout, Method, Query,
    QueryKind, Rays, Result, Snapshot, Ticket,
};
use bvh_layout::Topology;
use geom::{Animation, Pose, Ray};
use shaders::work::{self, Progress};
use std::sync::Arc;

/// The backend that computes through wgpu.
///
/// Stages are timed by the device's clock where it has timestamps; where it has
/// none, each stage's time is `None` and `device_ms` is the host's, from the
/// submission to the moment its end was seen.
pub struct WgpuBackend {
    pub(crate) device: Device,
    pub(crate) frames: Frames,
    traces: Traces,
    snapshots: Snapshots,
    pub(crate) window: Window,
    pub(crate) scene: Option<SceneBuffers>,
    pub(crate) tree: Option<TreeBuffers>,
    /// How the scene is traced.
    pub(crate) method: Method,
    /// Which of the two position buffers is current.
    pub(crate) position: usize,
    /// The moment that positions were last interpolated at: `preprocess` reads the key frames of it.
    pub(crate) pose: Pose,
    pub(crate) stale: Stale,
    /// Which parts of the tree in use stand.
    progress: Progress,
    pub(crate) pipelines: Pipelines,
    pub(crate) gpu: Gpu,
    validation: bool,
}

/// What must run before a trace.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Stale {
    Positions,
    Records,
    Boxes,
    Fresh,
}

impl WgpuBackend {
    /// Opens an adapter.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`](backend::BackendError::NoDevice) with the reason, or [`BackendError::Limit`](backend::BackendError::Limit)
    /// with the limit that the adapter does not reach.
    pub fn new(options: &Options) -> Result<Self> {
        let gpu = Gpu::open(options.adapter.as_deref(), options.validation)?;
        Self::over(gpu, options.modules(), options.validation)
    }

    /// Computes on a device that an engine opened, with the features and limits
    /// it has: see [`crate::required_features`], [`crate::useful_features`] and
    /// [`crate::required_limits`]. The engine's error handler and its callback
    /// for a lost device are left alone.
    ///
    /// # Errors
    /// [`BackendError::Limit`](backend::BackendError::Limit) with the limit that the device does not reach,
    /// or [`BackendError::NoDevice`](backend::BackendError::NoDevice) if its arithmetic is wrong.
    pub fn from_device(
        device: wgpu::Device,
        queue: wgpu::Queue,
        info: wgpu::AdapterInfo,
    ) -> Result<Self> {
        Self::over(Gpu::lent(device, queue, info)?, Modules::Best, false)
    }

    fn over(gpu: Gpu, modules: Modules, validation: bool) -> Result<Self> {
        let mut pipelines = Pipelines::new(&gpu, modules)?;
        let mut window = Window::default();
        let found = selftest::run(&gpu, &pipelines, &mut window)?;
        found.check()?;
        pipelines.traits = found.traits(gpu.packets(modules), gpu.rasterization(modules));
        Ok(Self {
            device: Device {
                backend: "wgpu",
                adapter: gpu.info.name.clone(),
                driver: driver(&gpu.info),
                kind: kind(&gpu.info),
                threads: 0,
                arithmetic: found.arithmetic,
            },
            frames: Frames::new(&gpu)?,
            traces: Traces::default(),
            snapshots: Snapshots::default(),
            window,
            scene: None,
            tree: None,
            method: Method::default(),
            position: 0,
            pose: Pose::default(),
            stale: Stale::Positions,
            progress: Progress::default(),
            pipelines,
            gpu,
            validation,
        })
    }

    /// What wgpu refused so far on this device and, if the backend was opened
    /// with validation, what the layer below it called an error.
    ///
    /// wgpu passes on the layer's errors in builds with debug assertions alone,
    /// and for the process as a whole. Where the layer is not installed, it has
    /// nothing to say.
    #[must_use]
    pub fn validation_messages(&self) -> Vec<String> {
        let mut messages = self.gpu.faults.messages();
        if self.validation {
            messages.extend(layer_messages());
        }
        messages
    }

    /// What was asked of wgpu since the backend was opened.
    #[must_use]
    pub fn call_counts(&self) -> CallCounts {
        self.gpu.call_counts.get()
    }

    fn submit_recording(&mut self) -> Result<Ticket> {
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let bytes = scene.animation.vertex_count() as u64 * 12;
        let slot = self.frames.record(&self.gpu)?;
        let encoder = slot.encoder(&self.gpu)?;
        let begun = self
            .snapshots
            .record(&self.gpu, encoder, &scene.positions, bytes)?;
        slot.readback_bytes = begun.as_ref().map_or(0, |_| bytes);
        let ticket = self.frames.submit(&self.gpu, scene.never_active)?;
        self.progress.submitted();
        let traced = self.traces.submitted(ticket);
        self.frames.remember(ticket, traced);
        if let Some(begun) = begun {
            self.snapshots.follow(&self.gpu, begun, ticket)?;
        }
        Ok(ticket)
    }

    /// What was recorded never ran, so nothing on the device is up to date.
    fn abandon(&mut self) {
        self.frames.abandon();
        self.traces.pending = None;
        (self.stale, self.progress) = (Stale::Positions, Progress::default());
    }

    pub(crate) fn scene(&self) -> &SceneBuffers {
        self.scene.as_ref().expect("a scene was loaded")
    }

    pub(crate) fn tree(&self) -> &TreeBuffers {
        self.tree.as_ref().expect("a scene was loaded")
    }
}

impl Backend for WgpuBackend {
    fn device(&self) -> &Device {
        &self.device
    }

    fn load(&mut self, animation: Arc<Animation>, method: Method) -> Result<()> {
        self.pipelines.prepare(&self.gpu, method)?;
        self.frames.forget(&self.gpu)?;
        self.snapshots.forget();
        self.traces = Traces::default();
        (self.scene, self.tree) = (None, None);
        (self.position, self.stale) = (0, Stale::Positions);
        self.progress = Progress::default();
        self.tree = Some(TreeBuffers::new(&self.gpu, &animation, method)?);
        self.scene = Some(SceneBuffers::new(&self.gpu, animation)?);
        self.method = method;
        Ok(())
    }

    fn adopt(&mut self, tree: &Topology, generation: Generation) -> Result<()> {
        assert!(generation > self.tree().generation, "generations rise");
        assert!(
            !self.frames.is_recording(),
            "trees are adopted between submissions"
        );
        let current = self.tree.as_mut().expect("a scene was loaded");
        current.adopt(&self.gpu, tree, generation)?;
        self.progress = Progress::default();
        self.stale = self.stale.min(Stale::Records);
        Ok(())
    }

    fn wants_treelets(&self) -> bool {
        self.method.layout == Layout::Fast
    }

    fn interpolate(&mut self, pose: Pose) -> Result<()> {
        self.position = self.snapshots.free_position(self.position);
        let vertices = self.scene().vertices();
        self.pose = pose;
        let work = [work::interpolate(self.params(), vertices)];
        self.run(Stage::Interpolate, &work, Also::default())?;
        self.stale = Stale::Records;
        Ok(())
    }

    fn preprocess(&mut self) -> Result<()> {
        assert!(self.stale >= Stale::Records, "positions come first");
        assert!(self.tree().generation > Generation(0), "a tree comes first");
        if self.is_made_whole() {
            return Ok(());
        }
        let (work, uncounted) =
            self.progress
                .preprocess(self.method, self.params(), &self.tree().shape);
        self.run(Stage::Preprocess, &work, Also::default())?;
        self.frames.record(&self.gpu)?.extents.uncounted = Some(uncounted);
        self.progress
            .preprocessed(&self.tree.as_ref().expect("a scene was loaded").shape);
        self.stale = Stale::Boxes;
        Ok(())
    }

    fn refit(&mut self) -> Result<()> {
        assert!(self.stale >= Stale::Boxes, "boxes of leaves come first");
        if self.is_made_whole() {
            return Ok(());
        }
        let (work, extent) = self
            .progress
            .refit(self.method, self.params(), &self.tree().shape);
        self.run(Stage::Refit, &work, Also::default())?;
        self.frames.record(&self.gpu)?.extents.refitted(extent);
        self.progress.refitted();
        self.stale = Stale::Fresh;
        Ok(())
    }

    fn check_rebuild(&self) -> Result<()> {
        check_trees(&self.gpu.limits)
    }

    fn rebuild(&mut self, generation: Generation) -> Result<()> {
        assert!(self.stale >= Stale::Records, "positions come first");
        assert!(generation > self.tree().generation, "generations rise");
        self.check_rebuild()?;
        self.stale = self.stale.min(Stale::Records);
        self.make_tree(generation)?;
        self.stale = Stale::Fresh;
        Ok(())
    }

    fn trace(&mut self, query: Query<'_>) -> Result<()> {
        assert!(
            self.stale == Stale::Fresh,
            "a stale tree must not be traced"
        );
        assert!(self.traces.pending.is_none(), "one trace a submission");
        // No kernel seeks any hit of a camera's rays; made here they have the same bits.
        let made: Vec<Ray>;
        let rays = match (query.rays, query.kind) {
            (Rays::Camera(camera), QueryKind::Any) => {
                self.gpu.within("the rays", camera.pixels() as u64 * 32)?;
                made = camera.rays().collect();
                Rays::List(&made)
            }
            (rays, _) => rays,
        };
        let list = match rays {
            Rays::List(list) => Some(list),
            Rays::Camera(_) => None,
        };
        let kind = (query.kind, self.method.intersector);
        let (range, exponent) = self.reach();
        let is_extreme = |ray: &Ray| shaders::is_extreme(ray.origin, range, exponent);
        let trace = self
            .traces
            .make(&self.gpu, rays.count(), kind, list, is_extreme)?;
        self.trace_stages(&Query { rays, ..query }, &trace)?;
        self.traces.pending = Some(trace);
        Ok(())
    }

    fn request_positions(&mut self) -> Result<()> {
        assert!(self.stale >= Stale::Records, "positions come first");
        self.frames.record(&self.gpu)?;
        self.snapshots.ask(self.position);
        Ok(())
    }

    fn submit(&mut self) -> Result<Ticket> {
        let submitted = self.submit_recording();
        if submitted.is_err() {
            self.abandon();
        }
        submitted
    }

    fn wait(&mut self, ticket: Ticket) -> Result<FrameReport> {
        let never_active = self.scene().never_active;
        self.frames.retire(&self.gpu, ticket, never_active)
    }

    fn hits(&mut self, ticket: Ticket, out: &mut Hits) -> Result<()> {
        self.wait(ticket)?;
        let trace = self.traces.get(ticket);
        trace.fetch(&self.gpu, &mut self.window, out)
    }

    fn take_positions(&mut self) -> Result<Option<(Ticket, Snapshot)>> {
        self.gpu.poll()?;
        let vertices = self.scene().animation.vertex_count();
        self.snapshots.take(&self.gpu, vertices)
    }

    /// Of buffers that kernels use: an engine's own on a lent device do not count, nor does memory of the host.
    fn device_bytes(&self) -> Option<DeviceBytes> {
        let held = |part: fn(&TreeBuffers) -> u64| self.tree.as_ref().map_or(0, part);
        Some(DeviceBytes {
            tree: held(TreeBuffers::tree_bytes),
            scratch: held(TreeBuffers::scratch_bytes),
            scene: self.scene.as_ref().map_or(0, SceneBuffers::bytes),
            frames: self.traces.bytes() + self.frames.bytes() + held(TreeBuffers::picture_bytes),
        })
    }

    fn inspect(&mut self) -> &mut dyn Inspect {
        self
    }
}
