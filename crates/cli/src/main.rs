//! `abvh`: a ray tracer for moving, deforming triangle scenes.
//!
//! [`command_line`] parses the arguments into the settings of a command. Each command has a module of its name with its
//! settings, their requirements and `run`. `info` also contains the command `doctor`.
//!
//! | module | responsibility |
//! |---|---|
//! | `command`, `command_line`, `parsers` | the trait of commands, the list of commands, and parsers of option values |
//! | `scene_source`, `camera`, `frame_list`, `devices`, `tracer_settings` | groups of options, and the selected values |
//! | `auto`, `setup` | the choice of the update policy by `auto`; opening the device and loading the scene |
//! | `tested_backends` | options and backends of `conform`, `stability` and `stress` |
//! | `measure` | measurements of frames on a backend or on a rival: a third-party ray tracer |
//! | `file_checks` | refuses outputs that overwrite inputs or each other |
//! | `console`, `table`, `machine` | output to the terminal; tables of results; facts about the machine |
//! | `error`, `signals`, `threads` | errors with exit codes; SIGINT and SIGTERM; rayon's global pool |
//!
//! Apart from tests, imports between these modules have no cycles.
//!
//! Settings are converted to the types of the libraries before work begins. For example, `--lockstep 2` is a field of
//! `TracerSettings`. `TracerSettings::policy` turns it into `Policy::Lockstep(2)`, and `setup` passes that policy to
//! the driver. `--adapter` is a field of `DeviceSettings`, which opens the backend.

mod auto;
mod bench;
mod camera;
mod chart;
mod command;
mod command_line;
mod conform;
mod console;
mod devices;
mod error;
mod file_checks;
mod frame_list;
mod info;
mod inspect;
mod machine;
mod measure;
mod merge;
mod parsers;
mod render;
mod scene_source;
mod setup;
mod signals;
mod stability;
mod stress;
mod table;
mod tested_backends;
mod threads;
mod trace;
mod tracer_settings;

use error::CliError;
use std::process::ExitCode;

fn main() -> ExitCode {
    signals::handle();
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => console::complain(&error),
    }
}

fn run() -> Result<(), CliError> {
    let settings = command_line::parse(std::env::args_os())?;
    let command = settings.command();
    threads::start(command.threads());
    command.run()
}
