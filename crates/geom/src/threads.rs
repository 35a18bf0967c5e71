//! What threads share, and what they do together.

use rayon::prelude::*;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The lock, also after a thread panicked that held it.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Copies as many values, by all threads, each so many at a time.
///
/// # Panics
/// If a task takes none.
pub fn copy_in_parallel<T: Copy + Send + Sync>(to: &mut [T], from: &[T], run: usize) {
    let runs = to.par_chunks_mut(run).zip(from.par_chunks(run));
    runs.for_each(|(to, from)| to.copy_from_slice(from));
}
