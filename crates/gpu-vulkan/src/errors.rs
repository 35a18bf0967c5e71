//! Conversion of Vulkan's result codes into backend errors.

use ash::vk;
use backend::BackendError;

/// Converts a result code into an error that names the failed operation `what`.
pub fn failed(what: &str) -> impl FnOnce(vk::Result) -> BackendError + '_ {
    failed_for(what, 0)
}

/// Converts a result code into an error that names the failed operation `what` and its required bytes.
pub fn failed_for(what: &str, bytes: u64) -> impl FnOnce(vk::Result) -> BackendError + '_ {
    move |code| match code {
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
            BackendError::OutOfMemory {
                what: what.to_owned(),
                bytes,
            }
        }
        vk::Result::ERROR_DEVICE_LOST => BackendError::DeviceLost(format!("during {what}")),
        _ => BackendError::rejected(what, code.to_string()),
    }
}

/// Converts a result code of the driver's compiler into an error that names the kernel.
pub fn refused(kernel: &str) -> impl FnOnce(vk::Result) -> BackendError + '_ {
    move |code| match failed(kernel)(code) {
        BackendError::Rejected { .. } => {
            BackendError::NoDevice(format!("the driver rejects kernel {kernel}: {code}"))
        }
        error => error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn result_codes_become_descriptive_errors() {
        let lost = failed("a submission")(vk::Result::ERROR_DEVICE_LOST);
        assert_eq!(lost.to_string(), "the device was lost: during a submission");
        let full = failed_for("hits", 64)(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY);
        let expected = "out of memory: hits needs 64 bytes";
        assert_eq!(full.to_string(), expected);
        let bad = failed("a semaphore")(vk::Result::ERROR_UNKNOWN).to_string();
        assert!(bad.starts_with("a semaphore was rejected: "), "{bad}");
        let kernel = refused("refit")(vk::Result::ERROR_INITIALIZATION_FAILED);
        assert!(matches!(kernel, BackendError::NoDevice(_)), "{kernel}");
        for code in [
            vk::Result::ERROR_OUT_OF_HOST_MEMORY,
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
        ] {
            let full = refused("refit")(code);
            assert!(matches!(full, BackendError::OutOfMemory { .. }), "{full}");
        }
    }
}
