//! Thread pools of the library, separate from those of the program.
//!
//! While a rayon worker waits for other threads, it runs queued tasks of its own pool. The program may call the library
//! from a task of its own rayon pool. If the call waited in rayon, that worker could start other tasks of the program.
//! These may need a lock that the first task holds, or nest until the stack overflows. Therefore no worker of a pool that
//! runs tasks of the program waits in rayon for parallel work of the library. Exceptions are [`use_global_pool`] and
//! systems that refuse to start threads.

use rayon::prelude::*;
use rayon::{Scope, ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use std::cell::Cell;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread;

/// Locks `mutex`, and ignores poisoning by a thread that panicked.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

thread_local! {
    /// True if this thread is a worker of a pool from [`start_library_pool`].
    static IS_LIBRARY_WORKER: Cell<bool> = const { Cell::new(false) };
}

/// True if the library works in rayon's global pool: see [`use_global_pool`].
static GLOBAL_POOL_IS_LIBRARY: AtomicBool = AtomicBool::new(false);

/// Makes the library work in rayon's global pool, so that the program controls the number of threads.
///
/// Tasks of the program may also run in that pool. While a worker waits for parallel work of the library, it may start
/// another task of the program. So a task must not call the library while it holds a lock that other tasks need. Few
/// tasks should be queued, because they can nest.
pub fn use_global_pool() {
    GLOBAL_POOL_IS_LIBRARY.store(true, Ordering::Relaxed);
}

/// Starts a thread pool of the library. Parallel work of the library that begins on one of its workers uses this pool.
///
/// # Errors
/// The system refuses to start the threads.
pub fn start_library_pool(builder: ThreadPoolBuilder) -> Result<ThreadPool, ThreadPoolBuildError> {
    let mark = |_| IS_LIBRARY_WORKER.set(true);
    builder.start_handler(mark).build()
}

/// Runs `work` in `pool` and returns its result. The calling thread sleeps meanwhile, unless it is a worker of `pool`.
///
/// # Panics
/// If `work` panics.
pub fn run_in<T: Send>(pool: &ThreadPool, work: impl FnOnce() -> T + Send) -> T {
    match pool.current_thread_index() {
        Some(_) => work(),
        None => off_worker(|| pool.install(work)),
    }
}

/// Runs parallel `work` in the library pool that the calling thread belongs to, or else in the *shared pool*, which all
/// calls of the library share. Without a shared pool (after [`use_global_pool`], or if its threads could not start), runs
/// `work` in rayon's current pool. Returns the result.
///
/// `work` must never wait for code of the program, because that code may itself wait for the shared pool.
///
/// # Panics
/// If `work` panics.
pub fn in_parallel<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    match shared_pool() {
        Some(pool) => run_in(pool, work),
        None => work(),
    }
}

/// Runs `work` and the tasks that it spawns, and returns the result of `work`. The tasks run in the pool of
/// [`in_parallel`]. `work` itself runs on the calling thread, or on a new one in its place: see [`off_worker`].
fn in_parallel_scope<'s, T: Send>(work: impl FnOnce(&Scope<'s>) -> T + Send) -> T {
    match shared_pool() {
        Some(pool) => off_worker(|| pool.in_place_scope(work)),
        None => rayon::in_place_scope(work),
    }
}

/// Returns the number of threads that [`in_parallel`] uses.
pub fn parallelism() -> usize {
    match shared_pool() {
        Some(pool) => pool.current_num_threads(),
        None => rayon::current_num_threads(),
    }
}

/// Returns the shared pool, or `None` if the work should run in the current pool. This is the case on workers of the
/// library's pools, after [`use_global_pool`], and if the shared pool could not be started.
fn shared_pool() -> Option<&'static ThreadPool> {
    static SHARED: OnceLock<Option<ThreadPool>> = OnceLock::new();
    if IS_LIBRARY_WORKER.get() || GLOBAL_POOL_IS_LIBRARY.load(Ordering::Relaxed) {
        return None;
    }
    let start = |threads| {
        let builder = ThreadPoolBuilder::new().num_threads(threads);
        start_library_pool(builder.thread_name(|i| format!("abvh-shared-{i}"))).ok()
    };
    // If the system refuses one thread per core, it may still grant one.
    let shared = SHARED.get_or_init(|| start(0).or_else(|| start(1)));
    shared.as_ref()
}

