//! End-to-end tests of the program, its pictures and its documentation pages.

mod bad;
mod bench;
mod chart;
mod conform;
mod devices;
mod files;
mod images;
mod killed;
#[cfg(target_os = "linux")]
mod linux;
mod pages;
mod runs;
mod sandbox;
mod stats;
mod stress;
mod video;

use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = integration::arguments();
    let groups = [
        bad::trials(),
        bench::trials(),
        chart::trials(),
        conform::trials(),
        devices::trials(),
        files::trials(),
        images::trials(),
        killed::trials(),
        #[cfg(target_os = "linux")]
        linux::trials(),
        pages::trials(),
        runs::trials(),
        stats::trials(),
        stress::trials(),
        video::trials(),
    ];
    let trials = groups.into_iter().flatten().collect();
    libtest_mimic::run(&arguments, trials).exit_code()
}
