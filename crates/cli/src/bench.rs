//! `abvh bench`: measures every stage over scenes, backends, update policies and intersectors.

mod compare;
mod failure;
mod results;

use crate::command::{Requirement, RunCommand};
use crate::console::{self, Progress};
use crate::devices::{BackendChoice, DeviceSettings, Opening, backend_name, builds_trees};
use crate::file_checks::CommandFiles;
use crate::frame_list::TimeRange;
use crate::machine::{self, VERSION};
use crate::measure::rival::RivalDevice;
use crate::measure::{Contender, Contenders, MeasureSettings, MeasuredRow, Measuring, RayKind};
use crate::parsers;
use crate::stop::{self, Stop};
use crate::tracer_settings::{
    PolicyChoice, TracerSettings, needs_async, needs_host_builds, policy_name,
};
use backend::Policy;
use clap::Args;
use failure::FailedRun;
use serde_json::json;
use std::path::PathBuf;

/// Options and groups of options that measure.
const MEASURING: [&str; 18] = [
    "scenes",
    "SceneSettings",
    "CameraSettings",
    "backend",
    "rival",
    "update",
    "intersector",
    "frames",
    "warm_up",
    "predict",
    "against",
    "rays",
    "time_range",
    "adapter",
    "threads",
    "builder_threads",
    "json",
    "csv",
];

#[derive(Args, Debug)]
#[command(mut_arg("scenes", |arg| arg.default_values(["demo:grove", "demo:collide"])))]
#[command(mut_arg("frames", |arg| arg.required(false).default_value("24")))]
#[command(mut_arg("size", |arg| arg.default_value("640x360")))]
#[command(mut_arg("intersector", |arg| arg.default_value("watertight")))]
pub(crate) struct BenchSettings {
    #[command(flatten)]
    pub(crate) measure: MeasureSettings,
    /// With async: whether trees are built ahead, as for render; 'on,off' measures both
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "on", value_parser = parsers::switch())]
    predict: Vec<bool>,
    /// Run that the others are compared with, by words of its row in order, such as 'wgpu refit' [default: the
    /// first of each scene]
    #[arg(long, value_name = "WORDS")]
    against: Option<String>,
    /// Rays: a camera's primary and shadow rays, or as many random rays from points in the scene's bounds. Random rays
    /// find the closest hit, cast no shadow ray, and are the same in every frame
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "camera"
    )]
    rays: Vec<RayKind>,
    /// Time range, in key frames [default: the whole motion]
    #[arg(long, value_name = "T0..T1", allow_hyphen_values = true)]
    time_range: Option<TimeRange>,
    /// Adapter of the backends, by index or by part of its name
    #[arg(long, value_name = "INDEX|NAME-PART")]
    adapter: Option<String>,
    /// Threads that render
    #[arg(long, value_name = "N", value_parser = parsers::threads())]
    threads: Option<usize>,
    /// Threads that build trees; '2,16' measures both [default: as for render]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parsers::threads())]
    builder_threads: Vec<usize>,
    /// Instead, compare two result files of bench or of render --stats: medians, ratios, and whether differences exceed
    /// noise
    #[arg(long, num_args = 2, value_names = ["OLD.json", "NEW.json"], conflicts_with_all = MEASURING)]
    compare: Vec<PathBuf>,
    /// With --compare: exit with 1 if frames take more than PCT percent longer, and by more than noise
    #[arg(long, value_name = "PCT", value_parser = parsers::number(|p: f64| p >= 0.0, "per cent are a number from 0"))]
    fail_above: Option<f64>,
    /// JSON file for the results of every frame
    #[arg(long, value_name = "FILE", value_parser = parsers::file())]
    json: Option<PathBuf>,
    /// CSV file for the results, one row per run
    #[arg(long, value_name = "FILE", value_parser = parsers::file())]
    csv: Option<PathBuf>,
}

impl RunCommand for BenchSettings {
    fn run(&self) -> Result<(), Stop> {
        let read = self.compare.iter().map(|file| ("--compare", file.clone()));
        let files = CommandFiles {
            read: read.collect(),
            ..CommandFiles::written(&[("--json", &self.json), ("--csv", &self.csv)])
        };
        files.check(&self.measure.scenes)?;
        match &self.compare[..] {
            [old, new] => compare::run(old, new, self.fail_above),
            _ => self.measure_and_report(),
        }
    }

    fn requirements(&self) -> Vec<Requirement> {
        let updates = &self.measure.update;
        let mut all = self.measure.requirements();
        all.extend([
            needs_async("predict", updates),
            needs_host_builds(updates),
            Requirement::new(
                "fail_above",
                !self.compare.is_empty(),
                "goes only with --compare",
            ),
        ]);
        all
    }

    fn threads(&self) -> Option<usize> {
        self.threads
    }
}

/// Results of all combinations.
struct Results {
    rows: Vec<MeasuredRow>,
    /// Combinations that could not be measured.
    failures: Vec<FailedRun>,
}

