//! Options of what measures, `bench` and `chart`, and of what judges, `conform` and `stability`.

use super::{BackendName, IntersectorName, LayoutName, SourceArgs, ToleranceArgs, UpdateName};
use crate::values::{self, Frames, TimeRange};
use backend::Intersector;
use clap::builder::{ArgPredicate, PossibleValuesParser, RangedU64ValueParser, TypedValueParser};
use clap::{Args, ValueEnum};
use conformance::stress::Plan;
use conformance::{OWN_TREE_PROPERTIES, PROPERTIES};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// What `bench` and `chart` measure. Each has defaults of its own.
#[derive(Args, Debug)]
pub(crate) struct MeasureArgs {
    /// Scenes; `abvh render --help` tells how they are named
    #[arg(value_parser = values::scene())]
    pub(crate) scenes: Vec<String>,
    #[command(flatten)]
    pub(crate) source: SourceArgs,
    /// Backends
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    #[arg(default_value = "auto")]
    pub(crate) backend: Vec<BackendName>,
    /// Update policies
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    #[arg(default_value = "rebuild,refit,async")]
    pub(crate) update: Vec<UpdateName>,
    /// Intersectors
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) intersector: Vec<IntersectorName>,
    /// Frames of each run: N spread evenly over the time range, or those at key times A..B
    #[arg(long, value_name = "N|A..B", value_parser = values::frames)]
    pub(crate) frames: Frames,
    /// Pixels of a frame
    #[arg(long, value_name = "WxH", value_parser = values::size, default_value = "1280x720")]
    pub(crate) size: [u32; 2],
    /// Seconds for which a device repeats the first frame of each run, uncounted, before the others. It goes on until that
    /// takes as long as before, for half a second at most. 0 leaves it out [default: 0.7 on a GPU]
    #[arg(long, value_name = "SECONDS",
        value_parser = values::number(|s: f64| (0.0..=60.0).contains(&s), "a warm-up lasts from 0 to 60 seconds"))]
    pub(crate) warm_up: Option<f64>,
    /// No progress and no remarks
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

#[derive(Args, Debug)]
#[command(mut_arg("scenes", |arg| arg.default_values(["demo:grove", "demo:collide"])))]
#[command(mut_arg("frames", |arg| arg.required(false).default_value("24")))]
#[command(mut_arg("size", |arg| arg.default_value("640x360")))]
#[command(mut_arg("intersector", |arg| arg.help("Intersectors [with --tolerance: auto]").default_value("watertight")
    .default_value_if("tolerance", ArgPredicate::IsPresent, "auto")))]
pub(crate) struct BenchArgs {
    #[command(flatten)]
    pub(crate) measure: MeasureArgs,
    /// With async: what trees are built for, as for render; 'on,off' measures both
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "on", value_parser = values::switch())]
    pub(crate) predict: Vec<bool>,
    /// Layouts of the tree
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    #[arg(default_value = "auto")]
    pub(crate) layout: Vec<LayoutName>,
    #[command(flatten)]
    pub(crate) tolerance: ToleranceArgs,
    /// Run that the others are compared with, by words of its row in order, such as 'vulkan-rt refit' [default: the
    /// first of each scene]
    #[arg(long, value_name = "WORDS")]
    pub(crate) against: Option<String>,
    /// Rays: a camera's with their shadows, or as many from anywhere in the scene's box in any direction. Those at random
    /// seek the closest hit, without a shadow, and are the same in every frame
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    #[arg(default_value = "camera")]
    pub(crate) rays: Vec<RaysName>,
    /// Stretch of time, in key frames [default: all of it]
    #[arg(long, value_name = "T0..T1", value_parser = values::time_range, allow_hyphen_values = true)]
    pub(crate) time_range: Option<TimeRange>,
    /// Adapter of the backends, by index or by part of its name
    #[arg(long, value_name = "INDEX|NAME-PART")]
    pub(crate) adapter: Option<String>,
    /// Threads that render
    #[arg(long, value_name = "N", value_parser = values::threads())]
    pub(crate) threads: Option<usize>,
    /// Threads that build trees; '2,16' measures both [default: as for render]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::threads())]
    pub(crate) builder_threads: Vec<usize>,
    /// Instead, compare two files of results (of bench, or of render --stats): medians, ratios, and whether
    /// they differ by more than noise
    #[arg(long, num_args = 2, value_names = ["OLD.json", "NEW.json"])]
    pub(crate) compare: Vec<PathBuf>,
    /// With --compare: exit with 1 if a frame takes longer by more than so many per cent, noise apart
    #[arg(long, value_name = "PCT", value_parser = values::number(|p: f64| p >= 0.0, "per cent are a number from 0"))]
    pub(crate) fail_above: Option<f64>,
    /// File for the results, frame by frame
    #[arg(long, value_name = "FILE", value_parser = values::file())]
    pub(crate) json: Option<PathBuf>,
    /// File for the results as a table, a row a run
    #[arg(long, value_name = "FILE", value_parser = values::file())]
    pub(crate) csv: Option<PathBuf>,
}

