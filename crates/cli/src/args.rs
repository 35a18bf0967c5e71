//! Command-line arguments.

use crate::stop::Stop;
use crate::{talk, values};
use backend::{BackendName, Intersector, Policy};
use clap::error::{ContextKind, ContextValue};
use clap::{ArgMatches, Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use pipeline::{TREE_BYTES, trees_bytes};
use std::ffi::OsString;
use std::path::PathBuf;

/// Maximum width of help text, in columns.
const WIDTH: usize = 110;

/// A ray tracer for moving, deforming triangle scenes: trees are rebuilt while frames are traced.
#[derive(Debug, Parser)]
#[command(name = "abvh", version, propagate_version = true)]
#[command(after_help = "Without arguments: abvh render demo:grove")]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Render an animation to pictures, hits and statistics
    Render(Box<RenderArgs>),
    /// Check that all shards of a run are complete, and merge their statistics
    Merge(MergeArgs),
    /// Trace the rays of a file at one time
    Trace(TraceArgs),
    /// Measure every stage over scenes, backends, update policies and intersectors
    Bench(Box<BenchArgs>),
    /// Chart speed against accuracy of every backend, intersector and update policy
    Chart(ChartArgs),
    /// Test backends against the properties that all backends share
    Conform(ConformArgs),
    /// Count wrong answers, leaks and double hits in numerically hard cases, and check their rates against baselines
    Stability(StabilityArgs),
    /// Stream vertices step by step through the library, time the steps and check their hits
    Stress(StressArgs),
    /// Describe a scene: size, motion, growth of the refit cost, and the choices of auto with reasons
    Inspect(InspectArgs),
    /// Describe this build and this machine: available and unavailable backends
    Info {
        /// Print JSON to standard output
        #[arg(long)]
        json: bool,
    },
    /// Report whether a GPU can be used here, and if not, the cause and the fix
    Doctor,
}

/// Parses a command line. Without arguments, the command is `render`.
pub(crate) fn parse(args: impl IntoIterator<Item = OsString>) -> Result<Command, Stop> {
    let mut args: Vec<_> = args.into_iter().collect();
    if args.len() < 2 {
        args = ["abvh", "render"].map(OsString::from).to_vec();
    }
    let (cli, given) = matches(&args).map_err(|e| refused(&args, &e))?;
    let command = cli.command.ok_or_else(|| Stop::bad("no command"))?;
    if let Some((_, given)) = given.subcommand() {
        idle::check(&command, given)?;
    }
    Ok(command)
}

/// Returns the parsed command line and its matches, which hold the source of each value.
fn matches(args: &[OsString]) -> Result<(Cli, ArgMatches), clap::Error> {
    let width = talk::columns().unwrap_or(WIDTH).min(WIDTH);
    let given = Cli::command()
        .term_width(width)
        .try_get_matches_from(args)?;
    Ok((Cli::from_arg_matches(&given)?, given))
}

/// Prints help to standard output. Reduces any other clap error to one line.
fn refused(args: &[OsString], e: &clap::Error) -> Stop {
    if !e.use_stderr() {
        // Printing fails if the reader has closed the pipe, which is no error here.
        let _ = e.print();
        return Stop::Shown;
    }
    if let Some(removed) = removed::find(e) {
        return Stop::bad(removed);
    }
    // clap leaves escape sequences out of what it quotes. Spelt out, they are refused likewise.
    let spelt = args
        .iter()
        .map(|arg| talk::plain(&arg.to_string_lossy(), &[]).into_owned().into());
    if let Some(rival) = rival_as_backend(e) {
        let why =
            format!("{rival} is a rival, not a backend: use bench or chart with --rival {rival}");
        return Stop::bad(why);
    }
    let text = match matches(&spelt.collect::<Vec<OsString>>()) {
        Err(spelt) if spelt.kind() == e.kind() => spelt.to_string(),
        _ => e.to_string(),
    };
    let first = text.split("\n\n").next().unwrap_or(&text);
    Stop::bad(first.strip_prefix("error: ").unwrap_or(first))
}

