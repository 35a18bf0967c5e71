//! The loader, the instance, its adapters and the validation layer's messages.

use ash::{Entry, Instance, ext, vk};
use backend::{BackendError, DeviceKind, Result};
use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex, PoisonError};

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
}

/// Every device that Vulkan offers on this machine.
///
/// # Errors
/// [`BackendError::NoDevice`] where there is no loader or no driver.
pub fn adapters() -> Result<Vec<Adapter>> {
    let host = Host::new(false)?;
    let devices = host.physical_devices()?;
    Ok(devices
        .iter()
        .enumerate()
        .map(|(i, &d)| host.describe(i, d))
        .collect())
}

/// What the validation layer said.
pub(crate) type Messages = Arc<Mutex<Vec<String>>>;

/// An instance and, if asked for, the ear for its validation layer.
pub(crate) struct Host {
    pub(crate) instance: Instance,
    /// Keeps the loader's library open.
    _entry: Entry,
    ear: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    pub(crate) messages: Messages,
}

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

impl Host {
    pub(crate) fn new(validation: bool) -> Result<Self> {
        // SAFETY: the loader is the system's own; its library stays open as long as `Host` lives.
        let entry = unsafe { Entry::load() }
            .map_err(|e| BackendError::NoDevice(format!("no Vulkan loader: {e}")))?;
        let app = vk::ApplicationInfo::default()
            .application_name(c"abvh")
            .api_version(vk::API_VERSION_1_2);
        let layers = [VALIDATION.as_ptr()];
        let extensions = [
            ext::debug_utils::NAME.as_ptr(),
            ext::validation_features::NAME.as_ptr(),
        ];
        let enables = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features =
            vk::ValidationFeaturesEXT::default().enabled_validation_features(&enables);
        let mut info = vk::InstanceCreateInfo::default().application_info(&app);
        if validation {
            info = info
                .enabled_layer_names(&layers)
                .enabled_extension_names(&extensions)
                .push_next(&mut features);
        }
        // SAFETY: every pointer in `info` outlives the call.
        let instance = unsafe { entry.create_instance(&info, None) }.map_err(|e| {
            let layer = if validation {
                " with the validation layer"
            } else {
                ""
            };
            BackendError::NoDevice(format!("no Vulkan instance{layer}: {e}"))
        })?;
        let messages = Messages::default();
        let ear = validation
            .then(|| listen(&entry, &instance, &messages))
            .transpose()?;
        Ok(Self {
            instance,
            _entry: entry,
            ear,
            messages,
        })
    }

    pub(crate) fn physical_devices(&self) -> Result<Vec<vk::PhysicalDevice>> {
        // SAFETY: the instance is alive.
        let devices = unsafe { self.instance.enumerate_physical_devices() }
            .map_err(|e| BackendError::NoDevice(format!("Vulkan lists no devices: {e}")))?;
        if devices.is_empty() {
            return Err(BackendError::NoDevice("Vulkan has no driver here".into()));
        }
        Ok(devices)
    }

    pub(crate) fn describe(&self, index: usize, device: vk::PhysicalDevice) -> Adapter {
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
        // SAFETY: the device belongs to the instance, which is alive.
        unsafe {
            self.instance
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
        Adapter {
            index,
            name: text(p.device_name_as_c_str()),
            driver: format!(
                "{} {}",
                text(driver.driver_name_as_c_str()),
                text(driver.driver_info_as_c_str())
            ),
            kind,
            max_buffer_bytes: u64::from(p.limits.max_storage_buffer_range),
        }
    }
}

fn listen(
    entry: &Entry,
    instance: &Instance,
    messages: &Messages,
) -> Result<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)> {
    let utils = ext::debug_utils::Instance::new(entry, instance);
    let severity = vk::DebugUtilsMessageSeverityFlagsEXT::ERROR
        | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING;
    let kind = vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
        | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE;
    let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(severity)
        .message_type(kind)
        .pfn_user_callback(Some(hear))
        .user_data(Arc::as_ptr(messages).cast_mut().cast());
    // SAFETY: `messages` lives in `Host` until the messenger is destroyed.
    let messenger = unsafe { utils.create_debug_utils_messenger(&info, None) }
        .map_err(|e| BackendError::NoDevice(format!("no debug messenger: {e}")))?;
    Ok((utils, messenger))
}

/// Called by the validation layer for each message.
unsafe extern "system" fn hear(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: `user` is the `Messages` given to `listen`, which outlives the messenger.
    let messages = unsafe { &*user.cast::<Mutex<Vec<String>>>() };
    // SAFETY: the layer passes valid data for the time of the call.
    let text = unsafe { (*data).message_as_c_str() };
    if let Some(text) = text {
        let mut messages = messages.lock().unwrap_or_else(PoisonError::into_inner);
        messages.push(text.to_string_lossy().into_owned());
    }
    vk::FALSE
}

impl Drop for Host {
    fn drop(&mut self) {
        if let Some((utils, messenger)) = self.ear.take() {
            // SAFETY: made by this instance, destroyed once.
            unsafe { utils.destroy_debug_utils_messenger(messenger, None) };
        }
        // SAFETY: everything made from the instance is gone: `Gpu` owns `Host` and drops it last.
        unsafe { self.instance.destroy_instance(None) };
    }
}
