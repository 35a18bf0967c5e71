//! `abvh bench`: measures every stage over scenes, backends, update policies and intersectors.

mod failure;
mod results;

use crate::command::{Requirement, RunCommand};
use crate::console::{self, ProgressLine};
use crate::devices::{BackendChoice, DeviceSettings, Opening, backend_name, builds_trees};
use crate::error::{self, CliError};
use crate::file_checks::CommandFiles;
use crate::machine::{self, VERSION};
use crate::measure::rival::RivalDevice;
use crate::measure::{
    Contender, Contenders, MeasureSettings, MeasuredRays, MeasuredRow, Measuring,
};
use crate::parsers;
use crate::tracer_settings::{PolicyChoice, TracerSettings, needs_host_builds, policy_name};
use backend::{Intersector, Policy};
use clap::Args;
use failure::FailedRun;
use serde_json::json;
use std::path::PathBuf;

#[derive(Args, Debug)]
#[command(mut_arg("scenes", |arg| arg.default_values(["demo:grove", "demo:collide"])))]
#[command(mut_arg("frames", |arg| arg.required(false).default_value("24")))]
#[command(mut_arg("size", |arg| arg.default_value("640x360")))]
#[command(mut_arg("intersector", |arg| arg.default_value("watertight")))]
pub(crate) struct BenchSettings {
    #[command(flatten)]
    pub(crate) measure: MeasureSettings,
    /// Rays: a camera's primary and shadow rays, or one random ray per pixel from a point in the scene's bounds. Random
    /// rays find the closest hit, cast no shadow ray, and are the same in every frame
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "camera"
    )]
    rays: Vec<MeasuredRays>,
    /// Adapter of the backends, by index or by part of its name
    #[arg(long, value_name = "INDEX|NAME-PART")]
    adapter: Option<String>,
    /// Threads that render
    #[arg(long, value_name = "N", value_parser = parsers::threads())]
    threads: Option<usize>,
    /// Threads that build trees [default: as for render]
    #[arg(long, value_name = "N", value_parser = parsers::threads())]
    builder_threads: Option<usize>,
    /// JSON file for the results of every frame
    #[arg(long, value_name = "FILE", value_parser = parsers::file())]
    json: Option<PathBuf>,
    /// CSV file for the results, one row per run
    #[arg(long, value_name = "FILE", value_parser = parsers::file())]
    csv: Option<PathBuf>,
}

impl RunCommand for BenchSettings {
    fn run(&self) -> Result<(), CliError> {
        let files = CommandFiles::written(&[("--json", &self.json), ("--csv", &self.csv)]);
        files.check(&self.measure.scenes)?;
        let results = self.measure_all()?;
        self.write(&results)?;
        let [width, height] = self.measure.camera.size;
        let cpu = machine::cpu_model();
        let cpu = cpu.as_deref().unwrap_or("unknown cpu");
        let head = format!("medians in ms at {width}x{height} on {cpu}\n");
        console::print(&(head + &results::text(&results)))?;
        match results.failures.len() {
            0 => Ok(()),
            n => Err(CliError::failed(format!(
                "{n} of {} runs failed; their rows give the reason",
                n + results.rows.len()
            ))),
        }
    }

    fn requirements(&self) -> Vec<Requirement> {
        let mut all = self.measure.requirements();
        all.push(needs_host_builds(&self.measure.update));
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
    /// Writes the files that were requested.
    fn write(&self, results: &Results) -> Result<(), CliError> {
        if let Some(file) = &self.json {
            let report = json!({
                "schema": output::SCHEMA,
                "version": VERSION,
                "command_line": machine::command_line(),
                "cpu": machine::cpu_model(),
                "cores": host::cores(),
                "size": self.measure.camera.size,
                "rows": results::json(results),
            });
            output::write_json(file, &report)?;
        }
        if let Some(file) = &self.csv {
            output::write_whole(file, results::csv(results)?.as_bytes())?;
        }
        Ok(())
    }

    fn measure_all(&self) -> Result<Results, CliError> {
        let Contenders { all, skipped } = self.contenders();
        if all.is_empty() {
            let why = skipped.join("; ");
            return Err(CliError::invalid(format!(
                "nothing is left to measure: {why}"
            )));
        }
        let each = |&rays: &MeasuredRays| all.iter().map(move |contender| (rays, contender));
        let runs: Vec<_> = self.rays.iter().flat_map(each).collect();
        let steps = self.measure.scenes.len() * runs.len();
        let mut progress = ProgressLine::new(steps as u64, self.measure.quiet);
        skipped.iter().for_each(|remark| progress.say(remark));
        let (mut rows, mut failures, mut errors) = (Vec::new(), Vec::new(), Vec::new());
        for name in &self.measure.scenes {
            let opened = self.measure.open(name);
            for &(rays, contender) in &runs {
                let measured = opened.as_ref().map_err(CliError::clone).and_then(|scene| {
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
                    Err(error) => {
                        let failure = FailedRun::new(name, rays, contender, &error);
                        progress.step(&failure.to_string());
                        failures.push(failure);
                        errors.push(error);
                    }
                }
            }
        }
        if rows.is_empty() {
            Err(error::all_failed(errors))
        } else {
            Ok(Results { rows, failures })
        }
    }

    /// Returns all combinations that can be measured, and remarks on the others.
    fn contenders(&self) -> Contenders {
        let mut contenders = Contenders::default();
        for &backend in &self.measure.backend {
            for &update in &self.measure.update {
                if let Some(why) = nonsense(backend, update) {
                    contenders.skipped.push(why);
                    continue;
                }
                let intersectors = self.measure.intersector.iter();
                let tracer = |&intersector| self.tracer(backend, update, intersector);
                contenders
                    .all
                    .extend(intersectors.map(tracer).map(Contender::Ours));
            }
        }
        contenders.add_rivals(&self.measure);
        contenders
    }

    fn tracer(
        &self,
        backend: BackendChoice,
        update: PolicyChoice,
        intersector: Intersector,
    ) -> TracerSettings {
        TracerSettings {
            device: DeviceSettings {
                adapter: self.adapter.clone(),
                threads: self.threads,
                builder_threads: self.builder_threads,
                ..DeviceSettings::of(backend)
            },
            ..TracerSettings::of(backend, intersector, update)
        }
    }
}

/// Returns a remark if a backend cannot build the trees of an update policy.
fn nonsense(backend: BackendChoice, update: PolicyChoice) -> Option<String> {
    let is_sound = !update.is_some_and(Policy::builds_on_device) || builds_trees(backend);
    let (name, policy) = (backend_name(backend), policy_name(update));
    (!is_sound).then(|| format!("{name} with {policy} is skipped: it builds on the host"))
}