impl BenchSettings {
    fn measure_and_report(&self) -> Result<(), Stop> {
        let results = self.measure_all()?;
        let (rows, failures) = (&results.rows, &results.failures);
        // A baseline that failed must not discard the other runs.
        if failures.is_empty() {
            results::check(rows, self.against.as_deref())?;
        }
        let (cpu, size) = (machine::cpu_model(), self.measure.camera.size);
        if let Some(file) = &self.json {
            let report = json!({
                "schema": output::SCHEMA,
                "version": VERSION,
                "command_line": machine::command_line(),
                "cpu": cpu,
                "cores": host::cores(),
                "size": size,
                "ratios": results::ratios(rows),
                "rows": results::json(&results),
            });
            output::write_json(file, &report)?;
        }
        if let Some(file) = &self.csv {
            output::write_whole(file, results::csv(&results)?.as_bytes())?;
        }
        let [width, height] = size;
        let cpu = cpu.as_deref().unwrap_or("unknown cpu");
        let text = results::text(&results, self.against.as_deref());
        let head = format!("medians in ms at {width}x{height} on {cpu}\n");
        console::print(&(head + &text))?;
        match failures.len() {
            0 => Ok(()),
            n => Err(Stop::failed(format!(
                "{n} of {} runs failed; their rows give the reason",
                n + rows.len()
            ))),
        }
    }

    fn measure_all(&self) -> Result<Results, Stop> {
        let Contenders { all, skipped } = self.contenders();
        if all.is_empty() {
            let why = skipped.join("; ");
            return Err(Stop::bad(format!("nothing is left to measure: {why}")));
        }
        let each = |&rays: &RayKind| all.iter().map(move |contender| (rays, contender));
        let runs: Vec<_> = self.rays.iter().flat_map(each).collect();
        let steps = self.measure.scenes.len() * runs.len();
        let mut progress = Progress::new(steps as u64, self.measure.quiet);
        skipped.iter().for_each(|remark| progress.say(remark));
        let (mut rows, mut failures, mut stops) = (Vec::new(), Vec::new(), Vec::new());
        for name in &self.measure.scenes {
            let opened = self.measure.open(name, self.time_range);
            for &(rays, contender) in &runs {
                let measured = opened.as_ref().map_err(Stop::clone).and_then(|scene| {
                    let measuring = Measuring {
                        scene,
                        rays,
                        warm_up: self.measure.warm_up,
                        rival_device: RivalDevice {
                            adapter: self.adapter.as_deref(),
                            threads: self.threads,
                        },
                    };
                    measuring.measure(contender, Opening::default())
                });
                match measured {
                    Ok(measurement) => {
                        let row = measurement.row;
                        let setup = &row.setup;
                        let words = [name, setup.backend, setup.update, setup.intersector];
                        progress.step(&words.join(" "));
                        rows.push(row);
                    }
                    Err(stop) => {
                        let failure = FailedRun::new(name, rays, contender, &stop);
                        progress.step(&failure.to_string());
                        failures.push(failure);
                        stops.push(stop);
                    }
                }
            }
        }
        if rows.is_empty() {
            Err(stop::all_failed(stops))
        } else {
            Ok(Results { rows, failures })
        }
    }

    /// Returns all meaningful combinations.
    fn contenders(&self) -> Contenders {
        let mut contenders = Contenders::default();
        for &backend in &self.measure.backend {
            for (update, predict) in self.policies() {
                if let Some(why) = nonsense(backend, update) {
                    contenders.skipped.push(why);
                    continue;
                }
                let tracers = self.tracers(backend, update, predict);
                contenders.all.extend(tracers.map(Contender::Ours));
            }
        }
        contenders.add_rivals(&self.measure);
        contenders
    }

    /// Returns settings for each intersector and number of builder threads.
    fn tracers(
        &self,
        backend: BackendChoice,
        update: PolicyChoice,
        predict: bool,
    ) -> impl Iterator<Item = TracerSettings> {
        let builders: Vec<Option<usize>> = match self.builder_threads.as_slice() {
            [] => vec![None],
            some => some.iter().copied().map(Some).collect(),
        };
        let intersectors = self.measure.intersector.iter();
        intersectors.flat_map(move |&intersector| {
            let tracer = |builder_threads| TracerSettings {
                device: DeviceSettings {
                    adapter: self.adapter.clone(),
                    threads: self.threads,
                    builder_threads,
                    ..DeviceSettings::of(backend)
                },
                predict,
                ..TracerSettings::of(backend, intersector, update)
            };
            builders.iter().copied().map(tracer).collect::<Vec<_>>()
        })
    }

    /// Returns each update policy, with and without prediction if that makes a difference.
    fn policies(&self) -> impl Iterator<Item = (PolicyChoice, bool)> {
        self.measure.update.iter().flat_map(|&update| {
            let differ = update.is_none_or(Policy::builds_beside_frames);
            let take = if differ { self.predict.len() } else { 1 };
            self.predict.iter().take(take).map(move |&p| (update, p))
        })
    }
}

/// Returns what is wrong with a combination.
fn nonsense(backend: BackendChoice, update: PolicyChoice) -> Option<String> {
    let is_sound = !update.is_some_and(Policy::builds_on_device) || builds_trees(backend);
    let (name, policy) = (backend_name(backend), policy_name(update));
    (!is_sound).then(|| format!("{name} with {policy} is left out: it makes no trees"))
}
