//! The driver's own trees, as the rival to measure against: acceleration structures built or updated
//! each frame, and traced by a ray-tracing pipeline.
//!
//! Positions are interpolated by the same kernel as elsewhere, and the driver's structure is built straight from them.
//! Rays are made by the same arithmetic, and so is the shadow's ray; what a ray hits is the driver's own affair, within
//! what the Vulkan specification allows. Primary and shadow rays go in one launch. Hits are counted by kernels after
//! the last stage's end, so that counting, which the picture does not need, is not charged to the driver.

#![expect(unsafe_code, reason = "Vulkan's calls, each with its reason")]

mod backend_impl;
mod pipeline;
mod scene;
mod support;
mod tree;

pub use support::ray_adapters;

use backend::{BackendError, Method, Result};
use gpu_common::{Engine, Options};
use gpu_vulkan::VulkanDevice;
use gpu_vulkan::gpu::Gpu;
use gpu_vulkan::instance::Host;
use pipeline::RayPipeline;
use scene::DriverScene;
use shaders::{RAY_KERNELS, common};
use support::RayTracing;

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
    engine: Engine<VulkanDevice>,
    prefer: Prefer,
    scene: Option<DriverScene>,
    /// Whether the recording has positions at which triangles are to be counted.
    uncounted: bool,
    rays: RayPipeline,
}

/// Refuses, in the name of `backend`, all but the usual method.
///
/// # Errors
/// [`BackendError::Unsupported`] with the intersector or the layout.
fn check(backend: &'static str, method: Method) -> Result<()> {
    let usual = Method::default();
    let what = if method.intersector != usual.intersector {
        format!("intersector '{}'", method.intersector)
    } else if method.layout != usual.layout {
        format!("layout '{}'", method.layout)
    } else {
        return Ok(());
    };
    Err(BackendError::Unsupported { backend, what })
}

/// Whether the driver's trees can be traced by `method`. Needs no device.
#[must_use]
pub fn supports(method: Method) -> bool {
    check("", method).is_ok()
}

impl DriverTreeBackend {
    /// Opens a device.
    ///
    /// # Errors
    /// [`backend::BackendError::NoDevice`] with what the device lacks, or
    /// [`backend::BackendError::Limit`] with what it lacks for any scene.
    pub fn new(options: &Options, prefer: Prefer) -> Result<Self> {
        let host = Host::new(options.validation)?;
        let able = support::able(&host, options.adapter)?;
        let gpu = Gpu::open(host, &able, options, true)?;
        let rays = RayTracing::of(&gpu)?;
        let device = VulkanDevice::over(&gpu, prefer.backend())?;
        let shared = ["arithmetic", "interpolate"].map(common);
        let mut engine = Engine::new(device, shared.into_iter().chain(RAY_KERNELS))?;
        let rays = RayPipeline::new(&mut engine.gpu, &rays)?;
        Ok(Self {
            engine,
            prefer,
            scene: None,
            uncounted: false,
            rays,
        })
    }
}
