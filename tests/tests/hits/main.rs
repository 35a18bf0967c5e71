//! Compares hits of every intersector on whole scenes with exact answers.

mod exact;
mod hard;
mod rounding;

use integration::scenes::{DEMOS, REAL};
use integration::trial;
use libtest_mimic::Trial;
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
