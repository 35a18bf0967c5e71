//! What may be asked of `crossover`.

use super::{BackendName, LayoutsArgs, SizeArgs, TrianglesArgs, UpdateName, WarmUpArgs};
use crate::values;
use clap::Args;
use std::path::PathBuf;

/// Options of `crossover`.
#[derive(Args, Debug)]
#[command(mut_arg("triangles", |arg| arg.default_value("10K,70K,250K,1.6M")))]
#[command(mut_arg("layout", |arg| arg.default_value("bvh2,fast")))]
pub(crate) struct CrossoverArgs {
    /// Demos, without a number of triangles
    #[arg(default_values = ["demo:collide", "demo:shatter"], value_parser = values::demo)]
    pub(crate) scenes: Vec<String>,
    #[command(flatten)]
    pub(crate) triangles: TrianglesArgs,
    /// Speeds of the motion, in key frames a frame
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "0.0125,0.125,0.5", value_parser = values::speed)]
    pub(crate) speeds: Vec<f64>,
    /// Threads that build trees for async [default: 2,4,16, as far as the machine has them]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::threads)]
    pub(crate) threads: Vec<usize>,
    /// Update policies that async is compared with
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "device-rebuild,t-sah,refit"
    )]
    pub(crate) against: Vec<UpdateName>,
    #[command(flatten)]
    pub(crate) layouts: LayoutsArgs,
    #[command(flatten)]
    pub(crate) timing: TimingArgs,
    /// File for the results
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

/// What commands share that set policies beside each other.
#[derive(Args, Debug)]
pub(crate) struct TimingArgs {
    /// Backend
    #[arg(long, value_name = "NAME", default_value = "auto")]
    pub(crate) backend: BackendName,
    /// Adapter of the backend, by index or by part of its name
    #[arg(long, value_name = "INDEX|NAME-PART")]
    pub(crate) adapter: Option<String>,
    /// Frames of each run, to and fro through the motion; the first, which makes the first tree, does not count
    #[arg(long, value_name = "N", default_value = "96", value_parser = values::count)]
    pub(crate) frames: usize,
    #[command(flatten)]
    pub(crate) size: SizeArgs,
    #[command(flatten)]
    pub(crate) warm_up: WarmUpArgs,
    /// Seconds that one run may take. A run that takes longer ends early, after three frames or more, and its time
    /// is marked
    #[arg(long, value_name = "SECONDS", default_value = "3", value_parser = values::seconds)]
    pub(crate) patience: f64,
    /// Seconds that the first tree of a run may take to build. What would take longer is left out, with a remark
    #[arg(long, value_name = "SECONDS", default_value = "20", value_parser = values::seconds)]
    pub(crate) longest_build: f64,
    /// No progress
    #[arg(long, short)]
    pub(crate) quiet: bool,
}
