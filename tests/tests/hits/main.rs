//! What rays hit: by every intersector on whole scenes, against exact answers, and under every schedule.

mod exact;
mod hard;
mod limits;
mod ridges;
mod schedule;
mod soup;
mod verifier;
mod watertight;

use integration::scenes::{DEMOS, REAL};
use libtest_mimic::{Arguments, Trial};
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let scenes = DEMOS.into_iter().chain(REAL);
    let mut trials: Vec<Trial> = scenes
        .flat_map(|source| {
            let [limits, exact] = [limits::trials(source), exact::of_scene(source)];
            let judged = watertight::trials(source);
            limits.into_iter().chain(exact).chain(judged)
        })
        .collect();
    trials.extend(soup::trials());
    trials.extend(exact::trials());
    trials.extend(exact::Device::ALL.into_iter().flat_map(hard::trials));
    trials.extend(schedule::trials());
    libtest_mimic::run(&arguments, trials).exit_code()
}
