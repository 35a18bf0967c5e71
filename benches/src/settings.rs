//! How long to measure, and on how many threads.

use criterion::Criterion;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::time::Duration;

/// Few samples and short: medians of one run are compared with one another, not with other days.
#[must_use]
pub fn criterion() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2))
        .configure_from_args()
}

/// One thread, and one a core where there are more.
#[must_use]
pub fn thread_counts() -> Vec<usize> {
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    if all > 1 { vec![1, all] } else { vec![1] }
}

/// A pool to install round a measured closure.
///
/// # Panics
/// If the machine cannot start the threads.
#[must_use]
pub fn pool(threads: usize) -> ThreadPool {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("the machine can start threads")
}
