//! Options of what measures: `bench` and `chart`.

use super::{
    BackendName, IntersectorName, LayoutName, PoliciesArgs, SizeArgs, SourceArgs, Switch,
    ToleranceArgs, WarmUpArgs,
};
use crate::values::{self, Frames, TimeRange};
use clap::builder::ArgPredicate;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

#[derive(Args, Debug)]
#[command(mut_arg("update", |arg| arg.default_value("rebuild,refit,async")))]
#[command(mut_arg("size", |arg| arg.default_value("640x360")))]
pub(crate) struct BenchArgs {
    /// Scenes; `abvh render --help` tells how they are named
    #[arg(default_values = ["demo:grove", "demo:collide"], value_parser = values::scene())]
    pub(crate) scenes: Vec<String>,
    #[command(flatten)]
    pub(crate) source: SourceArgs,
    /// Backends
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "auto"
    )]
    pub(crate) backend: Vec<BackendName>,
    #[command(flatten)]
    pub(crate) policies: PoliciesArgs,
    /// With async: what trees are built for, as for render; 'on,off' measures both
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "on")]
    pub(crate) predict: Vec<Switch>,
    /// Intersectors [with --tolerance: auto]
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "watertight",
        default_value_if("tolerance", ArgPredicate::IsPresent, "auto")
    )]
    pub(crate) intersector: Vec<IntersectorName>,
    /// Layouts of the tree
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "auto"
    )]
    pub(crate) layout: Vec<LayoutName>,
    #[command(flatten)]
    pub(crate) tolerance: ToleranceArgs,
    /// Run that the others are compared with, by words of its row in order, such as 'vulkan-rt refit' [default: the
    /// first of each scene]
    #[arg(long, value_name = "WORDS")]
    pub(crate) against: Option<String>,
    /// Rays: a camera's with their shadows, or as many from anywhere in the scene's box in any direction. Those at random
    /// seek the closest hit, without a shadow, and are the same in every frame
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "camera"
    )]
    pub(crate) rays: Vec<RaysName>,
    #[command(flatten)]
    pub(crate) size: SizeArgs,
    /// Frames of each run: N spread evenly over the time range, or those at key times A..B
    #[arg(long, value_name = "N|A..B", default_value = "24", value_parser = values::frames)]
    pub(crate) frames: Frames,
    /// Stretch of time, in key frames [default: all of it]
    #[arg(long, value_name = "T0..T1", value_parser = values::time_range, allow_hyphen_values = true)]
    pub(crate) time_range: Option<TimeRange>,
    #[command(flatten)]
    pub(crate) warm_up: WarmUpArgs,
    /// Adapter of the backends, by index or by part of its name
    #[arg(long, value_name = "INDEX|NAME-PART")]
    pub(crate) adapter: Option<String>,
    /// Threads that render
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub(crate) threads: Option<usize>,
    /// Threads that build trees; '2,16' measures both [default: as for render]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::threads)]
    pub(crate) builder_threads: Vec<usize>,
    /// Instead, compare two files of results (of bench, or of render --stats): medians, ratios, and whether
    /// they differ by more than noise
    #[arg(long, num_args = 2, value_names = ["OLD.json", "NEW.json"])]
    pub(crate) compare: Vec<PathBuf>,
    /// With --compare: exit with 1 if a frame takes longer by more than so many per cent, noise apart
    #[arg(long, value_name = "PCT", value_parser = values::percent)]
    pub(crate) fail_above: Option<f64>,
    /// File for the results, frame by frame
    #[arg(long, value_name = "FILE", value_parser = values::file())]
    pub(crate) json: Option<PathBuf>,
    /// File for the results as a table, a row a run
    #[arg(long, value_name = "FILE", value_parser = values::file())]
    pub(crate) csv: Option<PathBuf>,
    /// No progress
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

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

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RaysName {
    /// Through each pixel, and from there to the light
    Camera,
    /// From anywhere in the scene's box in any direction
    Random,
}
