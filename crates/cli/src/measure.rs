//! Measures frames on one of our backends or on a rival, for `bench` and `chart`.

mod rays;
pub(crate) mod rival;
mod timing;

use crate::camera::{CameraSettings, LitCamera};
use crate::command::Requirement;
use crate::console::ProgressLine;
use crate::devices::{BackendChoice, DeviceSettings, backend_name};
use crate::error::CliError;
use crate::frame_list::{self, FrameChoice, TimeRange};
use crate::parsers;
use crate::scene_source::{self, SceneSettings};
use crate::setup::{self, Setup, Started};
use crate::tracer_settings::{PolicyChoice, TracerSettings, Workload, policy_name};
use backend::{DeviceBytes, Hits, Intersector, Query};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use geom::Animation;
use output::plot::Failure;
use output::{FrameQuantity, Summary, TIMES, mrays};
use pipeline::{Driver, Frame, FrameRecord, Warmed};
pub(crate) use rays::{FrameRays, MeasuredRays};
use rival::{RIVAL_INTERSECTOR, RivalSettings, RunningRival};
use rivals::{RivalName, TreeUpdate};
use scene::Scene;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;
use timing::{TimedFrames, TimingPlan, trace_frame};

/// Options that `bench` and `chart` share. Each command sets its own defaults for some of them.
#[derive(Args, Debug)]
pub(crate) struct MeasureSettings {
    /// Scenes (`abvh render --help` explains names)
    #[arg(value_parser = parsers::scene())]
    pub(crate) scenes: Vec<String>,
    #[command(flatten)]
    pub(crate) source: SceneSettings,
    /// Backends
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = parsers::AUTO, value_parser = parsers::backend("The best available backend"))]
    pub(crate) backend: Vec<BackendChoice>,
    /// Third-party ray tracers to measure as well. Each builds its own trees, so only rebuild and refit apply
    #[arg(long, value_name = "LIST", value_delimiter = ',',
        value_parser = PossibleValuesParser::new(RivalName::ALL.map(RivalName::name)).map(known_rival))]
    pub(crate) rival: Vec<RivalName>,
    /// Update policies
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "rebuild,refit,async", value_parser = parsers::update(|_| true))]
    pub(crate) update: Vec<PolicyChoice>,
    /// Intersectors
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parsers::intersector())]
    pub(crate) intersector: Vec<Intersector>,
    /// Frames of each run: N spread evenly over the time range, or the key times A..B, without B. Or a list of key
    /// times, such as 1,4,10-20x2 (10 to 20 in steps of 2)
    #[arg(long, value_name = "N|A..B|LIST")]
    pub(crate) frames: FrameChoice,
    /// Time range, in key frames [default: the whole motion]
    #[arg(long, value_name = "T0..T1", allow_hyphen_values = true)]
    time_range: Option<TimeRange>,
    #[command(flatten)]
    pub(crate) camera: CameraSettings,
    /// Warm-up: seconds for which a device repeats the traces of the first frame of each run before the other frames
    /// are timed. Warm-up then continues until frame times are steady, for at most 0.5 s more. 0 disables it. The
    /// host's backends are never warmed up [default: 0.7 on a GPU]
    #[arg(long, value_name = "SECONDS",
        value_parser = parsers::number(|s: f64| (0.0..=60.0).contains(&s), "a warm-up lasts from 0 to 60 seconds"))]
    pub(crate) warm_up: Option<f64>,
    /// Print no progress and no remarks
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

fn known_rival(name: String) -> RivalName {
    RivalName::named(&name).expect("the parser admits names of rivals only")
}

/// A scene, and the frames that are measured.
pub(crate) struct MeasuredScene {
    /// Name on the command line.
    pub(crate) name: String,
    pub(crate) scene: Scene,
    pub(crate) frames: Vec<Frame>,
    pub(crate) lit_camera: LitCamera,
}

