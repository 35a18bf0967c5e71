//! The driver's own trees, as the rival to measure against: acceleration structures built or updated
//! each frame, and traced by a ray-tracing pipeline.
//!
//! Positions are interpolated by the same kernel as elsewhere, and the driver's structure is built
//! straight from them. Rays are made by the same arithmetic, and so is the shadow's ray; what a ray
//! hits is the driver's own affair, within what the Vulkan specification allows.
//! Primary and shadow rays go in one launch. Hits are counted by kernels after the last stage's
//! end, so that counting, which the picture does not need, is not charged to the driver.

mod backend_impl;
mod method;
mod pipeline;
mod scene;
mod sets;
mod structure;
mod support;
mod tree;

pub use method::driver_tree_supports;
pub use support::ray_adapters;

#[cfg(test)]
pub(crate) use scene::tests;
pub(crate) use support::{BUFFER_USAGE, EXTENSIONS, RayTracing, able};

use crate::adapters::Options;
use crate::device::{Gpu, Needs};
use crate::frames::Frames;
use crate::instance::Host;
use crate::pipelines::Pipelines;
use crate::selftest;
use crate::snapshots::Snapshots;
use crate::timeline::Moment;
use crate::traces::Traces;
use crate::transfer::{Transfer, Window};
use backend::{Device, Result, Ticket};
use pipeline::RayPipeline;
use scene::RtScene;
use sets::RaySets;
use shaders::{RAY_KERNELS, common};
use std::sync::Arc;

/// What the driver is to prefer when it builds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Prefer {
    /// `PREFER_FAST_BUILD`.
    #[default]
    FastBuild,
    /// `PREFER_FAST_TRACE`.
    FastTrace,
}

impl Prefer {
    /// The backend's name on the command line.
    #[must_use]
    pub fn backend(self) -> &'static str {
        match self {
            Self::FastBuild => "vulkan-rt",
            Self::FastTrace => "vulkan-rt:fast-trace",
        }
    }
}

/// The backend that has the driver make its trees and trace them.
///
/// The driver's work on its trees is timed as `refit`, primary and shadow rays together as `trace_primary`.
pub struct DriverTreeBackend {
    device: Device,
    prefer: Prefer,
    frames: Frames,
    traces: Traces,
    snapshots: Snapshots,
    upload: Transfer,
    readback: Transfer,
    window: Window,
    scene: Option<RtScene>,
    /// Which of the two position buffers is current.
    position: usize,
    /// The copy (by [`Transfer::done`]) that reads what the recording overwrites.
    overwritten: Option<u64>,
    stale: Stale,
    /// Whether the recording has positions at which triangles are to be counted.
    uncounted: bool,
    kernels: Pipelines,
    sets: RaySets,
    rays: RayPipeline,
    gpu: Arc<Gpu>,
}

/// What must run before a trace.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Stale {
    Positions,
    Vertices,
    Tree,
    Fresh,
}

/// What a device opened for [`Needs::RayTracing`] has.
fn rays_of(gpu: &Gpu) -> &RayTracing {
    let rays = gpu.rays.as_ref();
    rays.expect("the device was opened to trace rays")
}

impl DriverTreeBackend {
    /// Opens a device.
    ///
    /// # Errors
    /// [`backend::BackendError::NoDevice`] with what the device lacks, or
    /// [`backend::BackendError::Limit`] with what it lacks for any scene.
    pub fn new(options: &Options, prefer: Prefer) -> Result<Self> {
        let host = Host::new(options.validation)?;
        let gpu = Gpu::open(host, options.adapter.as_deref(), Needs::RayTracing)?;
        let shared = ["arithmetic", "interpolate"].map(common);
        let mut frames = Frames::new(&gpu)?;
        let mut upload = Transfer::new(&gpu, gpu.upload)?;
        let mut readback = Transfer::new(&gpu, gpu.readback)?;
        let mut window = Window::default();
        let kernels = Pipelines::of(&gpu, shared.into_iter().chain(RAY_KERNELS))?;
        let road = (&mut readback, &mut window);
        let found = selftest::run(&gpu, &mut frames, &kernels, road)?;
        let rays = RayPipeline::new(&gpu, &mut upload)?;
        Ok(Self {
            device: Device {
                backend: prefer.backend(),
                adapter: gpu.adapter.name.clone(),
                driver: gpu.adapter.driver.clone(),
                kind: gpu.adapter.kind,
                threads: 0,
                arithmetic: found.arithmetic,
            },
            prefer,
            frames,
            traces: Traces::default(),
            snapshots: Snapshots::default(),
            upload,
            readback,
            window,
            scene: None,
            position: 0,
            overwritten: None,
            stale: Stale::Positions,
            uncounted: false,
            kernels,
            sets: RaySets::new(&gpu, &rays)?,
            rays,
            gpu,
        })
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

    fn scene(&self) -> &RtScene {
        self.scene.as_ref().expect("a scene was loaded")
    }

    fn submit_recording(&mut self) -> Result<Ticket> {
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let (asked, bytes) = (self.snapshots.is_asked(), scene.buffers.position_bytes());
        self.frames.record()?.readback_bytes = if asked { bytes } else { 0 };
        let unread = self.overwritten.map(|value| self.readback.done.at(value));
        let after: Vec<Moment> = unread.into_iter().collect();
        let traced = self.traces.pending.is_some();
        // The kernel that counts sees every triangle, those that are never active too.
        let ticket = self.frames.submit(&after, traced, 0)?;
        self.overwritten = None;
        self.traces.submitted(ticket);
        let ready = (ticket, self.frames.first_part(ticket));
        let positions = &scene.buffers.positions;
        self.snapshots
            .start(&mut self.readback, positions, ready, bytes)?;
        Ok(ticket)
    }

    /// What was recorded never ran, so nothing on the device is up to date.
    fn abandon(&mut self) {
        self.frames.abandon();
        self.snapshots.abandon();
        (self.traces.pending, self.overwritten) = (None, None);
        (self.stale, self.uncounted) = (Stale::Positions, false);
        if let Some(scene) = &mut self.scene {
            scene.tree.forget();
        }
    }
}

impl Drop for DriverTreeBackend {
    fn drop(&mut self) {
        // A lost device has nothing to wait for.
        let _ = self.gpu.wait_idle();
    }
}
