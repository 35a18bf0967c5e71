//! `abvh chart`: the speed of every backend, intersector and policy, against its rate of wrong answers.
//!
//! The time of a frame is its device time plus, with `rebuild`, the wait for its tree. The first frame waits for the
//! first tree, so it counts only if it is the only frame. Answers are compared with those of the exact oracle, which
//! shares no code with any backend. The start of a shadow ray depends on the reported hit, so the oracle cannot answer
//! it in advance. Shadow rays are compared with `exact` on the host over fresh trees.
//!
//! Every contender opens its own device, and traces the same rays. All contenders are timed before the oracle is
//! created, so that its memory is not measured. Host memory is the resident memory of the process, including memory
//! that earlier runs left allocated.

mod accuracy;
mod hard;
mod plan;

use crate::command::{Requirement, RunCommand};
use crate::console::{self, ProgressLine};
use crate::devices::DeviceSettings;
use crate::error::{self, CliError};
use crate::machine::{self, VERSION};
use crate::measure::{
    self, Contenders, MeasureSettings, MeasuredRays, MeasuredRow, MeasuredScene, Run, RunLog,
};
use crate::parsers;
use crate::scene_source::is_demo;
use crate::table::table;
use accuracy::AnsweredRays;
use backend::{BackendName, Intersector};
use clap::Args;
use conformance::stability::StabilityTest;
use output::Summary;
use output::plot::{self, Adapter, Chart, ChartPoint, ChartScene, Machine, TimeSpread};
use pipeline::FrameRecord;
use plan::HitMethod;
use std::path::PathBuf;

const LEGEND: &str = "wrong: closest hits whose triangle differs from exact arithmetic; aimed: rays at edges and vertices; \
    mixed range: scenes with far or large parts\n";

#[derive(Args, Debug)]
#[command(mut_arg("scenes", |arg| arg.default_value("demo:collide")))]
#[command(mut_arg("backend", |arg| arg.help("Backends; auto is the host's cores and every backend that finds a GPU")))]
#[command(mut_arg("frames", |arg| arg.required(false).default_value("12")))]
#[command(mut_arg("size", |arg| arg.default_value("640x400")))]
#[command(mut_arg("intersector", |arg| arg.default_values(Intersector::ALL.map(Intersector::name))))]
pub(crate) struct ChartSettings {
    #[command(flatten)]
    measure: MeasureSettings,
    /// Directory for chart.svg, chart.html, points.csv and points.json
    #[arg(long, value_name = "DIR", default_value = "abvh-chart", value_parser = parsers::file())]
    out: PathBuf,
    /// Number of rays per scene that are compared with exact arithmetic: half from a camera, half random. A quarter more
    /// rays are aimed at edges and vertices
    #[arg(long, value_name = "N", default_value = "2000000", value_parser = parsers::rays())]
    rays: usize,
}

impl RunCommand for ChartSettings {
    fn run(&self) -> Result<(), CliError> {
        let Contenders { all, skipped } = plan::contenders(self)?;
        let scenes = plan::unique(&self.measure.scenes);
        if !self.measure.quiet {
            skipped.iter().for_each(|s| console::say(s));
        }
        let run = |contender| Run {
            contender,
            rays: MeasuredRays::Camera,
        };
        let runs: Vec<Run> = all.into_iter().map(run).collect();
        let mut chart = ChartRun {
            settings: self,
            log: RunLog::new(scenes.len() * runs.len(), self.measure.quiet),
            chart: Chart {
                machine: Machine {
                    cpu: machine::cpu_model(),
                    version: VERSION.to_owned(),
                    date: time::OffsetDateTime::now_utc().date().to_string(),
                    adapters: Vec::new(),
                },
                ..Chart::default()
            },
            entries: Vec::new(),
        };
        for name in &scenes {
            chart.time_scene(name, &runs)?;
        }
        let entries = chart.entries.iter();
        let methods: Vec<_> = entries
            .filter_map(|entry| HitMethod::of(&entry.run.contender))
            .collect();
        let methods = plan::unique(&methods);
        let steps = methods.len() + scenes.len() + chart.entries.len();
        chart.log.progress = ProgressLine::new(steps as u64, self.measure.quiet);
        let tests = hard::tests(self.rays);
        for method in methods {
            chart.count_hard_rays(&tests, method);
        }
        for name in &scenes {
            if let Err(error) = chart.compare_scene(name) {
                chart.fail(&error, |entry| entry.scene == name);
            }
        }
        let chart = chart.finish()?;
        self.write(&chart)?;
        match chart.failures.len() {
            0 => Ok(()),
            n => Err(CliError::failed(format!(
                "{n} of {} points could not be measured; chart.html and points.csv give the reasons",
                n + chart.points.len()
            ))),
        }
    }