/// Runs `work` on a thread that can wait without running tasks of the program. This is a new thread if the calling
/// thread is a rayon worker. If the system refuses a new thread, runs `work` on the calling thread.
fn off_worker<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    if rayon::current_thread_index().is_none() {
        return work();
    }
    let mut work = Some(work);
    let done = thread::scope(|scope| {
        let run = || work.take().map(|work| work());
        let builder = thread::Builder::new().name("abvh-call".into());
        let thread = builder.spawn_scoped(scope, run).ok()?;
        thread.join().unwrap_or_else(|panic| resume_unwind(panic))
    });
    match done {
        Some(result) => result,
        None => work.expect("a thread that failed to start cannot have taken the work")(),
    }
}

/// Up to this number of values, the calling thread alone is faster, because other threads must wake first.
const FEW: usize = 1 << 13;

/// Sets each value from its index, in parallel if there are many.
pub fn set_each<T: Send>(to: &mut [T], of: impl Fn(usize) -> T + Sync) {
    let set = |(i, to): (usize, &mut T)| *to = of(i);
    if to.len() <= FEW {
        return to.iter_mut().enumerate().for_each(set);
    }
    in_parallel(|| {
        let each = to.par_iter_mut().with_min_len(FEW / 4).enumerate();
        each.for_each(set);
    });
}

/// Number of threads that help the calling thread to copy. More would not be faster, and a concurrent tree build would
/// delay them.
const HELPERS: usize = 3;
/// Bytes that a thread copies at a time.
const COPY_RUN: usize = 96 << 10;
/// Up to this number of bytes, the calling thread alone is faster, because helpers must wake first.
const FEW_BYTES: usize = 512 << 10;

/// Copies `from` to `to` with a few threads.
///
/// # Panics
/// If the slices differ in length.
pub fn copy_in_parallel<T: Copy + Send + Sync>(to: &mut [T], from: &[T]) {
    convert_in_parallel(to, from, |value| value);
}

/// Sets each value of `to` to `of` the value of `from` at the same index, with a few threads. For conversions as cheap
/// as a copy.
///
/// # Panics
/// If the slices differ in length.
pub fn convert_in_parallel<T, U>(to: &mut [U], from: &[T], of: impl Fn(T) -> U + Sync)
where
    T: Copy + Sync,
    U: Send,
{
    assert_eq!(to.len(), from.len());
    let convert = |(to, from): (&mut [U], &[T])| {
        let values = to.iter_mut().zip(from);
        values.for_each(|(to, from)| *to = of(*from));
    };
    if size_of_val(from) <= FEW_BYTES {
        return convert((to, from));
    }
    let run = COPY_RUN / size_of::<T>();
    for_each_in_parallel(to.chunks_mut(run).zip(from.chunks(run)), convert);
}

/// Passes each part to `work`, on the calling thread (or one in its place: see `in_parallel_scope`) and a few helpers.
/// A helper that starts late may find no parts.
pub fn for_each_in_parallel<P: Send>(
    parts: impl Iterator<Item = P> + Send,
    work: impl Fn(P) + Sync,
) {
    let parts = Mutex::new(parts);
    let next = || lock(&parts).next();
    let work_on = || {
        while let Some(part) = next() {
            work(part);
        }
    };
    in_parallel_scope(|scope| {
        (0..HELPERS).for_each(|_| scope.spawn(|_| work_on()));
        work_on();
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_slices_of_any_length() {
        let many = FEW_BYTES / size_of::<u32>();
        let from: Vec<u32> = (0..many as u32 * 3 + 5).collect();
        for count in [0, 3, many, many + 1, from.len()] {
            let mut to = vec![0; count];
            copy_in_parallel(&mut to, &from[..count]);
            assert!(to == from[..count]);
            let mut to = vec![0_u8; count];
            convert_in_parallel(&mut to, &from[..count], |x| x as u8 ^ 1);
            assert!(
                to.iter()
                    .zip(&from)
                    .all(|(to, from)| *to == *from as u8 ^ 1)
            );
        }
    }
}
