//! The one place that names backends: what each offers on this machine, how it is opened, and which one is taken if none
//! is named.
//!
//! Each GPU interface is a feature: `vulkan` and `wgpu`.

mod adapters;
mod auto;

pub use adapters::find_adapter;
pub use auto::{Vain, open_best};

use backend::{AdapterInfo, Backend, DeviceKind};
use std::sync::atomic::{AtomicBool, Ordering};

/// Opens the adapter of that index, or the backend's own choice; with host threads, where it uses them.
type Open<'a> = dyn Fn(Option<usize>, usize) -> backend::Result<Box<dyn Backend>> + 'a;

/// What is known of a backend.
pub struct Known<'a> {
    /// Its name on the command line.
    pub name: &'static str,
    /// Why it has its place in the list.
    place: &'static str,
    /// What kinds of devices it may offer.
    pub kinds: &'static [DeviceKind],
    /// The one that finds every GPU which this one could find.
    covered_by: Option<&'static str>,
    list: &'a dyn Fn() -> backend::Result<Vec<AdapterInfo>>,
    open: &'a Open<'a>,
}

/// Where wgpu has but Vulkan to go through.
#[cfg(feature = "wgpu")]
const WGPU_IS_VULKAN: bool = cfg!(not(any(windows, target_vendor = "apple")));

/// All backends. Among backends that offer the same kind of device, [`open_best`] tries them in this order.
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
    },
    CPU,
];

#[cfg(any(feature = "vulkan", feature = "wgpu"))]
const GPUS: &[DeviceKind] = &[DeviceKind::Gpu, DeviceKind::Software];

const CPU: Known<'static> = Known {
    name: "cpu",
    place: "the host is always there",
    kinds: &[DeviceKind::Cpu],
    covered_by: None,
    list: &list_cpu,
    open: &|_, threads| Ok(Box::new(cpu_simd::open(Some(threads))?)),
};

/// The backend of that name.
#[must_use]
pub fn known(name: &str) -> Option<&'static Known<'static>> {
    KNOWN.iter().find(|known| known.name == name)
}

impl Known<'_> {
    /// What it offers on this machine.
    ///
    /// # Errors
    /// Why it cannot run.
    pub fn adapters(&self) -> backend::Result<Vec<AdapterInfo>> {
        (self.list)()
    }

    /// Opens it, on the adapter meant by an index or by part of its name, with so many host threads if it computes on them.
    ///
    /// # Errors
    /// Why it cannot run, or that there is no such adapter, in one line.
    pub fn open(&self, adapter: Option<&str>, threads: usize) -> Result<Box<dyn Backend>, String> {
        let absent = |e| format!("backend {} cannot run: {e}", self.name);
        let index = match adapter {
            None => None,
            Some(asked) => {
                let list = self.adapters().map_err(absent)?;
                Some(find_adapter(self.name, &list, asked)?.index)
            }
        };
        (self.open)(index, threads).map_err(absent)
    }
}

/// Whether compiled kernels are kept in the user's folder for caches.
static KEEPS_KERNELS: AtomicBool = AtomicBool::new(true);

/// Has compiled kernels be neither read from the user's folder for caches nor kept there.
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
