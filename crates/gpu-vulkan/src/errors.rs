//! Vulkan's result codes as the seam's errors.

use ash::vk;
use backend::BackendError;

/// Says what was being made when Vulkan refused.
pub(crate) fn failed(what: &str) -> impl FnOnce(vk::Result) -> BackendError + '_ {
    move |code| match code {
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
            BackendError::OutOfMemory {
                what: what.to_owned(),
                bytes: 0,
            }
        }
        vk::Result::ERROR_DEVICE_LOST => BackendError::DeviceLost(what.to_owned()),
        _ => BackendError::DeviceLost(format!("{what}: {code}")),
    }
}