impl MeasureSettings {
    /// Opens a scene, and lists the frames to measure.
    pub(crate) fn open(&self, name: &str) -> Result<MeasuredScene, CliError> {
        let scene = self.source.open(name, self.camera.pixels())?;
        let keys = scene.animation.key_count();
        Ok(MeasuredScene {
            name: name.to_owned(),
            frames: frame_list::list(Some(&self.frames), self.time_range, keys, false)?,
            lit_camera: self.camera.aim(&scene)?,
            scene,
        })
    }

    pub(crate) fn requirements(&self) -> Vec<Requirement> {
        scene_source::requirements(&self.scenes)
    }
}

/// A backend or a rival, with its settings.
#[derive(Clone, Debug)]
pub(crate) enum Contender {
    Ours(TracerSettings),
    Rival(RivalSettings),
}

/// The contenders of a measurement, and remarks on combinations that are skipped.
#[derive(Debug, Default)]
pub(crate) struct Contenders {
    pub(crate) all: Vec<Contender>,
    pub(crate) skipped: Vec<String>,
}

impl Contenders {
    /// Adds every rival on a device with each requested policy that it supports, and a remark for each other policy.
    pub(crate) fn add_rivals(&mut self, settings: &MeasureSettings, device: &DeviceSettings) {
        for &rival in &settings.rival {
            for policy in settings.update.iter().copied().map(policy_name) {
                if let Some(tree_update) = TreeUpdate::ALL.into_iter().find(|u| u.name() == policy)
                {
                    self.all.push(Contender::Rival(RivalSettings {
                        rival,
                        tree_update,
                        device: device.clone(),
                    }));
                } else {
                    let why = "is skipped: it keeps its own tree, which it rebuilds or refits in each frame";
                    self.skipped
                        .push(format!("{} with {policy} {why}", rival.name()));
                }
            }
        }
    }
}

impl Contender {
    /// Returns the names of the backend, the intersector and the policy on the command line.
    fn names(&self) -> [&'static str; 3] {
        match self {
            Self::Ours(tracer) => [
                backend_name(tracer.backend),
                tracer.intersector.name(),
                policy_name(tracer.update),
            ],
            Self::Rival(settings) => [
                settings.rival.name(),
                RIVAL_INTERSECTOR,
                settings.tree_update.name(),
            ],
        }
    }
}

/// Writes the backend, the intersector and the policy as requested. `auto` is not resolved.
impl fmt::Display for Contender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.names().join(" "))
    }
}

/// A contender and the rays that it traces.
pub(crate) struct Run {
    pub(crate) contender: Contender,
    pub(crate) rays: MeasuredRays,
}

/// The progress of a command that measures, and its failures.
pub(crate) struct RunLog {
    pub(crate) progress: ProgressLine,
    pub(crate) failures: Vec<Failure>,
    /// The errors of all failures.
    pub(crate) errors: Vec<CliError>,
}

impl RunLog {
    pub(crate) fn new(steps: usize, quiet: bool) -> Self {
        Self {
            progress: ProgressLine::new(steps as u64, quiet),
            failures: Vec::new(),
            errors: Vec::new(),
        }
    }

    /// Adds a failure, and counts it as a step of the progress.
    pub(crate) fn fail(&mut self, scene: &str, run: &Run, error: CliError) {
        let [backend, intersector, update] = run.contender.names().map(str::to_owned);
        let failure = Failure {
            scene: scene.to_owned(),
            backend,
            intersector,
            update,
            rays: run.rays.name_unless_camera(),
            error: error.to_string(),
        };
        self.progress.step(&failure.to_string());
        self.failures.push(failure);
        self.errors.push(error);
    }
}

/// A backend or a rival with a scene loaded.
pub(crate) enum LoadedScene {
    Ours(Box<Driver>),
    Rival(RunningRival),
}

impl LoadedScene {
    pub(crate) fn load(
        contender: &Contender,
        animation: &Arc<Animation>,
    ) -> Result<Self, CliError> {
        match contender {
            Contender::Ours(tracer) => {
                let started = setup::start_driver(animation, tracer, Workload::default())?;
                Ok(Self::Ours(Box::new(started.tracer)))
            }
            Contender::Rival(settings) => {
                let rival = RunningRival::start(settings, animation)?;
                Ok(Self::Rival(rival))
            }
        }
    }

