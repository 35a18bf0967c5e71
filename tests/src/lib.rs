//! What the tests in `tests/` share: scenes, a stage to trace on, and the program itself.
//!
//! Nothing here is part of the product. Whatever fails here panics, as the test would.

pub mod fuzz;
pub mod program;
pub mod scenes;
pub mod stage;

use libtest_mimic::{Arguments, Trial};

/// Whether `ABVH_FULL=1` asks for the full tier: more cases, files and kills.
pub fn is_full() -> bool {
    std::env::var("ABVH_FULL").is_ok_and(|v| v == "1")
}

/// Whether `ABVH_REQUIRE_BACKENDS` names a backend, so that its absence is a failure.
pub fn is_required(name: &str) -> bool {
    let names = std::env::var("ABVH_REQUIRE_BACKENDS").unwrap_or_default();
    names.split(',').any(|required| required.trim() == name)
}

/// So many in the full tier, a quarter of them by default.
pub fn share(full: usize) -> usize {
    if is_full() { full } else { full / 4 }
}

/// Trials at a time: one driver (NVIDIA's 580) loses devices where seventeen threads open them and compile kernels.
const MOST_THREADS: usize = 8;

/// What the command line tells a harness. If it names no number of threads, there is one more than cores: while one trial
/// waits for a driver, another goes on.
pub fn arguments() -> Arguments {
    let mut arguments = Arguments::from_args();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = MOST_THREADS.min(cores + 1);
    arguments.test_threads.get_or_insert(threads);
    arguments
}

/// A trial that fails where `body` panics.
pub fn trial(name: impl Into<String>, body: impl FnOnce() + Send + 'static) -> Trial {
    Trial::test(name, move || {
        body();
        Ok(())
    })
}

/// The number that an environment variable says, or else this.
pub fn number(variable: &str, default: u64) -> u64 {
    let value = std::env::var(variable).ok();
    value.and_then(|v| v.parse().ok()).unwrap_or(default)
}
