//! Options of the commands that measure (`bench`, `chart`, `stress`) and that check (`conform`, `stability`).

use super::{BackendChoice, SourceArgs, UpdateName};
use crate::values::{self, Frames, TimeRange};
use backend::Intersector;
use clap::builder::{PossibleValuesParser, RangedU64ValueParser, TypedValueParser};
use clap::{Args, ValueEnum};
use conformance::PROPERTIES;
use conformance::stress::Plan;
use rivals::Known;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Options that `bench` and `chart` share. Each command sets its own defaults.
#[derive(Args, Debug)]
pub(crate) struct MeasureArgs {
    /// Scenes (`abvh render --help` explains names)
    #[arg(value_parser = values::scene())]
    pub(crate) scenes: Vec<String>,
    #[command(flatten)]
    pub(crate) source: SourceArgs,
    /// Backends
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::backend("The best available backend"))]
    #[arg(default_value = "auto")]
    pub(crate) backend: Vec<BackendChoice>,
    /// Ray tracers of others to measure too. Each keeps its own trees, so only rebuild and refit apply
    #[arg(long, value_name = "LIST", value_delimiter = ',',
        value_parser = PossibleValuesParser::new(rivals::RIVALS.iter().map(|rival| rival.name)).map(known_rival))]
    pub(crate) rival: Vec<&'static Known>,
    /// Update policies
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::update())]
    #[arg(default_value = "rebuild,refit,async")]
    pub(crate) update: Vec<UpdateName>,
    /// Intersectors
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::intersector(|_| true))]
    pub(crate) intersector: Vec<Intersector>,
    /// Frames of each run: N spread evenly over the time range, or those at key times A..B
    #[arg(long, value_name = "N|A..B", value_parser = values::frames)]
    pub(crate) frames: Frames,
    /// Frame size in pixels
    #[arg(long, value_name = "WxH", value_parser = values::size, default_value = "1280x720")]
    pub(crate) size: [u32; 2],
    /// Seconds for which a device repeats the first frame of each run before frames are timed. Warm-up continues until
    /// frame times are steady, for 0.5 s at most. 0 disables it [default: 0.7 on a GPU]
    #[arg(long, value_name = "SECONDS",
        value_parser = values::number(|s: f64| (0.0..=60.0).contains(&s), "a warm-up lasts from 0 to 60 seconds"))]
    pub(crate) warm_up: Option<f64>,
    /// Print no progress and no remarks
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

#[derive(Args, Debug)]
#[command(mut_arg("scenes", |arg| arg.default_values(["demo:grove", "demo:collide"])))]
#[command(mut_arg("frames", |arg| arg.required(false).default_value("24")))]
#[command(mut_arg("size", |arg| arg.default_value("640x360")))]
#[command(mut_arg("intersector", |arg| arg.default_value("watertight")))]
pub(crate) struct BenchArgs {
    #[command(flatten)]
    pub(crate) measure: MeasureArgs,
    /// With async: whether trees are built ahead, as for render; 'on,off' measures both
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "on", value_parser = values::switch())]
    pub(crate) predict: Vec<bool>,
    /// Run that the others are compared with, by words of its row in order, such as 'wgpu refit' [default: the
    /// first of each scene]
    #[arg(long, value_name = "WORDS")]
    pub(crate) against: Option<String>,
    /// Rays: a camera's primary and shadow rays, or as many random rays from points in the scene's bounds. Random rays
    /// find the closest hit, cast no shadow ray, and are the same in every frame
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    #[arg(default_value = "camera")]
    pub(crate) rays: Vec<RaysName>,
    /// Time range, in key frames [default: the whole motion]
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
    /// Instead, compare two result files of bench or of render --stats: medians, ratios, and whether differences exceed
    /// noise
    #[arg(long, num_args = 2, value_names = ["OLD.json", "NEW.json"])]
    pub(crate) compare: Vec<PathBuf>,
    /// With --compare: exit with 1 if frames take more than PCT percent longer, and by more than noise
    #[arg(long, value_name = "PCT", value_parser = values::number(|p: f64| p >= 0.0, "per cent are a number from 0"))]
    pub(crate) fail_above: Option<f64>,
    /// JSON file for the results of every frame
    #[arg(long, value_name = "FILE", value_parser = values::file())]
    pub(crate) json: Option<PathBuf>,
    /// CSV file for the results, one row per run
    #[arg(long, value_name = "FILE", value_parser = values::file())]
    pub(crate) csv: Option<PathBuf>,
}

#[derive(Args, Debug)]
#[command(mut_arg("scenes", |arg| arg.default_value("demo:collide")))]
#[command(mut_arg("backend", |arg| arg.help("Backends; auto is the host's cores and every backend that finds a GPU")))]
#[command(mut_arg("frames", |arg| arg.required(false).default_value("12")))]
#[command(mut_arg("size", |arg| arg.default_value("640x400")))]
#[command(mut_arg("intersector", |arg| arg.default_values(Intersector::ALL.map(Intersector::name))))]
pub(crate) struct ChartArgs {
    #[command(flatten)]
    pub(crate) measure: MeasureArgs,
    /// Directory for chart.svg, chart.html, points.csv and points.json
    #[arg(long, value_name = "DIR", default_value = "abvh-chart", value_parser = values::file())]
    pub(crate) out: PathBuf,
    /// Maximum number of rays per scene that are compared with exact arithmetic: half from a camera, half random. A
    /// quarter as many again are aimed at edges and vertices. Fewer are traced if the intersectors' rates differ clearly
    #[arg(long, value_name = "N", default_value = "2000000", value_parser = values::rays())]
    pub(crate) rays: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RaysName {
    /// Primary rays through each pixel, and their shadow rays
    Camera,
    /// Random origins in the scene's bounds, random directions
    Random,
}

#[derive(Args, Debug)]
pub(crate) struct TestArgs {
    /// Backends; auto is all that are present, except the reference
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::backend("All that are present"))]
    #[arg(default_value = "auto")]
    pub(crate) backend: Vec<BackendChoice>,
    /// Adapter of the backends, by index or by part of its name
    #[arg(long, value_name = "INDEX|NAME-PART")]
    pub(crate) adapter: Option<String>,
    /// JSON file for the results
    #[arg(long, value_name = "FILE", value_parser = values::file())]
    pub(crate) json: Option<PathBuf>,
    /// Print no progress
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