    fn requirements(&self) -> Vec<Requirement> {
        self.measure.requirements()
    }
}

impl ChartSettings {
    /// Writes the four files and prints the table. Stops at the first file that cannot be written. Replaces links at
    /// the files' paths.
    fn write(&self, chart: &Chart) -> Result<(), CliError> {
        let mut text = table(chart.points.iter().map(plot::row), 5) + LEGEND;
        text.extend(chart.failures.iter().map(|failure| format!("{failure}\n")));
        for (name, content) in [
            ("chart.svg", plot::svg(chart)),
            ("chart.html", plot::html(chart)),
            ("points.csv", plot::csv(chart)),
            ("points.json", plot::json(chart)),
        ] {
            let path = self.out.join(name);
            let content = content.map_err(CliError::failed)?;
            output::remove_special_file(&path)?;
            output::write_whole(&path, content.as_bytes())?;
            text += &format!("{}\n", path.display());
        }
        console::print(&text)
    }
}

/// One run over one scene, with its point.
struct ChartEntry<'a> {
    /// Name of the scene on the command line.
    scene: &'a str,
    run: &'a Run,
    point: ChartPoint,
    /// Reason why hits could not be counted.
    error: Option<CliError>,
}

/// The measurement of a chart.
struct ChartRun<'a> {
    settings: &'a ChartSettings,
    log: RunLog,
    chart: Chart,
    entries: Vec<ChartEntry<'a>>,
}

impl<'a> ChartRun<'a> {
    /// Times every contender over one scene.
    fn time_scene(&mut self, name: &'a str, runs: &'a [Run]) -> Result<(), CliError> {
        let measure = &self.settings.measure;
        let scene = measure.open(name);
        let title = match &scene {
            Ok(scene) => self.add_scene(scene)?,
            Err(_) => name.to_owned(),
        };
        for (run, row) in measure.measure(&title, scene.as_ref(), runs, &mut self.log) {
            self.add_adapter(&row);
            self.entries.push(ChartEntry {
                scene: name,
                run,
                point: timed_point(&title, &row),
                error: None,
            });
        }
        Ok(())
    }

    /// Adds a scene to the chart. Returns its title: its own name or, for demos and repeated names, its name on the
    /// command line, with a number if that is repeated too. The first scene creates the directory.
    fn add_scene(&mut self, measured: &MeasuredScene) -> Result<String, CliError> {
        if self.chart.scenes.is_empty() {
            output::prepare_dir(&self.settings.out).map_err(CliError::invalid)?;
        }
        let MeasuredScene {
            name,
            scene,
            frames,
            ..
        } = measured;
        let is_free = |title: &String| self.chart.scenes.iter().all(|s| s.name != *title);
        let own = (!is_demo(name)).then(|| scene.name.clone());
        let numbered = (2..).map(|number| format!("{name} ({number})"));
        let mut titles = own.into_iter().chain([name.clone()]).chain(numbered);
        let title = titles.find(is_free).unwrap_or_default();
        self.chart.scenes.push(ChartScene {
            name: title.clone(),
            triangles: scene.animation.triangle_count() as u64,
            size: self.settings.measure.camera.size,
            frames: frames.len() as u64,
        });
        Ok(title)
    }