    /// Traces a query at `time`, in key frames, and returns its hits.
    pub(crate) fn trace(&mut self, time: f64, query: Query<'_>) -> Result<Hits, CliError> {
        match self {
            Self::Ours(driver) => trace_frame(driver, Frame { index: 0, time }, query),
            Self::Rival(rival) => rival.hits(time, query),
        }
    }
}

impl MeasureSettings {
    /// Measures every run over one scene, and returns the runs that succeed. If `scene` is an error, all runs fail.
    pub(crate) fn measure<'r>(
        &self,
        title: &str,
        scene: Result<&MeasuredScene, &CliError>,
        runs: &'r [Run],
        log: &mut RunLog,
    ) -> Vec<(&'r Run, MeasuredRow)> {
        let mut rows = Vec::new();
        for run in runs {
            let measured = scene.map_err(CliError::clone);
            match measured.and_then(|scene| self.measure_run(scene, run)) {
                Ok(row) => {
                    log.progress.step(&format!("{title} {}", run.contender));
                    rows.push((run, row));
                }
                Err(error) => log.fail(title, run, error),
            }
        }
        rows
    }

    fn measure_run(&self, measured: &MeasuredScene, run: &Run) -> Result<MeasuredRow, CliError> {
        let MeasuredScene {
            scene,
            frames,
            lit_camera,
            ..
        } = measured;
        let rays = FrameRays::of(run.rays, scene, lit_camera);
        let plan = TimingPlan {
            frames,
            query: rays.query(),
            warm_up: self.warm_up,
        };
        match &run.contender {
            Contender::Ours(tracer) => {
                let workload = Workload {
                    frames,
                    rays: plan.query.rays.count(),
                };
                let Started {
                    tracer: mut driver,
                    setup,
                } = setup::start_driver(&scene.animation, tracer, workload)?;
                let timed = timing::time_frames(&mut driver, plan)?;
                Ok(MeasuredRow::of(measured, run.rays, setup, timed))
            }
            Contender::Rival(settings) => {
                let mut rival = RunningRival::start(settings, &scene.animation)?;
                let timed = rival.time(plan)?;
                Ok(MeasuredRow {
                    differing: Some(rival.differing(frames, plan.query)?),
                    ..MeasuredRow::of(measured, run.rays, rival.setup(), timed)
                })
            }
        }
    }
}

/// One run. Times are medians over its frames, in milliseconds.
#[derive(Serialize)]
pub(crate) struct MeasuredRow {
    pub(crate) scene: String,
    triangles: usize,
    pub(crate) moving: usize,
    #[serde(flatten)]
    pub(crate) setup: Setup,
    /// Kind of rays; `None` for camera rays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) rays: Option<&'static str>,
    pub(crate) frames: usize,
    /// Warm-up of the device after the first frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) warm_up: Option<Warmed>,
    /// Medians of the quantities in [`TIMES`] and [`MORE`], by name.
    #[serde(flatten)]
    medians: BTreeMap<&'static str, Option<f64>>,
    /// Millions of primary and shadow rays per second of tracing time.
    pub(crate) mrays_per_s: Option<f64>,
    pub(crate) trees: usize,
    /// Number of trees that were built but rejected. A tree is rejected if it costs no less than the current tree, if a
    /// newer tree would arrive before it is due, or if the device has no memory for it.
    rejected: usize,
    /// Milliseconds of the first frame, which waits for the first tree.
    first_ms: Option<f64>,
    memory: Option<Value>,
    /// Device memory in bytes: maximum over all frames.
    device_bytes: Option<u64>,
    /// For a rival: share of rays whose triangle or shadow differs from that of backend `cpu`, over up to three frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) differing: Option<f64>,
    /// Every frame, as in the statistics of `render`.
    pub(crate) per_frame: Vec<FrameRecord>,
}

/// Quantities that are summarized in addition to [`TIMES`]. `geometry_ms` covers all stages before tracing.
const MORE: [(&str, FrameQuantity); 4] = [
    ("geometry_ms", geometry),
    ("tree_age_frames", |f| Some(f.tree.age_frames as f64)),
    ("sah_ratio", |f| f.tree.sah_ratio),
    ("sah_cost", |f| f.report.sah_cost),
];

