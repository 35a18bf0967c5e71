//! Third-party ray tracers behind one trait, for comparison with abvh.
//!
//! [`RivalName`] lists them. A [`Rival`] keeps its own trees and has its own intersector, so its hits may differ from
//! ours near edges. Callers compare hits and report the share that differs.

#![expect(unsafe_code, reason = "a C library and Vulkan")]

pub mod embree;
#[cfg(feature = "vulkan")]
pub mod vulkan_rt;

use backend::{AdapterInfo, Device, DeviceBytes, FrameReport, Hits, Rays, Result, named};
use geom::{Animation, Point, Pose};
use std::sync::Arc;

named! {
    /// How a rival's tree follows the motion.
    pub enum TreeUpdate {
        /// A new tree for every frame.
        Rebuild = "rebuild",
        /// The first tree, refitted.
        Refit = "refit",
    }
}

/// A third-party ray tracer with one scene.
pub trait Rival {
    /// Returns the device, whose `backend` is the rival's name.
    fn device(&self) -> &Device;

    /// Makes `animation` current. Its tree is built in the first frame.
    ///
    /// # Errors
    /// The scene does not fit the device, or the device failed.
    fn load(&mut self, animation: Arc<Animation>, tree_update: TreeUpdate) -> Result<()>;

    /// Moves the vertices and the tree to `pose`, unless they are there already. Then finds the closest hits of `rays`.
    /// With a `light`, also traces a shadow ray from each hit to the light. Blocks until all work has finished.
    ///
    /// The report contains the time to build or refit the tree as `refit_ms`, and the time of primary and shadow rays
    /// as `trace_primary_ms`. The fields `inactive` and `degenerate` of the report stay 0.
    ///
    /// # Errors
    /// The device failed, or the rays do not fit it.
    ///
    /// # Panics
    /// Before a scene is loaded.
    fn frame(&mut self, pose: Pose, rays: Rays<'_>, light: Option<Point>) -> Result<FrameReport>;

    /// Returns the hits of the last frame.
    ///
    /// # Errors
    /// The device failed.
    ///
    /// # Panics
    /// May panic if no frame was traced since the scene was loaded.
    fn hits(&mut self) -> Result<&Hits>;

    /// Returns the bytes of device memory that the rival has allocated, or `None` if the rival has no device memory or
    /// does not count it.
    fn device_bytes(&self) -> Option<DeviceBytes> {
        None
    }

    /// Returns the messages of Vulkan's validation layers in this process.
    fn complaints(&self) -> Vec<String> {
        Vec::new()
    }
}

named! {
    /// A rival, by its name on the command line, in tables and in files.
    pub enum RivalName {
        /// The Vulkan driver's own trees, built fast.
        VulkanRt = "vulkan-rt",
        /// The Vulkan driver's own trees, built for fast rays.
        VulkanRtFastTrace = "vulkan-rt:fast-trace",
        /// Embree 4.
        Embree = "embree",
    }
}

impl RivalName {
    /// Returns the rival with this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|rival| rival.name() == name)
    }

    /// Lists the devices that the rival can use on this machine.
    ///
    /// # Errors
    /// The rival is not available on this machine.
    pub fn adapters(self) -> Result<Vec<AdapterInfo>> {
        match self {
            #[cfg(feature = "vulkan")]
            Self::VulkanRt | Self::VulkanRtFastTrace => vulkan_rt::ray_adapters(),
            #[cfg(not(feature = "vulkan"))]
            Self::VulkanRt | Self::VulkanRtFastTrace => Err(built_without_vulkan()),
            Self::Embree => embree::adapters(),
        }
    }

    /// Opens the rival on the adapter with index `adapter`, by default the first GPU, or the first adapter if there is
    /// no GPU. Embree runs on the host: it ignores `adapter` and uses `threads` threads.
    ///
    /// # Errors
    /// The rival is not available on this machine.
    pub fn open(self, adapter: Option<usize>, threads: usize) -> Result<Box<dyn Rival>> {
        match self {
            Self::VulkanRt | Self::VulkanRtFastTrace => open_vulkan(self, adapter),
            Self::Embree => Ok(Box::new(embree::Embree::new(threads)?)),
        }
    }
}

#[cfg(feature = "vulkan")]
fn open_vulkan(name: RivalName, adapter: Option<usize>) -> Result<Box<dyn Rival>> {
    let options = gpu_common::Options {
        adapter,
        ..Default::default()
    };
    Ok(Box::new(vulkan_rt::VulkanRt::new(&options, name)?))
}

#[cfg(not(feature = "vulkan"))]
fn open_vulkan(_: RivalName, _: Option<usize>) -> Result<Box<dyn Rival>> {
    Err(built_without_vulkan())
}

#[cfg(not(feature = "vulkan"))]
fn built_without_vulkan() -> backend::BackendError {
    backend::BackendError::NoDevice("this program was built without Vulkan".to_owned())
}
