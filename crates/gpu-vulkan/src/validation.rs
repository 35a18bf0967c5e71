//! Messages of the validation layer.

use ash::{Entry, Instance, ext, vk};
use backend::{BackendError, Result};
use geom::lock;
use std::ffi::{CStr, c_void};
use std::sync::{Mutex, MutexGuard};

pub(crate) const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Instance extensions for messages, and for checks that are off by default.
pub(crate) const EXTENSIONS: [&CStr; 2] = [ext::debug_utils::NAME, ext::validation_features::NAME];

static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Returns the layer's messages so far in this process.
pub(crate) fn messages() -> MutexGuard<'static, Vec<String>> {
    lock(&MESSAGES)
}

/// Records the messages of an instance, which is never destroyed.
pub(crate) fn register_callback(entry: &Entry, instance: &Instance) -> Result<()> {
    let severity = vk::DebugUtilsMessageSeverityFlagsEXT::ERROR
        | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING;
    let kind = vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
        | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE;
    let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(severity)
        .message_type(kind)
        .pfn_user_callback(Some(record_message));
    let utils = ext::debug_utils::Instance::new(entry, instance);
    // SAFETY: the instance has the extension, and `info` outlives the call.
    let made = unsafe { utils.create_debug_utils_messenger(&info, None) };
    made.map(drop)
        .map_err(|e| BackendError::NoDevice(format!("no debug messenger: {e}")))
}

/// Called by the layer for each message.
unsafe extern "system" fn record_message(
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