impl MeasuredRow {
    pub(crate) fn median(&self, name: &str) -> Option<f64> {
        self.medians.get(name).copied().flatten()
    }

    /// Returns all frames but the first, which waits for the first tree. Returns the first if it is the only one.
    pub(crate) fn later_frames(&self) -> &[FrameRecord] {
        let later = self.per_frame.get(1..).filter(|rest| !rest.is_empty());
        later.unwrap_or(&self.per_frame)
    }
}

/// Returns the device time of a frame plus its wait for its tree, in milliseconds.
pub(crate) fn frame_ms(frame: &FrameRecord) -> f64 {
    frame.report.times.device_ms + frame.build_wait_ms
}

impl MeasuredRow {
    fn of(measured: &MeasuredScene, rays: MeasuredRays, setup: Setup, timed: TimedFrames) -> Self {
        let TimedFrames { warm_up, stats } = timed;
        let MeasuredScene {
            name,
            scene,
            lit_camera,
            ..
        } = measured;
        let median =
            |time: FrameQuantity| Summary::of(stats.iter().filter_map(time)).map(|s| s.median);
        let named = TIMES.iter().chain(&MORE);
        let medians: BTreeMap<_, _> = named.map(|&(name, time)| (name, median(time))).collect();
        let device_memories = stats.iter().filter_map(|f| f.device_memory);
        let max_device_memory = device_memories.max_by_key(|bytes| bytes.total());
        let triangles = scene.animation.triangle_count();
        let is_camera = rays == MeasuredRays::Camera;
        let rates = stats.iter().filter_map(|f| {
            let times = &f.report.times;
            let ms = times.trace_primary_ms? + times.trace_shadow_ms.unwrap_or(0.0);
            let shadows = if is_camera { f.report.hits as f64 } else { 0.0 };
            mrays(lit_camera.camera.pixels() as f64 + shadows, ms)
        });
        Self {
            scene: name.clone(),
            triangles,
            moving: scene.animation.moving_count(),
            setup,
            rays: rays.name_unless_camera(),
            warm_up,
            frames: stats.len(),
            mrays_per_s: Summary::of(rates).map(|s| s.median),
            trees: stats.iter().filter(|f| f.tree.adopted).count(),
            rejected: stats.iter().filter(|f| f.tree.rejected).count(),
            first_ms: stats.first().map(|f| f.wall_ms),
            memory: max_device_memory.map(|bytes| device_memory(bytes, triangles)),
            device_bytes: max_device_memory.map(|bytes| bytes.total()),
            differing: None,
            medians,
            per_frame: stats,
        }
    }
}

/// Returns the device memory of each use, in bytes and in bytes per triangle.
fn device_memory(bytes: DeviceBytes, triangles: usize) -> Value {
    let parts = [bytes.tree, bytes.scratch, bytes.scene, bytes.frames];
    let named = |[tree, scratch, scene, frames]: [Value; 4]| json!({ "tree": tree, "scratch": scratch, "scene": scene, "frames": frames });
    let each = |bytes: u64| json!(bytes as f64 / triangles.max(1) as f64);
    json!({
        "bytes": named(parts.map(|bytes| json!(bytes))),
        "bytes_per_triangle": named(parts.map(each)),
    })
}

/// Returns the milliseconds of a frame's stages before tracing, or `None` if it skipped every stage.
fn geometry(frame: &FrameRecord) -> Option<f64> {
    let times = &frame.report.times;
    let stages = [
        times.interpolate_ms,
        times.preprocess_ms,
        times.rebuild_ms,
        times.refit_ms,
    ];
    stages.into_iter().flatten().reduce(|a, b| a + b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn geometry_time_sums_measured_stages() {
        let mut frame = FrameRecord::default();
        assert_eq!(geometry(&frame), None);
        frame.report.times.refit_ms = Some(2.0);
        frame.report.times.preprocess_ms = Some(0.5);
        assert_eq!(geometry(&frame), Some(2.5));
    }
}
