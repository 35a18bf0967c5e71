//! The backend's state: opened, submitted, abandoned.

use crate::adapters::Options;
use crate::device::{Gpu, Needs};
use crate::frames::Frames;
use crate::instance::Host;
use crate::pipelines::Pipelines;
use crate::scene::SceneBuffers;
use crate::selftest;
use crate::snapshots::Snapshots;
use crate::timeline::Moment;
use crate::traces::Traces;
use crate::transfer::{Transfer, Window};
use crate::tree::TreeBuffers;
use backend::{Arithmetic, Device, Method, Result, Ticket};
use geom::Pose;
use shaders::work::Progress;
use std::sync::Arc;

/// The backend that computes through Vulkan.
///
/// Stages are timed by the device's clock; where it has none, each stage's time
/// is `None` and `device_ms` is the host's, from the submission to the moment
/// its end was seen.
pub struct VulkanBackend {
    pub(crate) device: Device,
    pub(crate) frames: Frames,
    pub(crate) traces: Traces,
    pub(crate) snapshots: Snapshots,
    pub(crate) upload: Transfer,
    pub(crate) readback: Transfer,
    pub(crate) window: Window,
    pub(crate) scene: Option<SceneBuffers>,
    pub(crate) tree: Option<TreeBuffers>,
    /// How the scene is traced.
    pub(crate) method: Method,
    /// Which of the two position buffers is current.
    pub(crate) position: usize,
    /// The moment that positions were last interpolated at: `preprocess` reads the key frames of it.
    pub(crate) pose: Pose,
    /// The copy (by [`Transfer::done`]) that reads what the recording overwrites.
    pub(crate) overwritten: Option<u64>,
    pub(crate) stale: Stale,
    /// Which parts of the tree in use stand.
    pub(crate) progress: Progress,
    pub(crate) pipelines: Pipelines,
    pub(crate) gpu: Arc<Gpu>,
}

/// What must run before a trace.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Stale {
    Positions,
    Records,
    Boxes,
    Fresh,
}

impl VulkanBackend {
    /// Opens a device.
    ///
    /// # Errors
    /// [`backend::BackendError::NoDevice`] with the reason, or
    /// [`backend::BackendError::Limit`] with what the device lacks for any scene.
    pub fn new(options: &Options) -> Result<Self> {
        let host = Host::new(options.validation)?;
        let gpu = Gpu::open(host, options.adapter.as_deref(), Needs::Kernels)?;
        let mut made = Self {
            device: Device {
                backend: "vulkan",
                adapter: gpu.adapter.name.clone(),
                driver: gpu.adapter.driver.clone(),
                kind: gpu.adapter.kind,
                threads: 0,
                arithmetic: Arithmetic::IEEE,
            },
            frames: Frames::new(&gpu)?,
            traces: Traces::default(),
            snapshots: Snapshots::default(),
            upload: Transfer::new(&gpu, gpu.upload)?,
            readback: Transfer::new(&gpu, gpu.readback)?,
            window: Window::default(),
            scene: None,
            tree: None,
            method: Method::default(),
            position: 0,
            pose: Pose::default(),
            overwritten: None,
            stale: Stale::Positions,
            progress: Progress::default(),
            pipelines: Pipelines::new(&gpu)?,
            gpu,
        };
        let road = (&mut made.readback, &mut made.window);
        let found = selftest::run(&made.gpu, &mut made.frames, &made.pipelines, road)?;
        found.check()?;
        made.device.arithmetic = found.arithmetic;
        made.pipelines.traits = found.traits(made.gpu.packets(), made.gpu.rasterization());
        Ok(made)
    }

    /// Whether the validation layer watches.
    #[must_use]
    pub fn is_validated(&self) -> bool {
        self.gpu.host.messenger.is_some()
    }

    /// What the validation layer has said so far.
    #[must_use]
    pub fn validation_messages(&self) -> Vec<String> {
        let messenger = self.gpu.host.messenger.as_ref();
        messenger.map_or_else(Vec::new, |messenger| messenger.messages())
    }

    pub(crate) fn scene(&self) -> &SceneBuffers {
        self.scene.as_ref().expect("a scene was loaded")
    }

    pub(crate) fn tree(&self) -> &TreeBuffers {
        self.tree.as_ref().expect("a scene was loaded")
    }

    pub(crate) fn submit_recording(&mut self) -> Result<Ticket> {
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let tree = self.tree.as_mut().expect("a scene was loaded");
        let (asked, bytes) = (self.snapshots.is_asked(), scene.position_bytes());
        self.frames.record()?.readback_bytes = if asked { bytes } else { 0 };
        let arrived = tree.arriving.map(|value| self.upload.done.at(value));
        let unread = self.overwritten.map(|value| self.readback.done.at(value));
        let after: Vec<Moment> = arrived.into_iter().chain(unread).collect();
        let traced = self.traces.pending.is_some();
        let ticket = self.frames.submit(&after, traced, scene.never_active)?;
        self.progress.submitted();
        self.overwritten = None;
        self.traces.submitted(ticket);
        tree.submitted(ticket);
        let ready = (ticket, self.frames.first_part(ticket));
        self.snapshots
            .start(&mut self.readback, &scene.positions, ready, bytes)?;
        Ok(ticket)
    }

    /// What was recorded never ran, so nothing on the device is up to date.
    pub(crate) fn abandon(&mut self) {
        self.frames.abandon();
        self.snapshots.abandon();
        (self.traces.pending, self.overwritten) = (None, None);
        (self.stale, self.progress) = (Stale::Positions, Progress::default());
    }
}

impl Drop for VulkanBackend {
    fn drop(&mut self) {
        // A lost device has nothing to wait for.
        let _ = self.gpu.wait_idle();
    }
}
