//! Parses the command line, and reduces errors to one line.

mod removed;
#[cfg(test)]
mod tests;

use crate::bench::BenchSettings;
use crate::chart::ChartSettings;
use crate::command::{Requirement, RunCommand};
use crate::conform::ConformSettings;
use crate::console;
use crate::error::CliError;
use crate::info::{DoctorSettings, InfoSettings};
use crate::inspect::InspectSettings;
use crate::merge::MergeSettings;
use crate::render::RenderSettings;
use crate::stability::StabilitySettings;
use crate::stress::StressSettings;
use crate::trace::TraceSettings;
use clap::error::{ContextKind, ContextValue};
use clap::parser::ValueSource;
use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};
use std::ffi::OsString;

/// Maximum width of help text, in columns.
const WIDTH: usize = 110;

/// A ray tracer for moving, deforming triangle scenes: trees are rebuilt while frames are traced.
#[derive(Debug, Parser)]
#[command(name = "abvh", version, propagate_version = true)]
#[command(after_help = "Without arguments: abvh render demo:grove")]
struct CommandLine {
    #[command(subcommand)]
    command: Option<CommandSettings>,
}

/// A command with its settings.
#[derive(Debug, Subcommand)]
pub(crate) enum CommandSettings {
    /// Render an animation to pictures, hits and statistics
    Render(Box<RenderSettings>),
    /// Check that all shards of a run are complete, and merge their statistics
    Merge(MergeSettings),
    /// Trace rays from a file against the scene at a given time
    Trace(TraceSettings),
    /// Measure every stage over scenes, backends, update policies and intersectors
    Bench(Box<BenchSettings>),
    /// Chart speed against accuracy of every backend, intersector and update policy
    Chart(ChartSettings),
    /// Test backends against the properties that all backends share
    Conform(ConformSettings),
    /// Count wrong answers, leaks and double hits in numerically hard cases, and check their rates against baselines
    Stability(StabilitySettings),
    /// Stream vertices step by step through the library, time the steps and check their hits
    Stress(StressSettings),
    /// Describe a scene: size, motion, how refitted trees degrade, and what auto chooses and why
    Inspect(InspectSettings),
    /// Describe this build and this machine: available and unavailable backends
    Info(InfoSettings),
    /// Report whether a GPU can be used here, and if not, the cause and the fix
    Doctor(DoctorSettings),
}

impl CommandSettings {
    pub(crate) fn command(&self) -> &dyn RunCommand {
        match self {
            Self::Render(settings) => &**settings,
            Self::Merge(settings) => settings,
            Self::Trace(settings) => settings,
            Self::Bench(settings) => &**settings,
            Self::Chart(settings) => settings,
            Self::Conform(settings) => settings,
            Self::Stability(settings) => settings,
            Self::Stress(settings) => settings,
            Self::Inspect(settings) => settings,
            Self::Info(settings) => settings,
            Self::Doctor(settings) => settings,
        }
    }
}

/// A parsed command line, and clap's matches, which record whether the user gave an option.
struct Parsed {
    line: CommandLine,
    matches: ArgMatches,
}

/// Parses a command line. Without arguments, the command is `render`.
pub(crate) fn parse(args: impl IntoIterator<Item = OsString>) -> Result<CommandSettings, CliError> {
    let mut args: Vec<_> = args.into_iter().collect();
    if args.len() < 2 {
        args = ["abvh", "render"].map(OsString::from).to_vec();
    }
    let Parsed { line, matches } = parse_with_clap(&args).map_err(|e| refused(&args, &e))?;
    let settings = line
        .command
        .ok_or_else(|| CliError::invalid("no command"))?;
    if let Some((_, matches)) = matches.subcommand() {
        check_requirements(settings.command().requirements(), matches)?;
    }
    Ok(settings)
}

fn parse_with_clap(args: &[OsString]) -> Result<Parsed, clap::Error> {
    let width = console::columns().unwrap_or(WIDTH).min(WIDTH);
    let command = CommandLine::command().term_width(width);
    let matches = command.try_get_matches_from(args)?;
    let line = CommandLine::from_arg_matches(&matches)?;
    Ok(Parsed { line, matches })
}

/// Refuses an option that was given but has no effect.
fn check_requirements(all: Vec<Requirement>, matches: &ArgMatches) -> Result<(), CliError> {
    let is_given = |option| matches.value_source(option) == Some(ValueSource::CommandLine);
    let mut broken = all.iter().filter(|r| !r.is_met && is_given(r.option));
    let Some(Requirement { option, text, .. }) = broken.next() else {
        return Ok(());
    };
    let name = match *option {
        "scene" | "scenes" => "SCENE".to_owned(),
        _ => format!("--{}", option.replace('_', "-")),
    };
    Err(CliError::invalid(format!("{name} {text}")))
}

/// Prints help or the version to standard output. Reduces any other clap error to one line.
fn refused(args: &[OsString], e: &clap::Error) -> CliError {
    if !e.use_stderr() {
        // Printing fails if the reader has closed the pipe, which is no error here.
        let _ = e.print();
        return CliError::silent(0);
    }
    let command = args.get(1).map(|arg| arg.to_string_lossy());
    if let Some(removed) = removed::find(&command.unwrap_or_default(), e) {
        return CliError::invalid(removed);
    }
    if let Some(rival) = rival_as_backend(e) {
        let why =
            format!("{rival} is a rival, not a backend: use bench or chart with --rival {rival}");
        return CliError::invalid(why);
    }
    // clap removes terminal control sequences from arguments that it quotes. So parse again with control characters
    // replaced by visible escapes: the error is the same, and it quotes the whole argument.
    let escaped = args.iter().map(|arg| {
        let text = arg.to_string_lossy();
        console::plain(&text, &[]).into()
    });
    let text = match parse_with_clap(&escaped.collect::<Vec<OsString>>()) {
        Err(escaped) if escaped.kind() == e.kind() => escaped.to_string(),
        _ => e.to_string(),
    };
    let first = text.split("\n\n").next().unwrap_or(&text);
    CliError::invalid(first.strip_prefix("error: ").unwrap_or(first))
}

/// Returns the string that clap attached to an error as `kind`.
fn context(e: &clap::Error, kind: ContextKind) -> Option<&str> {
    match e.get(kind) {
        Some(ContextValue::String(text)) => Some(text),
        _ => None,
    }
}

/// Returns the name of a rival that the user gave as `--backend`.
fn rival_as_backend(e: &clap::Error) -> Option<&str> {
    let is_backend = context(e, ContextKind::InvalidArg)?.starts_with("--backend");
    let known = rivals::RivalName::named(context(e, ContextKind::InvalidValue)?);
    known.filter(|_| is_backend).map(rivals::RivalName::name)
}
