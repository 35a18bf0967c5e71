//! The list of all backends: lists their adapters, opens them, and selects the best one.
//!
//! Each GPU API is a feature: `vulkan`, `wgpu`, and `vulkan-rt` for the Vulkan driver's own acceleration structures.

mod adapters;
mod auto;

pub use auto::{Vain, open_best};

use backend::{AdapterInfo, Backend, DeviceKind, Method};
use std::sync::atomic::{AtomicBool, Ordering};

/// Opens the adapter of the given index, or the backend's default, with the given number of host threads if it uses
/// them.
type Open<'a> = dyn Fn(Option<usize>, usize) -> backend::Result<Box<dyn Backend>> + 'a;

/// A backend that this build includes.
pub struct Known<'a> {
    /// Name on the command line.
    pub name: &'static str,
    /// Reason for its position in the list.
    place: &'static str,
    /// Kinds of devices that it may have.
    pub kinds: &'static [DeviceKind],
    /// Name of a backend that finds every GPU that this backend finds.
    covered_by: Option<&'static str>,
    /// `true` if it traces through its own trees, such as a driver's acceleration structures.
    pub has_own_trees: bool,
    /// Returns whether it supports a method. Needs no device.
    pub supports: fn(Method) -> bool,
    list: &'a dyn Fn() -> backend::Result<Vec<AdapterInfo>>,
    open: &'a Open<'a>,
}

/// Whether Vulkan is the only API that wgpu uses on this platform.
#[cfg(feature = "wgpu")]
const WGPU_IS_VULKAN: bool = cfg!(not(any(windows, target_vendor = "apple")));

/// All backends of this build. [`open_best`] tries backends with the same kind of device in this order. It skips
/// backends that build their own trees. These may be faster with ray-tracing hardware, so it mentions them in the
/// reason.
pub const KNOWN: &[Known<'static>] = &[
    #[cfg(feature = "vulkan")]
    Known {
        name: "vulkan",
        place: "vulkan comes before wgpu: trees and vertices travel on a queue of their own",
        kinds: GPUS,
        list: &gpu_vulkan::adapters,
        open: &|adapter, _| Ok(Box::new(gpu_vulkan::VulkanBackend::new(&options(adapter))?)),
        ..CPU
    },
    #[cfg(feature = "wgpu")]
    Known {
        name: "wgpu",
        place: "wgpu is next after vulkan",
        kinds: GPUS,
        covered_by: if WGPU_IS_VULKAN { Some("vulkan") } else { None },
        list: &gpu_wgpu::adapters,
        open: &|adapter, _| Ok(Box::new(gpu_wgpu::WgpuBackend::new(&options(adapter))?)),
        ..CPU
    },
    CPU,
    #[cfg(feature = "vulkan-rt")]
    VULKAN_RT,
    #[cfg(feature = "vulkan-rt")]
    Known {
        name: "vulkan-rt:fast-trace",
        open: &|adapter, _| open_vulkan_rt(adapter, gpu_vulkan_rt::Prefer::FastTrace),
        ..VULKAN_RT
    },
];

#[cfg(any(feature = "vulkan", feature = "wgpu"))]
const GPUS: &[DeviceKind] = &[DeviceKind::Gpu, DeviceKind::Software];

const CPU: Known<'static> = Known {
    name: "cpu",
    place: "the host is always there",
    kinds: &[DeviceKind::Cpu],
    covered_by: None,
    has_own_trees: false,
    supports: |_| true,
    list: &list_cpu,
    open: &|_, threads| Ok(Box::new(cpu_simd::open(Some(threads))?)),
};

#[cfg(feature = "vulkan-rt")]
const VULKAN_RT: Known<'static> = Known {
    name: "vulkan-rt",
    place: "it is there to be measured against",
    kinds: GPUS,
    has_own_trees: true,
    supports: gpu_vulkan_rt::supports,
    list: &gpu_vulkan_rt::ray_adapters,
    open: &|adapter, _| open_vulkan_rt(adapter, gpu_vulkan_rt::Prefer::FastBuild),
    ..CPU
};

/// Returns the backend of name `name`.
#[must_use]
pub fn known(name: &str) -> Option<&'static Known<'static>> {
    KNOWN.iter().find(|known| known.name == name)
}

impl Known<'_> {
    /// Lists its adapters on this machine.
    ///
    /// # Errors
    /// The reason why it cannot run.
    pub fn adapters(&self) -> backend::Result<Vec<AdapterInfo>> {
        (self.list)()
    }

    /// Opens the backend on an adapter, given by index or part of its name, or on the default. Backends that compute on
    /// the host use `threads` threads.
    ///
    /// # Errors
    /// In one line, the reason why it cannot run, or that no adapter matches or several do.
    pub fn open(&self, adapter: Option<&str>, threads: usize) -> Result<Box<dyn Backend>, String> {
        let absent = |e| format!("backend {} cannot run: {e}", self.name);
        let index = match adapter {
            None => None,
            Some(asked) => {
                let list = self.adapters().map_err(absent)?;
                Some(adapters::find_one(self.name, &list, asked)?.index)
            }
        };
        (self.open)(index, threads).map_err(absent)
    }
}

/// Whether compiled kernels are cached in the user's cache folder.
static KEEPS_KERNELS: AtomicBool = AtomicBool::new(true);

/// Disables the cache of compiled kernels in the user's cache folder.
pub fn keep_no_kernels() {
    KEEPS_KERNELS.store(false, Ordering::Relaxed);
}

#[cfg(any(feature = "vulkan", feature = "wgpu"))]
fn options(adapter: Option<usize>) -> gpu_common::Options {
    let folder = dirs::cache_dir().filter(|_| KEEPS_KERNELS.load(Ordering::Relaxed));
    gpu_common::Options {
        adapter,
        cache: folder.map(|folder| folder.join("abvh")),
        ..Default::default()
    }
}

#[cfg(feature = "vulkan-rt")]
fn open_vulkan_rt(
    adapter: Option<usize>,
    prefer: gpu_vulkan_rt::Prefer,
) -> backend::Result<Box<dyn Backend>> {
    let options = options(adapter);
    Ok(Box::new(gpu_vulkan_rt::DriverTreeBackend::new(
        &options, prefer,
    )?))
}

fn list_cpu() -> backend::Result<Vec<AdapterInfo>> {
    let device = cpu_simd::open(Some(1))?.device().clone();
    Ok(vec![AdapterInfo {
        index: 0,
        name: device.adapter,
        driver: device.driver,
        kind: device.kind,
        limits: vec![("threads", host::cores().to_string())],
    }])
}
