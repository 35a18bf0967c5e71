//! Errors of the device, collected from all places where wgpu reports them.
//!
//! - Calls that wgpu may reject run in [`crate::gpu::OpenGpu::guard`], except mapping and unmapping, which report
//!   errors themselves. `guard` catches out-of-memory, validation and internal errors. This works on our own devices
//!   and on the program's.
//! - wgpu reports the loss of a device only to the device's callback. We register it on our own devices only. On the
//!   program's device, a wait detects the loss: polling panics or wgpu rejects a mapping. The panic is caught, unless
//!   the program is built to abort on panics. A call that is rejected as invalid also checks for a loss.
//! - Errors outside of any call go to our own device's handler for uncaptured errors, and the next call returns them.

use backend::BackendError;
use geom::lock;
use std::sync::Mutex;

/// The loss of the device, an error that no call has returned yet, and the messages of wgpu's errors. Shared with
/// wgpu's callbacks.
#[derive(Default)]
pub(crate) struct Faults {
    lost: Mutex<Option<String>>,
    pending: Mutex<Option<BackendError>>,
    messages: Mutex<Vec<String>>,
}

impl Faults {
    /// Records that the device is permanently lost, and returns the error.
    pub(crate) fn lose(&self, why: String) -> BackendError {
        lock(&self.lost).get_or_insert(why.clone());
        BackendError::DeviceLost(why)
    }

    /// Records an error that no error scope caught. The next call returns it.
    pub(crate) fn record(&self, error: &wgpu::Error) {
        let error = self.translate("earlier work", 0, error);
        lock(&self.pending).get_or_insert(error);
    }

    /// Converts a wgpu error into a backend error that names the failed operation.
    pub(crate) fn translate(&self, what: &str, bytes: u64, error: &wgpu::Error) -> BackendError {
        lock(&self.messages).push(format!("{what}: {error}"));
        match error {
            wgpu::Error::OutOfMemory { .. } => BackendError::OutOfMemory {
                what: what.to_owned(),
                bytes,
            },
            wgpu::Error::Validation { .. } | wgpu::Error::Internal { .. } => {
                BackendError::rejected(what, error.to_string())
            }
        }
    }

    /// Returns a pending error: the device's loss on every call, any other error once.
    pub(crate) fn check(&self) -> backend::Result<()> {
        if let Some(why) = lock(&self.lost).as_ref() {
            return Err(BackendError::DeviceLost(why.clone()));
        }
        lock(&self.pending).take().map_or(Ok(()), Err)
    }

    /// Returns all errors of wgpu, in order.
    pub(crate) fn messages(&self) -> Vec<String> {
        lock(&self.messages).clone()
    }
}

/// Returns the errors that the validation layer has reported in this process. Omits one kind: old layers reject the
/// debug information of wgpu's SPIR-V, because they do not know WGSL as a source language.
pub(crate) fn layer_messages() -> Vec<String> {
    static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());
    let unknown_language = |m: &String| m.ends_with("Invalid source language operand: 10");
    let new = wgpu_hal::VALIDATION_CANARY.get_and_reset();
    let mut messages = lock(&MESSAGES);
    messages.extend(new.into_iter().filter(|m| !unknown_language(m)));
    messages.clone()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn out_of_memory() -> wgpu::Error {
        wgpu::Error::OutOfMemory {
            source: "no memory left".into(),
        }
    }

    #[test]
    fn out_of_memory_names_the_purpose() {
        let error = Faults::default().translate("the tree's nodes", 64, &out_of_memory());
        let said = "out of memory: the tree's nodes needs 64 bytes";
        assert_eq!(error.to_string(), said);
    }

    #[test]
    fn validation_error_is_not_device_loss() {
        let faults = Faults::default();
        let invalid = wgpu::Error::Validation {
            source: "no such usage".into(),
            description: "no such usage".into(),
        };
        let error = faults.translate("hits", 64, &invalid);
        let said = error.to_string();
        assert!(said.starts_with("hits was rejected: "), "{said}");
        assert!(said.contains("no such usage"), "{said}");
        assert_eq!(faults.check(), Ok(()));
    }

    #[test]
    fn uncaught_error_is_returned_once_but_loss_always() {
        let faults = Faults::default();
        faults.record(&out_of_memory());
        assert!(matches!(
            faults.check(),
            Err(BackendError::OutOfMemory { .. })
        ));
        assert_eq!(faults.check(), Ok(()));
        faults.lose("unplugged".into());
        let lost = Err(BackendError::DeviceLost("unplugged".into()));
        assert_eq!((faults.check(), faults.check()), (lost.clone(), lost));
        assert_eq!(faults.messages(), ["earlier work: Out of Memory"]);
    }
}
