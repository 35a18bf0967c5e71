//! What Vulkan offers on this machine, and which of it to take.

use crate::instance::Host;
use crate::limits::Limits;
use crate::queues::Queues;
use crate::validation::Validation;
use ash::vk;
use backend::{BackendError, DeviceKind, Result};
use std::ffi::CStr;

/// How to open the backend.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// An adapter's index or a part of its name; the first GPU, else the first adapter, if not given.
    pub adapter: Option<String>,
    /// Whether to run under the validation layer.
    pub validation: Validation,
}

/// A device that Vulkan offers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Adapter {
    /// Its place in Vulkan's list.
    pub index: usize,
    /// The device's own name.
    pub name: String,
    /// Driver and version.
    pub driver: String,
    /// What kind of machine it is.
    pub kind: DeviceKind,
    /// Bytes that one storage buffer may span.
    pub max_buffer_bytes: u64,
    /// What else bounds or shapes the work here: names and values, to be shown.
    pub limits: Vec<(&'static str, String)>,
}

/// Every device that Vulkan offers on this machine.
///
/// # Errors
/// [`BackendError::NoDevice`] where there is no loader or no driver.
pub fn adapters() -> Result<Vec<Adapter>> {
    all(Host::new(Validation::Off)?.as_ref())
}

/// Every device of the instance, in Vulkan's order.
pub(crate) fn all(host: &Host) -> Result<Vec<Adapter>> {
    let devices = host.physical_devices()?;
    let each = devices.iter().enumerate();
    Ok(each.map(|(i, &d)| describe(host, i, d)).collect())
}

fn describe(host: &Host, index: usize, device: vk::PhysicalDevice) -> Adapter {
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
    // SAFETY: the device belongs to the instance, which is alive.
    unsafe {
        host.instance
            .get_physical_device_properties2(device, &mut properties)
    };
    let p = properties.properties;
    let kind = match p.device_type {
        vk::PhysicalDeviceType::CPU => DeviceKind::Software,
        _ => DeviceKind::Gpu,
    };
    let text = |s: std::result::Result<&CStr, _>| {
        s.map_or_else(|_| String::new(), |s| s.to_string_lossy().into_owned())
    };
    let (name, info) = (driver.driver_name_as_c_str(), driver.driver_info_as_c_str());
    let bounds = Limits::of(host, device);
    let mut limits = bounds.named();
    if let Ok(queues) = Queues::find(host, device) {
        limits.extend(queues.named());
    }
    Adapter {
        index,
        name: text(p.device_name_as_c_str()),
        driver: format!("{} {}", text(name), text(info)).trim().to_owned(),
        kind,
        max_buffer_bytes: bounds.buffer_bytes(),
        limits,
    }
}

/// The adapter asked for by index or part of its name; else the first GPU, else the first of all.
pub(crate) fn choose(list: &[Adapter], wanted: Option<&str>) -> Result<usize> {
    let Some(wanted) = wanted else {
        let gpu = list.iter().position(|a| a.kind == DeviceKind::Gpu);
        return Ok(gpu.unwrap_or(0));
    };
    let by_index = wanted.parse::<usize>().ok().filter(|&i| i < list.len());
    let lower = wanted.to_lowercase();
    let named = |a: &Adapter| a.name.to_lowercase().contains(&lower);
    by_index
        .or_else(|| list.iter().position(named))
        .ok_or_else(|| {
            let names: Vec<_> = list
                .iter()
                .map(|a| format!("{} {}", a.index, a.name))
                .collect();
            BackendError::NoDevice(format!("no adapter '{wanted}' among: {}", names.join(", ")))
        })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    fn adapter(index: usize, name: &str, kind: DeviceKind) -> Adapter {
        Adapter {
            index,
            name: name.to_owned(),
            driver: String::new(),
            kind,
            max_buffer_bytes: 0,
            limits: Vec::new(),
        }
    }

    pub(crate) fn an_adapter_is_chosen_by_index_by_part_of_its_name_or_for_being_a_gpu() {
        let list = [
            adapter(0, "llvmpipe", DeviceKind::Software),
            adapter(1, "Fast Card", DeviceKind::Gpu),
        ];
        assert_eq!(choose(&list, None), Ok(1));
        assert_eq!(choose(&list[..1], None), Ok(0));
        assert_eq!(choose(&list, Some("0")), Ok(0));
        assert_eq!(choose(&list, Some("fast")), Ok(1));
        let refused = choose(&list, Some("9")).unwrap_err().to_string();
        assert!(refused.contains("0 llvmpipe, 1 Fast Card"), "{refused}");
    }
}
