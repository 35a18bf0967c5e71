//! What wgpu offers on this machine, and which of it to take.

use crate::instance::instance;
use crate::modules::Modules;
use backend::{BackendError, DeviceKind, Result};
use std::path::PathBuf;
use wgpu::{Backends, Features};

/// How to open the backend.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// An adapter's index or a part of its name; the first GPU, else the first adapter, if not given.
    pub adapter: Option<String>,
    /// Folder in which compiled kernels are kept for runs to come, where the adapter can; nothing is kept without one.
    pub cache: Option<PathBuf>,
    /// Runs under the graphics interface's own validation layer where it is
    /// installed. See [`crate::WgpuDevice::validation_messages`].
    pub validation: bool,
    /// Has wgpu add bounds and loop checks to the kernels; implies WGSL.
    pub checked: bool,
    /// Takes the kernels' WGSL even where the adapter would take their SPIR-V.
    pub force_wgsl: bool,
}

impl Options {
    pub(crate) fn modules(&self) -> Modules {
        match (self.checked, self.force_wgsl) {
            (true, _) => Modules::CheckedWgsl,
            (false, true) => Modules::TrustedWgsl,
            (false, false) => Modules::Best,
        }
    }
}

/// An adapter that wgpu offers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Adapter {
    /// Its place in wgpu's list.
    pub index: usize,
    /// The adapter's own name.
    pub name: String,
    /// Driver and version.
    pub driver: String,
    /// The graphics interface behind it, such as `Vulkan`.
    pub api: String,
    /// What kind of machine it is.
    pub kind: DeviceKind,
    /// Bytes that one storage buffer may span.
    pub max_buffer_bytes: u64,
    /// Storage buffers that one kernel may have.
    pub max_storage_buffers: u32,
    /// Whether stages can be timed by the device's clock.
    pub has_timestamps: bool,
    /// Whether the kernels' SPIR-V goes in as it is.
    pub takes_spirv: bool,
    /// What bounds the work here and which features are used: names and values, to be shown.
    pub limits: Vec<(&'static str, String)>,
}

/// Every adapter that wgpu offers on this machine.
///
/// # Errors
/// [`BackendError::NoDevice`] where there is none.
pub fn adapters() -> Result<Vec<Adapter>> {
    let found = enumerate(&instance(false))?;
    Ok(found
        .iter()
        .enumerate()
        .map(|(i, a)| describe(i, a))
        .collect())
}

pub(crate) fn enumerate(instance: &wgpu::Instance) -> Result<Vec<wgpu::Adapter>> {
    let found = pollster::block_on(instance.enumerate_adapters(Backends::all()));
    if found.is_empty() {
        let why = "wgpu finds no Vulkan, Metal or DirectX 12 adapter".to_owned();
        return Err(BackendError::NoDevice(why));
    }
    Ok(found)
}

pub(crate) fn describe(index: usize, adapter: &wgpu::Adapter) -> Adapter {
    let info = adapter.get_info();
    let (limits, features) = (adapter.limits(), adapter.features());
    Adapter {
        index,
        driver: driver(&info),
        api: info.backend.to_string(),
        kind: kind(&info),
        max_buffer_bytes: crate::limits::span(&limits),
        max_storage_buffers: limits.max_storage_buffers_per_shader_stage,
        has_timestamps: features.contains(Features::TIMESTAMP_QUERY),
        takes_spirv: takes_spirv(&info, features),
        limits: named(&info, &limits, features),
        name: info.name,
    }
}

fn named(
    info: &wgpu::AdapterInfo,
    limits: &wgpu::Limits,
    features: Features,
) -> Vec<(&'static str, String)> {
    let mut all = vec![("interface", info.backend.to_string())];
    all.extend(crate::limits::named(limits));
    let timestamps = match features.contains(Features::TIMESTAMP_QUERY) {
        true => "yes",
        false => "no",
    };
    let kernels = match takes_spirv(info, features) {
        true => "SPIR-V, passed through",
        false => "WGSL",
    };
    all.push(("timestamps", timestamps.to_owned()));
    all.push(("kernels", kernels.to_owned()));
    all
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
