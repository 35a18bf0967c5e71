//! The backends of this build: lists their adapters, opens them, and selects the best one.
//!
//! The command-line program uses this module through the feature `unstable`. It may change with each version.

#![cfg_attr(
    not(feature = "unstable"),
    allow(
        dead_code,
        unreachable_pub,
        unused_imports,
        reason = "only the command-line program uses every item"
    )
)]

mod adapters;
mod selection;

pub use adapters::find_adapter;
pub use selection::{NoBackend, open_best};

use backend::{AdapterInfo, Backend, BackendName, DeviceKind};
#[cfg(feature = "unstable")]
use std::any::Any;
use std::sync::atomic::{AtomicBool, Ordering};

/// Function that opens an adapter by index, or the default adapter. A backend that computes on the host uses the given
/// number of threads.
type Open<'a> = dyn Fn(Option<usize>, usize) -> backend::Result<Box<dyn Backend>> + 'a;

/// A backend that this build includes.
pub struct BackendEntry<'a> {
    /// Name.
    pub name: BackendName,
    /// Reason for its position in the list.
    rank_reason: &'static str,
    /// Kinds of devices that it may have. Empty if `auto` never selects it.
    pub kinds: &'static [DeviceKind],
    list: &'a dyn Fn() -> backend::Result<Vec<AdapterInfo>>,
    open: &'a Open<'a>,
}

/// All backends of this build. [`open_best`] tries backends with the same kind of device in this order.
pub const BACKENDS: &[BackendEntry<'static>] = &[
    #[cfg(feature = "vulkan")]
    BackendEntry {
        name: BackendName::Vulkan,
        rank_reason: "vulkan comes before wgpu: it transfers trees and vertices on separate queues",
        kinds: GPUS,
        list: &gpu_vulkan::adapters,
        open: &|adapter, _| Ok(Box::new(gpu_vulkan::open(&gpu_options(adapter))?)),
    },
    #[cfg(feature = "wgpu")]
    BackendEntry {
        name: BackendName::Wgpu,
        rank_reason: "wgpu is next after vulkan",
        kinds: GPUS,
        list: &gpu_wgpu::adapters,
        open: &|adapter, _| Ok(Box::new(gpu_wgpu::open(&gpu_options(adapter))?)),
    },
    CPU,
    BackendEntry {
        name: BackendName::CpuRef,
        rank_reason: "the reference is slow",
        kinds: &[],
        open: &|_, threads| Ok(Box::new(cpu_ref::CpuBackend::new(Some(threads))?)),
        ..CPU
    },
];

#[cfg(any(feature = "vulkan", feature = "wgpu"))]
const GPUS: &[DeviceKind] = &[DeviceKind::Gpu, DeviceKind::Software];

const CPU: BackendEntry<'static> = BackendEntry {
    name: BackendName::Cpu,
    rank_reason: "the host is always available",
    kinds: &[DeviceKind::Cpu],
    list: &list_cpu,
    open: &|_, threads| Ok(Box::new(cpu_simd::open(Some(threads))?)),
};

/// Returns the backend of that name, if this build includes it.
#[must_use]
pub fn find_backend(name: BackendName) -> Option<&'static BackendEntry<'static>> {
    BACKENDS.iter().find(|entry| entry.name == name)
}

impl BackendEntry<'_> {
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
    /// The backend cannot run, or not exactly one adapter matches. The message is one line.
    pub fn open(&self, adapter: Option<&str>, threads: usize) -> Result<Box<dyn Backend>, String> {
        let absent = |e| format!("backend {} cannot run: {e}", self.name);
        let index = match adapter {
            None => None,
            Some(requested) => {
                let list = self.adapters().map_err(absent)?;
                Some(find_adapter(self.name.name(), &list, requested)?.index)
            }
        };
        (self.open)(index, threads).map_err(absent)
    }
}

/// Opens the reference backend on one thread.
///
/// # Errors
/// A thread cannot be started.
#[cfg(feature = "unstable")]
pub fn open_reference() -> backend::Result<Box<dyn backend::Inspect>> {
    Ok(Box::new(cpu_ref::CpuBackend::new(Some(1))?))
}

/// Returns access to the output of single stages of an open backend, or `None` for a backend that is not one of
/// [`BACKENDS`].
#[cfg(feature = "unstable")]
pub fn inspect(backend: &mut dyn Backend) -> Option<&mut dyn backend::Inspect> {
    fn cast<T: backend::Inspect>(backend: &mut dyn Any) -> Option<&mut dyn backend::Inspect> {
        backend.downcast_mut::<T>().map(|backend| backend as _)
    }
    let backend: &mut dyn Any = backend;
    #[cfg(feature = "vulkan")]
    if backend.is::<gpu_vulkan::VulkanBackend>() {
        return cast::<gpu_vulkan::VulkanBackend>(backend);
    }
    #[cfg(feature = "wgpu")]
    if backend.is::<gpu_wgpu::WgpuBackend>() {
        return cast::<gpu_wgpu::WgpuBackend>(backend);
    }
    cast::<cpu_ref::CpuBackend>(backend)
}

/// Whether compiled kernels are cached in the user's cache folder.
static CACHES_KERNELS: AtomicBool = AtomicBool::new(true);

/// Disables the cache of compiled kernels in the user's cache folder.
pub fn disable_kernel_cache() {
    CACHES_KERNELS.store(false, Ordering::Relaxed);
}

#[cfg(any(feature = "vulkan", feature = "wgpu"))]
fn gpu_options(adapter: Option<usize>) -> gpu_common::Options {
    let folder = dirs::cache_dir().filter(|_| CACHES_KERNELS.load(Ordering::Relaxed));
    gpu_common::Options {
        adapter,
        cache: folder.map(|folder| folder.join("abvh")),
        ..Default::default()
    }
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