#[derive(Args, Debug)]
pub(crate) struct ConformArgs {
    /// Scenes for --oracle-rays, in addition to the meshes generated from the seed
    #[arg(value_name = "SCENE", value_parser = values::scene())]
    pub(crate) scene: Vec<String>,
    /// Let a scene's files refer to files outside its folder (mtllib of OBJ, URIs of glTF)
    #[arg(long)]
    pub(crate) allow_outside: bool,
    #[command(flatten)]
    pub(crate) test: TestArgs,
    /// Seed of the generated scenes and rays
    #[arg(long, value_name = "S", default_value = "1")]
    pub(crate) seed: u64,
    /// Random cases per property; 0 tests no property and runs only the other requested checks
    #[arg(long, value_name = "N", default_value = "36", conflicts_with = "case")]
    pub(crate) cases: u32,
    /// Test only these properties, by name. An unknown name prints the valid ones
    #[arg(long, value_name = "LIST", value_delimiter = ',', hide_possible_values = true,
        value_parser = PossibleValuesParser::new(property_names()))]
    pub(crate) property: Vec<String>,
    /// Test only the case of this number
    #[arg(long, value_name = "N")]
    pub(crate) case: Option<u32>,
    /// Also aim N rays in total at edges and vertices of closed meshes, where no ray may leak through
    #[arg(long, value_name = "N", default_value = "0")]
    pub(crate) leak_rays: u64,
    /// Also compare N rays in total with exact answers, on meshes of many kinds, near and far, huge and tiny. Rays are
    /// aimed at interiors, edges and vertices, within planes, along axes, from surfaces and from far away. A wrong
    /// answer of exact is a disagreement; wrong answers of watertight are counted
    #[arg(long, value_name = "N", default_value = "0")]
    pub(crate) oracle_rays: u64,
    /// With --oracle-rays: only the batch of this number
    #[arg(long, value_name = "B")]
    pub(crate) oracle_batch: Option<u64>,
    /// Intersector of aimed rays [default: exact for --oracle-rays, watertight for --leak-rays]
    #[arg(long, value_name = "INTERSECTOR",
        value_parser = values::intersector(Intersector::is_equal_across_backends))]
    pub(crate) intersector: Option<Intersector>,
}

#[derive(Args, Debug)]
pub(crate) struct StabilityArgs {
    #[command(flatten)]
    pub(crate) test: TestArgs,
    /// Intersectors
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::intersector(|_| true))]
    #[arg(default_values = Intersector::ALL.map(Intersector::name))]
    pub(crate) intersector: Vec<Intersector>,
    /// Seed of the generated scenes and rays
    #[arg(long, value_name = "S", default_value_t = Plan::default().seed)]
    pub(crate) seed: u64,
    /// Rays of each family
    #[arg(long, value_name = "N", default_value_t = Plan::default().rays,
        value_parser = RangedU64ValueParser::<u32>::new().range(1..=1_000_000))]
    pub(crate) rays: u32,
    /// Instead of checking, measure the error rates of one backend's arithmetic and write them to this file. Later
    /// checks of devices with this arithmetic use the rates as baseline
    #[arg(long, value_name = "FILE", value_parser = values::file(), conflicts_with_all = ["json", "intersector", "seed", "rays"])]
    pub(crate) record: Option<PathBuf>,
    /// With --record: measure the seeds from 1 to N
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
    /// Update policies
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::update())]
    #[arg(default_value = "async,refit")]
    pub(crate) update: Vec<UpdateName>,
    /// Timed steps of each run
    #[arg(long, value_name = "N", default_value = "1000",
        value_parser = RangedU64ValueParser::<usize>::new().range(1..=10_000_000))]
    pub(crate) steps: usize,
    /// Number of poses over the whole motion, played forwards and backwards; fewer poses give faster motion
    #[arg(long, value_name = "N", default_value = "256",
        value_parser = RangedU64ValueParser::<usize>::new().range(1..=100_000))]
    pub(crate) poses: usize,
    /// Rays of a step: a camera's, or as many random rays from points in the scene's bounds
    #[arg(long, value_name = "NAME", default_value = "camera")]
    pub(crate) rays: RaysName,
    /// Camera size in pixels
    #[arg(long, value_name = "WxH", value_parser = values::size, default_value = "640x480")]
    pub(crate) size: [u32; 2],
}

fn property_names() -> BTreeSet<&'static str> {
    PROPERTIES.iter().map(|property| property.name).collect()
}

/// Returns the rival of a name in the list of rivals.
fn known_rival(name: String) -> &'static Known {
    rivals::known(&name).expect("the parser admits names of rivals only")
}
