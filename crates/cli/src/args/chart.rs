//! What may be asked of `chart`.

use super::{BackendName, IntersectorName, PoliciesArgs, SizeArgs, SourceArgs, WarmUpArgs};
use crate::values::{self, Frames};
use clap::Args;
use std::path::PathBuf;

/// Options of `chart`.
#[derive(Args, Debug)]
#[command(mut_arg("update", |arg| arg.default_value("rebuild,refit,async")))]
#[command(mut_arg("size", |arg| arg.default_value("640x400")))]
pub(crate) struct ChartArgs {
    /// Scenes; `abvh render --help` tells how they are named
    #[arg(default_value = "demo:collide", value_parser = values::scene())]
    pub(crate) scenes: Vec<String>,
    #[command(flatten)]
    pub(crate) source: SourceArgs,
    /// Directory for chart.svg, chart.html, points.csv and points.json
    #[arg(long, value_name = "DIR", default_value = "abvh-chart", value_parser = values::file())]
    pub(crate) out: PathBuf,
    /// Backends; auto is the host's cores and every backend that finds a GPU
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "auto"
    )]
    pub(crate) backend: Vec<BackendName>,
    /// Intersectors
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "moller-trumbore,woop,watertight,exact"
    )]
    pub(crate) intersector: Vec<IntersectorName>,
    #[command(flatten)]
    pub(crate) policies: PoliciesArgs,
    /// Frames that are timed: N spread evenly over the motion, or those at key times A..B. The first, which makes the first
    /// tree, does not count
    #[arg(long, value_name = "N|A..B", default_value = "12", value_parser = values::frames)]
    pub(crate) frames: Frames,
    #[command(flatten)]
    pub(crate) size: SizeArgs,
    #[command(flatten)]
    pub(crate) warm_up: WarmUpArgs,
    /// Rays of each scene whose answers are compared with exact arithmetic, half of them a camera's, half at random.
    /// A quarter as many more are aimed at edges and vertices
    #[arg(long, value_name = "N", default_value = "2000000", value_parser = values::rays)]
    pub(crate) rays: usize,
    /// No progress and no remarks
    #[arg(long, short)]
    pub(crate) quiet: bool,
}
