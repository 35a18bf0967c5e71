//! `abvh bench`: measures every stage over scenes, backends, update policies and intersectors.

mod results;

use crate::command::{Requirement, RunCommand};
use crate::console;
use crate::devices::{BackendChoice, DeviceSettings, backend_name, builds_trees};
use crate::error::{self, CliError};
use crate::file_checks::CommandFiles;
use crate::machine::{self, VERSION};
use crate::measure::{
    Contender, Contenders, MeasureSettings, MeasuredRays, MeasuredRow, Run, RunLog,
};
use crate::parsers;
use crate::tracer_settings::{PolicyChoice, TracerSettings, needs_host_builds, policy_name};
use backend::Policy;
use clap::Args;
use output::plot::Failure;
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
    #[command(flatten)]
    device: DeviceSettings,
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
                "{n} of {} runs failed, for the reasons listed with the results",
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
        self.device.threads
    }
}

/// Results of all combinations.
struct Results {
    rows: Vec<MeasuredRow>,
    /// Combinations that could not be measured.
    failures: Vec<Failure>,
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
        let run = |contender: &Contender, &rays: &MeasuredRays| Run {
            contender: contender.clone(),
            rays,
        };
        let each = |rays| all.iter().map(move |contender| run(contender, rays));
        let runs: Vec<_> = self.rays.iter().flat_map(each).collect();
        let steps = self.measure.scenes.len() * runs.len();
        let mut log = RunLog::new(steps, self.measure.quiet);
        skipped.iter().for_each(|remark| log.progress.say(remark));
        let mut rows = Vec::new();
        for name in &self.measure.scenes {
            let opened = self.measure.open(name);
            let measured = self.measure.measure(name, opened.as_ref(), &runs, &mut log);
            rows.extend(measured.into_iter().map(|(_, row)| row));
        }
        if rows.is_empty() {
            Err(error::all_failed(&log.errors))
        } else {
            let failures = log.failures;
            Ok(Results { rows, failures })
        }
    }

    /// Returns all combinations that can be measured, and remarks on the others.
    fn contenders(&self) -> Contenders {
        let mut contenders = Contenders::default();
        for &backend in &self.measure.backend {
            for &update in &self.measure.update {
                if let Some(why) = skip_reason(backend, update) {
                    contenders.skipped.push(why);
                    continue;
                }
                let intersectors = self.measure.intersector.iter();
                let tracer = |&intersector| TracerSettings {
                    device: self.device.clone(),
                    ..TracerSettings::of(backend, intersector, update)
                };
                contenders
                    .all
                    .extend(intersectors.map(tracer).map(Contender::Ours));
            }
        }
        contenders.add_rivals(&self.measure, &self.device);
        contenders
    }
}

/// Returns a remark if a backend cannot build the trees of an update policy.
fn skip_reason(backend: BackendChoice, update: PolicyChoice) -> Option<String> {
    let can_build = !update.is_some_and(Policy::builds_on_device) || builds_trees(backend);
    let (name, policy) = (backend_name(backend), policy_name(update));
    (!can_build).then(|| format!("{name} with {policy} is skipped: {name} builds on the host"))
}
