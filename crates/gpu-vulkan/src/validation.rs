//! The validation layer: detection and messages.

use ash::{Entry, Instance, ext, vk};
use backend::{BackendError, Result};
use geom::lock;
use gpu_common::Validation;
use std::ffi::{CStr, c_void};
use std::sync::{Mutex, MutexGuard};

pub(crate) const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Instance extensions for messages, and for checks that are off by default.
pub(crate) const EXTENSIONS: [&CStr; 2] = [ext::debug_utils::NAME, ext::validation_features::NAME];

/// Returns whether to create the instance with the layer.
///
/// # Errors
/// [`BackendError::NoDevice`] if the layer is required and not installed.
pub(crate) fn is_on(validation: Validation, entry: &Entry) -> Result<bool> {
    match validation {
        Validation::Off => Ok(false),
        Validation::IfInstalled => Ok(is_installed(entry)),
        Validation::Required if is_installed(entry) => Ok(true),
        Validation::Required => Err(BackendError::NoDevice(format!(
            "the Vulkan validation layer {} is not installed",
            LAYER.to_string_lossy()
        ))),
    }
}

fn is_installed(entry: &Entry) -> bool {
    // SAFETY: the loader is open.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }.unwrap_or_default();
    let here = |l: &vk::LayerProperties| l.layer_name_as_c_str() == Ok(LAYER);
    if !layers.iter().any(here) {
        return false;
    }
    // SAFETY: as above.
    let offered = |of: Option<&CStr>| unsafe { entry.enumerate_instance_extension_properties(of) };
    let all: Vec<_> = [Some(LAYER), None]
        .into_iter()
        .flat_map(|of| offered(of).unwrap_or_default())
        .collect();
    let has = |name: &CStr| all.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
    EXTENSIONS.into_iter().all(has)
}

static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Returns the layer's messages so far in this process.
pub(crate) fn messages() -> MutexGuard<'static, Vec<String>> {
    lock(&MESSAGES)
}

/// Records the messages of an instance, which is never destroyed.
pub(crate) fn listen(entry: &Entry, instance: &Instance) -> Result<()> {
    let severity = vk::DebugUtilsMessageSeverityFlagsEXT::ERROR
        | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING;
    let kind = vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
        | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE;
    let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(severity)
        .message_type(kind)
        .pfn_user_callback(Some(hear));
    let utils = ext::debug_utils::Instance::new(entry, instance);
    // SAFETY: the instance has the extension, and `info` outlives the call.
    let made = unsafe { utils.create_debug_utils_messenger(&info, None) };
    made.map(drop)
        .map_err(|e| BackendError::NoDevice(format!("no debug messenger: {e}")))
}

/// Called by the layer for each message.
unsafe extern "system" fn hear(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    _user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes valid data for the duration of the call.
    let text = unsafe { (*data).message_as_c_str() };
    if let Some(text) = text {
        messages().push(text.to_string_lossy().into_owned());
    }
    vk::FALSE
}
