//! Compares hits of every intersector on whole scenes with exact answers.

mod exact;
mod hard;

use integration::scenes::{DEMOS, REAL};
use integration::trial;
use libtest_mimic::Trial;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = integration::arguments();
    let mut trials: Vec<Trial> = Vec::new();
    for scene in DEMOS.into_iter().chain(REAL) {
        trials.push(scene.trial("limits_cut_where_hits_are", exact::cut_where_hits_are));
        trials.push(scene.trial("every_pixels_shadow", exact::shadows));
        trials.push(scene.trial("every_pixel_and_rays_at_edges_and_vertices", exact::rays));
    }
    trials.extend(hard::trials());
    trials.push(trial("odd_scenes", exact::odd_scenes));
    libtest_mimic::run(&arguments, trials).exit_code()
}