/// Returns the rival that was named as a backend.
fn rival_as_backend(e: &clap::Error) -> Option<&str> {
    let text = |kind| match e.get(kind) {
        Some(ContextValue::String(text)) => Some(text.as_str()),
        _ => None,
    };
    let is_backend = text(ContextKind::InvalidArg)?.starts_with("--backend");
    let known = rivals::known(text(ContextKind::InvalidValue)?);
    known.filter(|_| is_backend).map(|known| known.name)
}

#[derive(Args, Debug)]
pub(crate) struct MergeArgs {
    /// Output folders of all shards of one run. For runs that wrote only --stats, the statistics files
    #[arg(value_name = "DIR|FILE.json", required = true)]
    pub(crate) runs: Vec<PathBuf>,
    /// File for the statistics of all frames, - for standard output
    #[arg(long, value_name = "FILE.json")]
    pub(crate) stats: Option<PathBuf>,
}

#[derive(Args, Debug)]
pub(crate) struct TraceArgs {
    /// Scene: a demo, files or a directory (`abvh render --help` explains names)
    #[arg(value_parser = values::scene())]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) source: SourceArgs,
    /// Time, in key frames
    #[arg(long, value_name = "T", value_parser = values::finite::<f64>, allow_hyphen_values = true)]
    pub(crate) time: f64,
    /// Rays: float32 or float64 (N, 6) `ox oy oz dx dy dz`, or (N, 8) with `t_min t_max` appended
    #[arg(long, value_name = "RAYS.npy")]
    pub(crate) rays: PathBuf,
    /// File for the hits
    #[arg(long, value_name = "HITS.npz", value_parser = values::file())]
    pub(crate) out: PathBuf,
    /// Find only whether each ray hits any triangle
    #[arg(long)]
    pub(crate) any_hit: bool,
    #[command(flatten)]
    pub(crate) device: DeviceArgs,
    /// How a ray is tested against a triangle
    #[arg(long, value_name = "NAME", default_value = "watertight", value_parser = values::intersector(|_| true))]
    pub(crate) intersector: Intersector,
    /// How the tree is made. auto and rebuild build it at --time. refit builds it at --tree-time and moves its boxes to
    /// --time. Hits are the same, only the speed differs
    #[arg(long, value_name = "POLICY", default_value = "auto", value_parser = values::update())]
    pub(crate) update: UpdateName,
    /// With --update refit: time at which the tree is built, in key frames [default: 0]
    #[arg(long, value_name = "T0", value_parser = values::finite::<f64>, allow_hyphen_values = true)]
    pub(crate) tree_time: Option<f64>,
    /// Print no remarks
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

#[derive(Args, Debug)]
pub(crate) struct InspectArgs {
    /// Scene: a demo, files or a directory (`abvh render --help` explains names)
    #[arg(value_parser = values::scene())]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) source: SourceArgs,
    /// Instead, find the fewest key frames whose blends stay within TOL of every key frame, at every vertex. TOL is in
    /// scene units, or in percent of the diagonal of the scene's bounds
    #[arg(long, value_name = "TOL|TOL%", value_parser = tolerance)]
    pub(crate) reduce_keys: Option<Tolerance>,
    /// With --reduce-keys: directory for the key frames as .ply files, and times.json with their times
    #[arg(long, value_name = "DIR", value_parser = values::file())]
    pub(crate) reduced_out: Option<PathBuf>,
    /// JSON to standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// How a scene is read.
#[derive(Args, Debug)]
pub(crate) struct SourceArgs {
    /// Key frames per second that are sampled from a glTF clip
    #[arg(long, value_name = "N", default_value = "24", value_parser = values::number(|fps: f64| fps > 0.0 && fps <= 1000.0,
        "samples a second lie between 0 and 1000"))]
    pub(crate) fps: f64,
    /// glTF clip to sample [default: the first]
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) clip: Option<String>,
    /// Let a scene's files refer to files outside its folder (mtllib of OBJ, URIs of glTF)
    #[arg(long)]
    pub(crate) allow_outside: bool,
    /// Subtract the scene's centre in double precision before coordinates are rounded to single precision. Points and rays
    /// on the command line and in files keep the scene's coordinates
    #[arg(long)]
    pub(crate) recentre: bool,
    /// Memory for key frames, in MiB. Larger sequences are read from disk during playback
    #[arg(long, value_name = "MIB", default_value = "512")]
    pub(crate) key_memory: u32,
}

