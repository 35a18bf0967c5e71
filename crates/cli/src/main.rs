//! `abvh`: a ray tracer for moving, deforming triangle scenes.
//!
//! One file per command. `args` parses the command line, and `stop` turns errors into one line and an exit code.

mod args;
mod bench;
mod chart;
mod choose;
mod conflicts;
mod conform;
mod frames;
mod info;
mod inspect;
mod merge;
mod open;
mod render;
mod resume;
mod session;
mod stability;
mod stop;
mod stress;
mod table;
mod talk;
mod threads;
mod trace;
mod values;
mod writer;

use args::Command;
use std::process::ExitCode;
use stop::Stop;

fn main() -> ExitCode {
    stop::heed_signals();
    match args::parse(std::env::args_os()).and_then(run) {
        Ok(()) => ExitCode::SUCCESS,
        Err(stop) => talk::complain(&stop),
    }
}

fn run(command: Command) -> Result<(), Stop> {
    let (threads, no_cache) = match &command {
        Command::Render(args) => (args.device.threads, args.device.no_cache),
        Command::Trace(args) => (args.device.threads, args.device.no_cache),
        Command::Bench(args) => (args.threads, false),
        _ => (None, false),
    };
    threads::start(threads);
    if no_cache {
        backends::keep_no_kernels();
    }
    match command {
        Command::Render(args) => render::run(&args),
        Command::Merge(args) => merge::run(&args),
        Command::Trace(args) => trace::run(&args),
        Command::Bench(args) => bench::run(&args),
        Command::Chart(args) => chart::run(&args),
        Command::Conform(args) => conform::run(&args),
        Command::Stability(args) => stability::run(&args),
        Command::Stress(args) => stress::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Info { json } => info::run(json),
        Command::Doctor => info::doctor(),
    }
}
