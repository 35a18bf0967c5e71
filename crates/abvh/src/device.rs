//! Where the work is done.

use crate::Result;
use backend::Backend;
use std::num::NonZero;

/// A device that traces.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Device {
    /// A GPU through Vulkan, else one through wgpu, else the host. Never a driver that runs shaders on the host's cores.
    #[default]
    Auto,
    /// The host's cores.
    Cpu,
    /// Compute shaders through Vulkan: the driver's own choice, or the adapter of that index or part of its name.
    #[cfg(feature = "vulkan")]
    Vulkan(Option<String>),
    /// Compute shaders through wgpu; likewise.
    #[cfg(feature = "wgpu")]
    Wgpu(Option<String>),
}

/// Logical cores this process may use.
pub(crate) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZero::get)
}

impl Device {
    /// Opens it, with so many threads where it is the host.
    pub(crate) fn open(&self, threads: usize) -> Result<Box<dyn Backend>> {
        match self {
            Self::Auto => match Self::gpu() {
                Some(gpu) => gpu.open(threads).or_else(|_| Self::Cpu.open(threads)),
                None => Self::Cpu.open(threads),
            },
            Self::Cpu => Ok(Box::new(cpu_simd::open(Some(threads))?)),
            #[cfg(feature = "vulkan")]
            Self::Vulkan(adapter) => open_vulkan(adapter.clone()),
            #[cfg(feature = "wgpu")]
            Self::Wgpu(adapter) => open_wgpu(adapter.clone()),
        }
    }

    /// The GPU that is taken unasked.
    #[cfg(any(feature = "vulkan", feature = "wgpu"))]
    fn gpu() -> Option<Self> {
        type List = fn() -> backend::Result<Vec<gpu_common::AdapterInfo>>;
        type Named = fn(Option<String>) -> Device;
        let all: [(List, Named); _] = [
            #[cfg(feature = "vulkan")]
            (gpu_vulkan::adapters, Self::Vulkan),
            #[cfg(feature = "wgpu")]
            (gpu_wgpu::adapters, Self::Wgpu),
        ];
        all.into_iter().find_map(|(list, device)| {
            let mut adapters = list().ok()?.into_iter();
            let found = adapters.find(|a| a.kind == backend::DeviceKind::Gpu)?;
            Some(device(Some(found.index.to_string())))
        })
    }

    #[cfg(not(any(feature = "vulkan", feature = "wgpu")))]
    fn gpu() -> Option<Self> {
        None
    }
}

/// Where compiled kernels are kept between runs.
#[cfg(any(feature = "vulkan", feature = "wgpu"))]
fn cache() -> Option<std::path::PathBuf> {
    dirs::cache_dir().map(|folder| folder.join("abvh"))
}

#[cfg(feature = "vulkan")]
fn open_vulkan(adapter: Option<String>) -> Result<Box<dyn Backend>> {
    let options = gpu_vulkan::Options {
        adapter,
        cache: cache(),
        ..Default::default()
    };
    let opened = gpu_vulkan::VulkanBackend::new(&options);
    Ok(Box::new(opened.map_err(|e| named("vulkan", &e))?))
}

#[cfg(feature = "wgpu")]
fn open_wgpu(adapter: Option<String>) -> Result<Box<dyn Backend>> {
    let options = gpu_wgpu::Options {
        adapter,
        cache: cache(),
        ..Default::default()
    };
    let opened = gpu_wgpu::WgpuBackend::new(&options);
    Ok(Box::new(opened.map_err(|e| named("wgpu", &e))?))
}

#[cfg(any(feature = "vulkan", feature = "wgpu"))]
fn named(device: &str, why: &backend::BackendError) -> crate::Error {
    crate::Error::NoDevice(format!("device {device} cannot run: {why}"))
}
