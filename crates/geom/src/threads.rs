//! Thread pools of the library, separate from those of the program.
//!
//! While a rayon worker waits for other threads, it runs queued tasks of its own pool. If the program calls the library
//! from such a task, these are tasks of the program. They may need a lock that the first task holds, or nest until the
//! stack overflows. Therefore the library never waits for parallel work on a worker of the program, nor in a pool that
//! runs tasks of the program.

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
    /// True if this thread is a worker of one of the library's pools.
    static IS_OWN_WORKER: Cell<bool> = const { Cell::new(false) };
}

/// True if rayon's global pool belongs to the library: see [`use_global_pool`].
static GLOBAL_IS_OWN: AtomicBool = AtomicBool::new(false);

/// Makes the library work in rayon's global pool, so that the program controls the number of threads.
///
/// The program must not run its own tasks in that pool.
pub fn use_global_pool() {
    GLOBAL_IS_OWN.store(true, Ordering::Relaxed);
}

/// Starts a pool of the library. Parallel work that starts in it stays in it.
///
/// # Errors
/// The system refuses to start the threads.
pub fn own_pool(builder: ThreadPoolBuilder) -> Result<ThreadPool, ThreadPoolBuildError> {
    let mark = |_| IS_OWN_WORKER.set(true);
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

/// Runs parallel `work` in the library pool of the calling thread, or else in the shared pool, and returns the result.
///
/// `work` must never wait for code of the program, which may need the shared pool itself.
///
/// # Panics
/// If `work` panics.
pub fn in_parallel<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    match foreign_pool() {
        Some(pool) => run_in(pool, work),
        None => work(),
    }
}

/// Runs parallel `work` like [`in_parallel`], but the calling thread takes part in the tasks that it spawns.
///
/// # Panics
/// If `work` panics.
pub fn in_parallel_scope<'s, T: Send>(work: impl FnOnce(&Scope<'s>) -> T + Send) -> T {
    match foreign_pool() {
        Some(pool) => off_worker(|| pool.in_place_scope(work)),
        None => rayon::in_place_scope(work),
    }
}

/// Returns the number of threads that [`in_parallel`] uses.
pub fn parallelism() -> usize {
    match foreign_pool() {
        Some(pool) => pool.current_num_threads(),
        None => rayon::current_num_threads(),
    }
}

/// Returns the shared pool, or `None` if the calling thread is already in a pool of the library.
fn foreign_pool() -> Option<&'static ThreadPool> {
    static SHARED: OnceLock<Option<ThreadPool>> = OnceLock::new();
    if IS_OWN_WORKER.get() || GLOBAL_IS_OWN.load(Ordering::Relaxed) {
        return None;
    }
    let start = |threads| {
        let builder = ThreadPoolBuilder::new().num_threads(threads);
        own_pool(builder.thread_name(|i| format!("abvh-shared-{i}"))).ok()
    };
    // If the system refuses one thread per core, it may still grant one.
    let shared = SHARED.get_or_init(|| start(0).or_else(|| start(1)));
    shared.as_ref()
}

/// Runs `work` on a thread that can wait without running tasks of the program: a new thread if this is a rayon worker.
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
        None => work.expect("a thread that did not start took no work")(),
    }
}

/// Number of values that the calling thread sets faster alone than with other threads, which must wake first.
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

/// Copies `from` to `to` in parallel, `run` values at a time.
///
/// # Panics
/// If `run` is 0.
pub fn copy_in_parallel<T: Copy + Send + Sync>(to: &mut [T], from: &[T], run: usize) {
    in_parallel(|| {
        let runs = to.par_chunks_mut(run).zip(from.par_chunks(run));
        runs.for_each(|(to, from)| to.copy_from_slice(from));
    });
}
