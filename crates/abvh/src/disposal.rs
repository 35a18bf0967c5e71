//! Where things go that take long to be freed.

use std::sync::{Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};

/// Frees them beside the steps, on threads that whoever owns it waits for in the end: drivers do not like a process to end
/// meanwhile.
#[derive(Debug, Default)]
pub(crate) struct Disposal(Mutex<Vec<JoinHandle<()>>>);

impl Disposal {
    /// Frees what `free` owns, here if no thread is to be had.
    pub(crate) fn begin(&self, free: impl FnOnce() + Send + 'static) {
        let thread = Builder::new().name("abvh-dispose".into());
        let freeing = thread.spawn(free);
        let mut threads = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        threads.retain(|thread| !thread.is_finished());
        threads.extend(freeing);
    }
}

impl Drop for Disposal {
    fn drop(&mut self) {
        let threads = self.0.get_mut().unwrap_or_else(PoisonError::into_inner);
        for thread in threads.drain(..) {
            let _ = thread.join();
        }
    }
}
