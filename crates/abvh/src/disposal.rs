//! Drops large objects on separate threads.

use geom::lock;
use std::sync::{Mutex, PoisonError};
use std::thread::{self, JoinHandle};

/// Threads that drop large objects, because such a drop takes long. Dropping this value waits for the threads, because
/// drivers may fail if the process exits meanwhile.
#[derive(Debug, Default)]
pub(crate) struct Disposal(Mutex<Vec<JoinHandle<()>>>);

impl Disposal {
    /// Runs `free` on a new thread. If no thread can be started, drops `free` on this thread.
    pub(crate) fn begin(&self, free: impl FnOnce() + Send + 'static) {
        let thread = thread::Builder::new().name("abvh-dispose".into());
        let started = thread.spawn(free);
        let mut threads = lock(&self.0);
        threads.retain(|thread| !thread.is_finished());
        threads.extend(started);
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
