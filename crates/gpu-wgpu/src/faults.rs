//! What goes wrong on the device, gathered from everywhere wgpu may say it.

use backend::BackendError;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Faults that no call was there to return. Shared with wgpu's callbacks.
#[derive(Default)]
pub(crate) struct Faults {
    lost: Mutex<Option<String>>,
    pending: Mutex<Option<BackendError>>,
    messages: Mutex<Vec<String>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Faults {
    /// The device is gone, for good.
    pub(crate) fn lose(&self, why: String) -> BackendError {
        lock(&self.lost).get_or_insert(why.clone());
        BackendError::DeviceLost(why)
    }

    /// Notes an error that no error scope caught; the next call returns it.
    pub(crate) fn note(&self, error: &wgpu::Error) {
        let error = self.translate("work begun earlier", 0, error);
        lock(&self.pending).get_or_insert(error);
    }

    /// The seam's error for wgpu's, with what was being made.
    pub(crate) fn translate(&self, what: &str, bytes: u64, error: &wgpu::Error) -> BackendError {
        lock(&self.messages).push(format!("{what}: {error}"));
        match error {
            wgpu::Error::OutOfMemory { .. } => BackendError::OutOfMemory {
                what: what.to_owned(),
                bytes,
            },
            other => BackendError::DeviceLost(format!("{what}: {other}")),
        }
    }

    /// Returns what is due: the device's loss for ever, any other fault once.
    pub(crate) fn check(&self) -> backend::Result<()> {
        if let Some(why) = lock(&self.lost).as_ref() {
            return Err(BackendError::DeviceLost(why.clone()));
        }
        match lock(&self.pending).take() {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }

    /// Everything that wgpu refused, in order.
    pub(crate) fn messages(&self) -> Vec<String> {
        lock(&self.messages).clone()
    }
}

/// What the validation layer called an error so far, in this process.
pub(crate) fn layer_messages() -> Vec<String> {
    static HEARD: Mutex<Vec<String>> = Mutex::new(Vec::new());
    let mut heard = lock(&HEARD);
    heard.extend(wgpu_hal::VALIDATION_CANARY.get_and_reset());
    heard.clone()
}
