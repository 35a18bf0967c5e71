//! What wgpu offers on this machine.

use crate::instance::instance;
use backend::{AdapterInfo, BackendError, DeviceKind, Result};
use wgpu::{Backends, Features};

/// Every adapter that wgpu offers on this machine.
///
/// # Errors
/// [`BackendError::NoDevice`] where there is none.
pub fn adapters() -> Result<Vec<AdapterInfo>> {
    enumerate(&instance(false)).map(|(_, list)| list)
}

/// Every adapter, and what is told of it.
pub(crate) fn enumerate(
    instance: &wgpu::Instance,
) -> Result<(Vec<wgpu::Adapter>, Vec<AdapterInfo>)> {
    let found = pollster::block_on(instance.enumerate_adapters(Backends::all()));
    if found.is_empty() {
        let why = "wgpu finds no Vulkan, Metal or DirectX 12 adapter".to_owned();
        return Err(BackendError::NoDevice(why));
    }
    let list = found.iter().enumerate().map(|(i, a)| describe(i, a));
    let list = list.collect();
    Ok((found, list))
}

fn describe(index: usize, adapter: &wgpu::Adapter) -> AdapterInfo {
    let (info, features) = (adapter.get_info(), adapter.features());
    let timestamps = match features.contains(Features::TIMESTAMP_QUERY) {
        true => "yes",
        false => "no",
    };
    let kernels = match takes_spirv(&info, features) {
        true => "SPIR-V, passed through",
        false => "WGSL",
    };
    let mut limits = vec![("interface", info.backend.to_string())];
    limits.extend(crate::limits::named(&adapter.limits()));
    limits.push(("timestamps", timestamps.to_owned()));
    limits.push(("kernels", kernels.to_owned()));
    AdapterInfo {
        index,
        driver: driver(&info),
        kind: kind(&info),
        limits,
        name: info.name,
    }
}

pub(crate) fn driver(info: &wgpu::AdapterInfo) -> String {
    format!("{} {}", info.driver, info.driver_info)
        .trim()
        .to_owned()
}

pub(crate) fn kind(info: &wgpu::AdapterInfo) -> DeviceKind {
    match info.device_type {
        wgpu::DeviceType::Cpu => DeviceKind::Software,
        _ => DeviceKind::Gpu,
    }
}

/// Metal and DirectX 12 pass shaders through as well, but not SPIR-V.
pub(crate) fn takes_spirv(info: &wgpu::AdapterInfo, features: Features) -> bool {
    info.backend == wgpu::Backend::Vulkan && features.contains(Features::PASSTHROUGH_SHADERS)
}