    fn add_adapter(&mut self, row: &MeasuredRow) {
        let setup = &row.setup;
        let adapter = Adapter {
            backend: setup.backend.to_owned(),
            adapter: setup.adapter.clone(),
            driver: setup.driver.clone().unwrap_or_default(),
        };
        let adapters = &mut self.chart.machine.adapters;
        if !adapters.contains(&adapter) {
            adapters.push(adapter);
        }
    }

    /// Marks entries as failed. Keeps the reasons of entries that failed before.
    fn fail(&mut self, error: &CliError, is_failed: impl Fn(&ChartEntry<'_>) -> bool) {
        for entry in self.entries.iter_mut().filter(|entry| is_failed(entry)) {
            entry.error.get_or_insert_with(|| error.clone());
        }
    }

    /// Counts the wrong answers of one method in scenes of mixed range.
    fn count_hard_rays(&mut self, tests: &[StabilityTest], method: HitMethod) {
        let opened = DeviceSettings::default().open(method.backend);
        let counted = opened.and_then(|mut b| hard::count(b.as_mut(), method.intersector, tests));
        self.log.progress.step(&format!("mixed range {method}"));
        let is_of = |entry: &ChartEntry<'_>| HitMethod::of(&entry.run.contender) == Some(method);
        match counted {
            Err(error) => self.fail(&error, is_of),
            Ok(counts) => {
                for entry in self.entries.iter_mut().filter(|entry| is_of(entry)) {
                    entry.point.mixed_range.clone_from(&counts);
                }
            }
        }
    }

    /// Compares the answers of each contender that has not failed over one scene with exact answers.
    fn compare_scene(&mut self, name: &str) -> Result<(), CliError> {
        let is_compared =
            |entry: &&mut ChartEntry<'_>| entry.scene == name && entry.error.is_none();
        let mut entries = self.entries.iter_mut().filter(is_compared).peekable();
        if entries.peek().is_none() {
            return Ok(());
        }
        let scene = self.settings.measure.open(name)?.scene;
        let view = self.settings.measure.camera.view(&scene)?;
        let answered = AnsweredRays::new(&scene.animation, view, self.settings.rays)?;
        self.log.progress.step(&format!("{name} exact answers"));
        for entry in entries {
            let contender = &entry.run.contender;
            match answered.compare(contender, &mut entry.point) {
                Ok(()) => self
                    .log
                    .progress
                    .step(&format!("{name} compared {contender}")),
                Err(error) => entry.error = Some(error),
            }
        }
        Ok(())
    }

    /// Returns the chart, or an error if there are no points.
    fn finish(mut self) -> Result<Chart, CliError> {
        for entry in self.entries {
            match entry.error {
                None => self.chart.points.push(entry.point),
                Some(error) => self.log.fail(&entry.point.scene, entry.run, error),
            }
        }
        if self.chart.points.is_empty() {
            return Err(error::all_failed(&self.log.errors));
        }
        self.chart.failures = self.log.failures;
        Ok(self.chart)
    }
}

fn timed_point(scene: &str, row: &MeasuredRow) -> ChartPoint {
    let frames = row.later_frames();
    let ms = || frames.iter().map(measure::frame_ms);
    let times = Summary::of(ms()).unwrap_or_default();
    let negated = Summary::of(ms().map(|ms| -ms)).unwrap_or_default();
    let most = |bytes: fn(&FrameRecord) -> Option<u64>| frames.iter().filter_map(bytes).max();
    let is_on_host = row.setup.backend.parse().is_ok_and(BackendName::is_on_host);
    let on_host = is_on_host.then(|| most(|f| f.host_bytes));
    ChartPoint {
        backend: row.setup.backend.to_owned(),
        intersector: row.setup.intersector.to_owned(),
        update: row.setup.update.to_owned(),
        scene: scene.to_owned(),
        ms_per_frame: TimeSpread {
            median: times.median,
            // The 5th percentile, as the 95th of the negated times.
            p5: -negated.p95,
            p95: times.p95,
        },
        mrays_per_s: row.mrays_per_s,
        memory_bytes: most(|f| f.device_bytes).or(on_host.flatten()),
        samples: frames.len() as u64,
        warm_up_s: row.warm_up.map(|w| w.seconds),
        ..ChartPoint::default()
    }
}