#[derive(Args, Debug)]
#[command(mut_arg("scenes", |arg| arg.default_value("demo:collide")))]
#[command(mut_arg("backend", |arg| arg.help("Backends; auto is the host's cores and every backend that finds a GPU")))]
#[command(mut_arg("frames", |arg| arg.required(false).default_value("12")))]
#[command(mut_arg("size", |arg| arg.default_value("640x400")))]
#[command(mut_arg("intersector", |arg| arg.default_value("moller-trumbore,woop,watertight,exact")))]
pub(crate) struct ChartArgs {
    #[command(flatten)]
    pub(crate) measure: MeasureArgs,
    /// Directory for chart.svg, chart.html, points.csv and points.json
    #[arg(long, value_name = "DIR", default_value = "abvh-chart", value_parser = values::file())]
    pub(crate) out: PathBuf,
    /// The most rays of each scene whose answers are compared with exact arithmetic, half of them a camera's, half at
    /// random. A quarter as many more are aimed at edges and vertices. Fewer are traced where they tell intersectors apart
    #[arg(long, value_name = "N", default_value = "2000000", value_parser = values::rays())]
    pub(crate) rays: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RaysName {
    /// Through each pixel, and from there to the light
    Camera,
    /// From anywhere in the scene's box in any direction
    Random,
}

#[derive(Args, Debug)]
pub(crate) struct TestArgs {
    /// Backends; auto is all that are present, for stability but vulkan-rt
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    #[arg(default_value = "auto")]
    pub(crate) backend: Vec<BackendName>,
    /// Adapter of the backends, by index or by part of its name
    #[arg(long, value_name = "INDEX|NAME-PART")]
    pub(crate) adapter: Option<String>,
    /// File for the results
    #[arg(long, value_name = "FILE", value_parser = values::file())]
    pub(crate) json: Option<PathBuf>,
    /// No progress
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

#[derive(Args, Debug)]
pub(crate) struct ConformArgs {
    /// Scenes that rays of --oracle-rays are aimed at, beside the meshes made from the seed
    #[arg(value_name = "SCENE", value_parser = values::scene())]
    pub(crate) scene: Vec<String>,
    /// Let a scene's files name files outside its folder (mtllib of OBJ, URIs of glTF)
    #[arg(long)]
    pub(crate) allow_outside: bool,
    #[command(flatten)]
    pub(crate) test: TestArgs,
    /// Decides scenes and rays
    #[arg(long, value_name = "S", default_value = "1")]
    pub(crate) seed: u64,
    /// Random cases that each property is tried on; 0 tries no property, only what else is asked for
    #[arg(long, value_name = "N", default_value = "36", conflicts_with = "case")]
    pub(crate) cases: u32,
    /// Try only these properties, by name; a name that is none is answered by all that there are
    #[arg(long, value_name = "LIST", value_delimiter = ',', hide_possible_values = true,
        value_parser = PossibleValuesParser::new(property_names()))]
    pub(crate) property: Vec<String>,
    /// Only the case of this number
    #[arg(long, value_name = "N")]
    pub(crate) case: Option<u32>,
    /// Also aim so many rays, in all, at edges and vertices of closed bodies, where none may slip through
    #[arg(long, value_name = "N", default_value = "0")]
    pub(crate) leak_rays: u64,
    /// Also compare so many rays, in all, with exact answers. Meshes of many kinds are near and far, huge and tiny.
    /// Rays go at insides, edges and vertices, in planes, along axes, from surfaces and from afar. A wrong answer
    /// of exact is a disagreement, one of watertight is counted
    #[arg(long, value_name = "N", default_value = "0")]
    pub(crate) oracle_rays: u64,
    /// Of those rays, only the batch of this number
    #[arg(long, value_name = "B")]
    pub(crate) oracle_batch: Option<u64>,
    /// How those rays are traced [default: exact for --oracle-rays, watertight for --leak-rays]
    #[arg(long, value_name = "INTERSECTOR",
        value_parser = PossibleValuesParser::new(["watertight", "exact"]).try_map(|name| name.parse::<Intersector>()))]
    pub(crate) intersector: Option<Intersector>,
}

