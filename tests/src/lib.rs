//! Shared parts of the tests in `tests/`: scenes, a backend to trace on, and the program itself.
//!
//! Nothing here is part of the product. Failures panic, as in a test.

pub mod fuzz;
pub mod program;
pub mod regressions;
pub mod scenes;
pub mod stage;

use abvh::{Device, Scene, Tracer};
use libtest_mimic::{Arguments, Trial};

/// Returns whether `ABVH_FULL=1` requests the full tier, which tests more cases on more devices and takes longer.
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

/// Maximum number of tests that run in parallel by default. NVIDIA's driver 580 loses devices if 17 threads open
/// devices and compile kernels.
const MOST_THREADS: usize = 8;

/// Parses the harness's command line. By default there is one thread more than cores, but at most `MOST_THREADS`, so
/// that another test runs while one waits for a driver.
pub fn arguments() -> Arguments {
    let mut arguments = Arguments::from_args();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = MOST_THREADS.min(cores + 1);
    arguments.test_threads.get_or_insert(threads);
    arguments
}

/// The library's device for each of `cpu`, `vulkan` and `wgpu`, with the reason if it is absent.
pub fn devices() -> [(&'static str, Device, Option<String>); 3] {
    [
        ("cpu", Device::Cpu),
        ("vulkan", Device::Vulkan(None)),
        ("wgpu", Device::Wgpu(None)),
    ]
    .map(|(name, device)| {
        let built = Tracer::builder().device(device.clone()).build(Scene::new());
        (name, device, built.err().map(|e| e.to_string()))
    })
}

/// Creates a test of the device `device`. If the device is absent, the test is ignored with the reason `absent`, or
/// fails if the device is required.
pub fn device_trial(
    name: String,
    device: &str,
    absent: Option<String>,
    body: impl FnOnce() + Send + 'static,
) -> Trial {
    let excuse = absent.filter(|_| !is_required(device));
    ignored_if(trial(name, body), excuse)
}

/// Marks a test as ignored if there is a reason.
pub fn ignored_if(trial: Trial, reason: Option<impl Into<String>>) -> Trial {
    match reason {
        Some(reason) => trial.with_kind(reason).with_ignored_flag(true),
        None => trial,
    }
}

/// Names tests by their paths: returns a slice of pairs of a path and the function.
#[macro_export]
macro_rules! named {
    ($($path:path),* $(,)?) => { &[$((stringify!($path), $path)),*] };
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
