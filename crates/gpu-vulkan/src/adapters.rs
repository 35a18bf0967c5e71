//! The devices that Vulkan offers on this machine.

use crate::instance::VulkanInstance;
use crate::limits::DeviceLimits;
use crate::queues::Queues;
use ash::vk;
use backend::{AdapterInfo, DeviceKind, Result};
use gpu_common::Validation;
use std::ffi::CStr;

/// Returns all devices that Vulkan offers on this machine.
///
/// # Errors
/// [`NoDevice`](backend::BackendError::NoDevice) without a loader, a driver or a device.
pub fn adapters() -> Result<Vec<AdapterInfo>> {
    adapters_of(VulkanInstance::new(Validation::Off)?.as_ref())
}

/// Returns all devices of the instance, in Vulkan's order.
pub fn adapters_of(instance: &VulkanInstance) -> Result<Vec<AdapterInfo>> {
    let devices = instance.physical_devices()?;
    let each = devices.iter().enumerate();
    Ok(each.map(|(i, &d)| describe(instance, i, d)).collect())
}

fn describe(instance: &VulkanInstance, index: usize, device: vk::PhysicalDevice) -> AdapterInfo {
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
    instance.read_properties(device, &mut properties);
    let p = properties.properties;
    let kind = match p.device_type {
        vk::PhysicalDeviceType::CPU => DeviceKind::Software,
        _ => DeviceKind::Gpu,
    };
    let text = |s: std::result::Result<&CStr, _>| {
        s.map_or_else(|_| String::new(), |s| s.to_string_lossy().into_owned())
    };
    let (name, info) = (driver.driver_name_as_c_str(), driver.driver_info_as_c_str());
    let mut limits = DeviceLimits::of(instance, device).displayed_limits();
    if let Ok(queues) = Queues::find(instance, device) {
        limits.extend(queues.displayed_limits());
    }
    AdapterInfo {
        index,
        name: text(p.device_name_as_c_str()),
        driver: format!("{} {}", text(name), text(info)).trim().to_owned(),
        kind,
        limits,
    }
}