#[derive(Args, Debug)]
pub(crate) struct StabilityArgs {
    #[command(flatten)]
    pub(crate) test: TestArgs,
    /// Intersectors
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    #[arg(default_value = "moller-trumbore,woop,watertight,exact")]
    pub(crate) intersector: Vec<Intersector>,
    /// Decides scenes and rays
    #[arg(long, value_name = "S", default_value_t = Plan::default().seed)]
    pub(crate) seed: u64,
    /// Rays of each family
    #[arg(long, value_name = "N", default_value_t = Plan::default().rays,
        value_parser = RangedU64ValueParser::<u32>::new().range(1..=1_000_000))]
    pub(crate) rays: u32,
    /// Check nothing; instead measure how often one backend's arithmetic errs, and write it to this file. That is
    /// the baseline which later checks of such devices are held to
    #[arg(long, value_name = "FILE", value_parser = values::file(), conflicts_with_all = ["json", "intersector", "seed", "rays"])]
    pub(crate) record: Option<PathBuf>,
    /// With --record: seeds to measure, from 1
    #[arg(long, value_name = "N", default_value = "32", requires = "record",
        value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) seeds: u64,
}

#[derive(Args, Debug)]
pub(crate) struct StressArgs {
    /// Scene whose motion is streamed; `abvh render --help` explains how scenes are named
    #[arg(default_value = "demo:collide", value_parser = values::scene())]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) source: SourceArgs,
    #[command(flatten)]
    pub(crate) test: TestArgs,
    /// Update policies: async, refit, rebuild
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "async,refit"
    )]
    pub(crate) update: Vec<UpdateName>,
    /// Timed steps of each run
    #[arg(long, value_name = "N", default_value = "1000",
        value_parser = RangedU64ValueParser::<usize>::new().range(1..=10_000_000))]
    pub(crate) steps: usize,
    /// Poses over the whole motion, played forwards and backwards: fewer poses are faster motion
    #[arg(long, value_name = "N", default_value = "256",
        value_parser = RangedU64ValueParser::<usize>::new().range(1..=100_000))]
    pub(crate) poses: usize,
    /// Rays of a step: a camera's, or as many at random from anywhere in the scene's box
    #[arg(long, value_name = "NAME", default_value = "camera")]
    pub(crate) rays: RaysName,
    /// Pixels of the camera
    #[arg(long, value_name = "WxH", value_parser = values::size, default_value = "640x480")]
    pub(crate) size: [u32; 2],
}

fn property_names() -> BTreeSet<&'static str> {
    PROPERTIES
        .iter()
        .chain(OWN_TREE_PROPERTIES)
        .map(|l| l.name)
        .collect()
}
