//! Shared parts of the tests in `tests/`: scenes, a stage to trace on, and the program itself.
//!
//! Nothing here is part of the product. Failures panic, as in a test.

pub mod fuzz;
pub mod program;
pub mod scenes;
pub mod stage;

use libtest_mimic::{Arguments, Trial};

/// Returns whether `ABVH_FULL=1` requests the full tier: more cases, files and kills.
pub fn is_full() -> bool {
    std::env::var("ABVH_FULL").is_ok_and(|v| v == "1")
}

/// Returns whether `ABVH_REQUIRE_BACKENDS` names a backend, so that its absence is a failure.
pub fn is_required(name: &str) -> bool {
    let names = std::env::var("ABVH_REQUIRE_BACKENDS").unwrap_or_default();
    names.split(',').any(|required| required.trim() == name)
}

/// Returns `full` in the full tier, else `full / 4`.
pub fn share(full: usize) -> usize {
    if is_full() { full } else { full / 4 }
}

/// Tests that may run in parallel. NVIDIA's driver 580 loses devices if 17 threads open devices and compile kernels.
const MOST_THREADS: usize = 8;

/// Parses the harness's command line. By default there is one thread more than cores, so that another test runs while
/// one waits for a driver.
pub fn arguments() -> Arguments {
    let mut arguments = Arguments::from_args();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = MOST_THREADS.min(cores + 1);
    arguments.test_threads.get_or_insert(threads);
    arguments
}

/// Creates a test that fails if `body` panics.
pub fn trial(name: impl Into<String>, body: impl FnOnce() + Send + 'static) -> Trial {
    Trial::test(name, move || {
        body();
        Ok(())
    })
}

/// Returns the number in an environment variable, or else `default`.
pub fn number(variable: &str, default: u64) -> u64 {
    let value = std::env::var(variable).ok();
    value.and_then(|v| v.parse().ok()).unwrap_or(default)
}