impl SourceArgs {
    pub(crate) fn options(&self) -> scene::Options {
        scene::Options {
            fps: self.fps,
            clip: self.clip.clone(),
            allow_outside: self.allow_outside,
            recentre: self.recentre,
            key_bytes: u64::from(self.key_memory) << 20,
            ..scene::Options::default()
        }
    }

    /// Returns the options for a run that builds trees and traces `rays` rays at a time. The memory for both counts
    /// towards the limit that is checked before key frames are read.
    pub(crate) fn options_of_run(&self, rays: usize) -> scene::Options {
        scene::Options {
            more_bytes: trees_bytes(0, rays),
            triangle_bytes: TREE_BYTES,
            ..self.options()
        }
    }
}

#[derive(Args, Debug)]
pub(crate) struct DeviceArgs {
    /// Backend
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = values::backend("The best available backend"))]
    pub(crate) backend: BackendChoice,
    /// Adapter of the backend, by index or by part of its name
    #[arg(long, value_name = "INDEX|NAME-PART")]
    pub(crate) adapter: Option<String>,
    /// Threads that render
    #[arg(long, value_name = "N", value_parser = values::threads())]
    pub(crate) threads: Option<usize>,
    /// Threads that build trees
    #[arg(long, value_name = "N", value_parser = values::threads())]
    pub(crate) builder_threads: Option<usize>,
    /// Neither read nor write compiled kernels in the user's cache folder
    #[arg(long)]
    pub(crate) no_cache: bool,
}

/// A backend; `None` leaves the choice to `auto`.
pub(crate) type BackendChoice = Option<BackendName>;

/// Returns the name of a backend on the command line.
pub(crate) fn backend_name(backend: BackendChoice) -> &'static str {
    backend.map_or(values::AUTO, BackendName::name)
}

/// An update policy; `None` leaves the choice to `auto`.
pub(crate) type UpdateName = Option<Policy>;

/// Returns the name of a policy on the command line.
pub(crate) fn update_name(update: UpdateName) -> &'static str {
    update.map_or(values::AUTO, Policy::name)
}

/// How far a vertex may be from where it was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Tolerance {
    /// In scene units.
    Units(f64),
    /// As a fraction of the diagonal of the scene's bounds.
    Share(f64),
}

fn tolerance(text: &str) -> Result<Tolerance, String> {
    const SAYS: &str =
        "a tolerance is a length from 0 on, such as 0.01, or a share of the diagonal, such as 0.1%";
    let is_share = text.ends_with('%');
    let number = values::number(|n: f64| n >= 0.0, SAYS)(text.strip_suffix('%').unwrap_or(text));
    match number.map_err(|_| SAYS)? {
        n if is_share => Ok(Tolerance::Share(n / 100.0)),
        n => Ok(Tolerance::Units(n)),
    }
}

mod idle;
mod measure;
mod removed;
mod render;
#[cfg(test)]
mod tests;

pub(crate) use measure::{BenchArgs, ChartArgs, ConformArgs, MeasureArgs};
pub(crate) use measure::{RaysName, StabilityArgs, StressArgs, TestArgs};
pub(crate) use render::RenderArgs;
