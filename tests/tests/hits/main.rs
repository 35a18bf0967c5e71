//! Compares hits of every intersector on whole scenes with exact answers.

mod exact;
mod hard;
mod rounding;

use integration::scenes::{DEMOS, REAL};
use integration::{is_required, trial};
use libtest_mimic::{Failed, Trial};
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = integration::arguments();
    let mut trials: Vec<Trial> = Vec::new();
    for scene in DEMOS.into_iter().chain(REAL) {
        trials.push(scene.trial("ray_limits_are_exact_at_hits", exact::check_ray_limits));
        trials.push(scene.trial("shadows_match_the_oracle", exact::shadows));
        trials.push(scene.trial("rays_match_the_oracle", exact::rays));
    }
    trials.extend(hard::trials());
    trials.extend(rounding::trials());
    trials.push(trial("odd_scenes", exact::odd_scenes));
    libtest_mimic::run(&arguments, trials).exit_code()
}

/// Creates a test of a property on a device. If the device is absent, the test is ignored with the reason `absent`, or
/// fails if the device is required.
fn device_trial(
    property: &str,
    device: &str,
    absent: Option<String>,
    body: impl FnOnce() -> Result<(), Failed> + Send + 'static,
) -> Trial {
    let is_ignored = absent.is_some() && !is_required(device);
    Trial::test(format!("{property}_on_{device}"), body)
        .with_ignored_flag(is_ignored)
        .with_kind(absent.unwrap_or_default())
}
