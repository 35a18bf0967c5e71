//! The program from end to end, as a person runs it; its pictures; and the pages that tell of it.

mod bad;
mod bench;
mod chart;
mod conform;
mod devices;
mod files;
mod hits;
mod images;
mod killed;
#[cfg(target_os = "linux")]
mod linux;
mod pages;
mod reduce;
mod runs;
mod sandbox;
mod stability;
mod stats;
mod streamed;
mod timeline;
mod video;

use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = integration::arguments();
    let rooms = [
        bad::trials(),
        bench::trials(),
        chart::trials(),
        conform::trials(),
        devices::trials(),
        files::trials(),
        hits::trials(),
        images::trials(),
        killed::trials(),
        streamed::trials(),
        #[cfg(target_os = "linux")]
        linux::trials(),
        pages::trials(),
        reduce::trials(),
        runs::trials(),
        stability::trials(),
        stats::trials(),
        timeline::trials(),
        video::trials(),
    ];
    let trials = rooms.into_iter().flatten().collect();
    libtest_mimic::run(&arguments, trials).exit_code()
}
