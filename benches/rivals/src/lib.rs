//! Third-party ray tracers behind one trait, for comparison with abvh.
//!
//! [`RIVALS`] lists them by name. A [`Rival`] keeps its own trees and has its own intersector, so its hits may differ from
//! ours near edges. Callers compare hits and report the share that differs.

#![expect(unsafe_code, reason = "a C library and Vulkan")]

pub mod embree;
#[cfg(feature = "vulkan")]
pub mod vulkan_rt;

use backend::{AdapterInfo, Device, DeviceBytes, FrameReport, Hits, Query, Result, named};
use geom::{Animation, Pose};
use std::fmt;
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
    /// The scene does not fit the device.
    fn load(&mut self, animation: Arc<Animation>, tree_update: TreeUpdate) -> Result<()>;

    /// Moves the vertices and the tree to `pose`, unless they are there already, and traces `query`. Blocks until all is done.
    ///
    /// The report contains the time to build or refit the tree as `refit_ms`, and the time of primary and shadow rays
    /// as `trace_primary_ms`.
    /// Inactive and degenerate triangles are not counted.
    ///
    /// # Errors
    /// The device failed, or the query does not fit it.
    ///
    /// # Panics
    /// Before a scene is loaded.
    fn frame(&mut self, pose: Pose, query: Query<'_>) -> Result<FrameReport>;

    /// Returns the hits of the last frame.
    ///
    /// # Errors
    /// The device failed.
    ///
    /// # Panics
    /// Before a frame was traced.
    fn hits(&mut self) -> Result<&Hits>;

    /// Returns the bytes of device memory that the rival has allocated, if the driver reports it.
    fn device_bytes(&self) -> Option<DeviceBytes> {
        None
    }
}

type List = fn() -> Result<Vec<AdapterInfo>>;
type Open = fn(Option<usize>, usize) -> Result<Box<dyn Rival>>;

/// A rival by its name.
#[derive(Clone, Copy)]
pub struct RivalInfo {
    /// The name on the command line, in tables and in files.
    pub name: &'static str,
    list: List,
    open: Open,
}

/// All rivals.
pub const RIVALS: &[RivalInfo] = &[
    RivalInfo {
        name: "vulkan-rt",
        list: list_vulkan,
        open: |adapter, _| open_vulkan(adapter, false),
    },
    RivalInfo {
        name: "vulkan-rt:fast-trace",
        list: list_vulkan,
        open: |adapter, _| open_vulkan(adapter, true),
    },
    RivalInfo {
        name: embree::NAME,
        list: embree::adapters,
        open: |_, threads| Ok(Box::new(embree::Embree::new(threads)?)),
    },
];

/// Returns the rival with the given name.
#[must_use]
pub fn rival_named(name: &str) -> Option<&'static RivalInfo> {
    RIVALS.iter().find(|rival| rival.name == name)
}

impl RivalInfo {
    /// Lists the devices that the rival can use on this machine.
    ///
    /// # Errors
    /// Why the rival is absent.
    pub fn adapters(&self) -> Result<Vec<AdapterInfo>> {
        (self.list)()
    }

    /// Opens the rival on the adapter of an index, or on the first GPU. A rival on the host uses `threads` threads.
    ///
    /// # Errors
    /// Why the rival is absent.
    pub fn open(&self, adapter: Option<usize>, threads: usize) -> Result<Box<dyn Rival>> {
        (self.open)(adapter, threads)
    }
}

impl fmt::Debug for RivalInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl PartialEq for RivalInfo {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

#[cfg(feature = "vulkan")]
fn list_vulkan() -> Result<Vec<AdapterInfo>> {
    vulkan_rt::ray_adapters()
}

#[cfg(feature = "vulkan")]
fn open_vulkan(adapter: Option<usize>, prefers_fast_trace: bool) -> Result<Box<dyn Rival>> {
    let prefer = if prefers_fast_trace {
        vulkan_rt::Prefer::FastTrace
    } else {
        vulkan_rt::Prefer::FastBuild
    };
    let options = gpu_common::Options {
        adapter,
        ..Default::default()
    };
    Ok(Box::new(vulkan_rt::VulkanRt::new(&options, prefer)?))
}

#[cfg(not(feature = "vulkan"))]
fn list_vulkan() -> Result<Vec<AdapterInfo>> {
    Err(built_without_vulkan())
}

#[cfg(not(feature = "vulkan"))]
fn open_vulkan(_: Option<usize>, _: bool) -> Result<Box<dyn Rival>> {
    Err(built_without_vulkan())
}

#[cfg(not(feature = "vulkan"))]
fn built_without_vulkan() -> backend::BackendError {
    backend::BackendError::NoDevice("this program was built without Vulkan".to_owned())
}
