//! The adapters that wgpu offers on this machine.

use backend::{AdapterInfo, BackendError, DeviceKind, Result};
use std::sync::OnceLock;
use wgpu::{Backends, Features, InstanceFlags};

/// Returns all adapters that wgpu offers on this machine.
///
/// # Errors
/// [`BackendError::NoDevice`] if there is no adapter.
pub fn adapters() -> Result<Vec<AdapterInfo>> {
    enumerate(instance(false)).map(|(_, list)| list)
}

/// Returns all adapters with their descriptions.
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
    let has_timestamps = features.contains(Features::TIMESTAMP_QUERY);
    let timestamps = if has_timestamps { "yes" } else { "no" };
    let kernels = if takes_spirv(&info, features) {
        "SPIR-V, passed through"
    } else {
        "WGSL"
    };
    let mut limits = vec![("interface", info.backend.to_string())];
    limits.extend(crate::limits::displayed_limits(&adapter.limits()));
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

/// Returns whether kernels can be passed as SPIR-V. Metal and DirectX 12 also pass shaders through, but not SPIR-V.
pub(crate) fn takes_spirv(info: &wgpu::AdapterInfo, features: Features) -> bool {
    info.backend == wgpu::Backend::Vulkan && features.contains(Features::PASSTHROUGH_SHADERS)
}

/// The instances without and with validation, kept until the process ends. When the last instance is destroyed, the
/// loader unloads the drivers: see `docs/design/drivers.md`.
static INSTANCES: [OnceLock<wgpu::Instance>; 2] = [OnceLock::new(), OnceLock::new()];

/// Returns this process's instance with or without validation.
pub(crate) fn instance(validation: bool) -> &'static wgpu::Instance {
    INSTANCES[usize::from(validation)].get_or_init(|| new_instance(validation))
}

/// Creates an instance without a window. Sets every option whose default depends on the build.
fn new_instance(validation: bool) -> wgpu::Instance {
    let mut desc = wgpu::InstanceDescriptor::new_without_display_handle();
    desc.backends = Backends::VULKAN | Backends::METAL | Backends::DX12;
    desc.flags = InstanceFlags::empty();
    if validation {
        desc.flags = InstanceFlags::VALIDATION | InstanceFlags::DEBUG;
    }
    #[cfg(target_os = "linux")]
    if let Some(instance) = windowless(&desc) {
        return instance;
    }
    wgpu::Instance::new(desc)
}

/// Creates a Vulkan instance without the window system extensions that wgpu enables by default. Returns `None` if
/// Vulkan is not available.
///
/// With Wayland's extension, a layer of Mesa tries to connect to a compositor and prints an error if it finds no
/// compositor.
#[cfg(target_os = "linux")]
#[expect(unsafe_code, reason = "wgpu-hal's constructor of instances is unsafe")]
fn windowless(desc: &wgpu::InstanceDescriptor) -> Option<wgpu::Instance> {
    use wgpu::hal::vulkan::{Api, CreateInstanceCallbackArgs, Instance};
    const WINDOWS: [&std::ffi::CStr; 3] = [
        c"VK_KHR_wayland_surface",
        c"VK_KHR_xcb_surface",
        c"VK_KHR_xlib_surface",
    ];
    let hal = wgpu::hal::InstanceDescriptor {
        name: "abvh",
        flags: desc.flags,
        memory_budget_thresholds: desc.memory_budget_thresholds,
        backend_options: desc.backend_options.clone(),
        telemetry: None,
        display: None,
    };
    let without_windows = |args: CreateInstanceCallbackArgs<'_, '_, '_>| {
        args.extensions.retain(|name| !WINDOWS.contains(name));
    };
    // SAFETY: wgpu-hal uses these three extensions only to create a surface, and checks first that they are enabled.
    let made = unsafe { Instance::init_with_callback(&hal, Some(Box::new(without_windows))) };
    // SAFETY: the instance was created above, and nothing else holds it.
    made.ok()
        .map(|made| unsafe { wgpu::Instance::from_hal::<Api>(made) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instance_is_kept() {
        assert_eq!(instance(false), instance(false));
    }
}
