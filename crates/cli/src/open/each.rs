//! Each backend's own ways: how its adapters are listed and opened.

use crate::adapters::{Adapter, Limit};
use crate::threads;
use backend::Backend;
use gpu_vulkan::VulkanBackend;
use gpu_vulkan_rt::{DriverTreeBackend, Prefer};
use gpu_wgpu::WgpuBackend;

pub(super) fn list_vulkan() -> backend::Result<Vec<Adapter>> {
    Ok(gpu_vulkan::adapters()?.into_iter().map(shown).collect())
}

pub(super) fn list_vulkan_rt() -> backend::Result<Vec<Adapter>> {
    let able = gpu_vulkan_rt::ray_adapters()?;
    Ok(able.into_iter().map(shown).collect())
}

fn shown(adapter: gpu_vulkan::AdapterInfo) -> Adapter {
    Adapter {
        index: adapter.index,
        limits: limits(adapter.limits),
        name: adapter.name,
        driver: adapter.driver.trim().to_owned(),
        kind: adapter.kind,
    }
}

pub(super) fn open_vulkan(adapter: Option<&Adapter>) -> backend::Result<Box<dyn Backend>> {
    let options = gpu_vulkan::Options {
        adapter: adapter.map(|a| a.index.to_string()),
        cache: super::cache_folder(),
        ..Default::default()
    };
    Ok(Box::new(VulkanBackend::new(&options)?))
}

pub(super) fn open_vulkan_rt(
    adapter: Option<&Adapter>,
    prefer: Prefer,
) -> backend::Result<Box<dyn Backend>> {
    let options = gpu_vulkan::Options {
        adapter: adapter.map(|a| a.index.to_string()),
        cache: super::cache_folder(),
        ..Default::default()
    };
    Ok(Box::new(DriverTreeBackend::new(&options, prefer)?))
}

pub(super) fn list_wgpu() -> backend::Result<Vec<Adapter>> {
    Ok(gpu_wgpu::adapters()?.into_iter().map(shown).collect())
}

/// `force_wgsl` has wgpu translate the kernels even where it need not.
pub(super) fn open_wgpu(
    adapter: Option<&Adapter>,
    force_wgsl: bool,
) -> backend::Result<Box<dyn Backend>> {
    let options = gpu_wgpu::Options {
        adapter: adapter.map(|a| a.index.to_string()),
        cache: super::cache_folder(),
        force_wgsl,
        ..Default::default()
    };
    Ok(Box::new(WgpuBackend::new(&options)?))
}

pub(super) fn list_cpu() -> backend::Result<Vec<Adapter>> {
    let device = cpu_simd::open(Some(1))?.device().clone();
    Ok(vec![Adapter {
        index: 0,
        name: device.adapter,
        driver: device.driver,
        kind: device.kind,
        limits: limits(vec![("threads", threads::cores().to_string())]),
    }])
}

pub(super) fn open_cpu(threads: usize) -> backend::Result<Box<dyn Backend>> {
    Ok(Box::new(cpu_simd::open(Some(threads))?))
}

fn limits(pairs: Vec<(&'static str, String)>) -> Vec<Limit> {
    let limit = |(name, value)| Limit { name, value };
    pairs.into_iter().map(limit).collect()
}
