//! The Vulkan driver's own trees: acceleration structures that are built or updated for each new pose. A ray-tracing
//! pipeline traces them.
//!
//! The kernel that interpolates our positions writes the vertices. The driver's structure is built directly from that
//! vertex buffer. If vertices may be non-finite, it is built from a copy. Primary and shadow rays are computed with our
//! arithmetic and traced in one launch. The driver decides what they hit, within the Vulkan specification. Kernels
//! count the hits after the trace. Their time belongs to no stage, so the driver's time excludes it.

mod frame;
mod pipeline;
mod scene;
mod support;
mod tree;

pub use support::ray_adapters;

use crate::RivalName;
use backend::{Hits, Result, Ticket};
use geom::Pose;
use gpu_common::{Engine, Options};
use gpu_vulkan::VulkanDevice;
use gpu_vulkan::gpu::Gpu;
use gpu_vulkan::instance::VulkanInstance;
use pipeline::RayPipeline;
use scene::VulkanScene;
use shaders::common;
use support::RayTracing;

/// A device whose driver builds and traces the tree.
pub struct VulkanRt {
    /// Waits for the device when it is dropped. Must be the first field, because fields are dropped in order and the
    /// device may still use the tree and the pipeline.
    engine: Engine<VulkanDevice>,
    name: RivalName,
    scene: Option<VulkanScene>,
    /// The pose of the tree; `None` before the first frame and after a failed one.
    pose: Option<Pose>,
    /// The last frame.
    traced: Option<Ticket>,
    /// Memory for the hits of a frame.
    hits: Hits,
    pipeline: RayPipeline,
}

impl VulkanRt {
    /// Opens a device. With the name [`RivalName::VulkanRtFastTrace`], the driver builds trees for fast rays, otherwise
    /// it builds them fast.
    ///
    /// # Errors
    /// [`backend::BackendError::NoDevice`] with the extension or feature that the device lacks, or
    /// [`backend::BackendError::Limit`] if it is too small for any scene.
    pub fn new(options: &Options, name: RivalName) -> Result<Self> {
        let instance = VulkanInstance::new(options.validation)?;
        let adapters = support::ray_adapters_of(&instance, options.adapter)?;
        let gpu = Gpu::open(instance, &adapters, options, true)?;
        let ray_tracing = RayTracing::of(&gpu)?;
        let device = VulkanDevice::over(&gpu)?;
        let kernels = [
            "arithmetic",
            "interpolate",
            "collapse_non_finite",
            "count_answers",
        ];
        let mut engine = Engine::new(device, kernels.map(common))?;
        engine.info.device.backend = name.name();
        let pipeline = RayPipeline::new(&mut engine.gpu, &ray_tracing)?;
        Ok(Self {
            engine,
            name,
            scene: None,
            pose: None,
            traced: None,
            hits: Hits::default(),
            pipeline,
        })
    }
}
