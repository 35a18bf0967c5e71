//! `abvh chart`: the speed of every backend, intersector and policy, against its rate of wrong answers.
//!
//! The time of a frame is its device time plus, with `rebuild`, the wait for its tree. The first frame does not count,
//! because it waits for the first tree. Answers are compared with those of the exact oracle, which shares no code with
//! any backend. The start of a shadow ray depends on the reported hit, so the oracle cannot answer it in advance.
//! Shadow rays are compared with `exact` on the host over fresh trees.
//!
//! An update policy must not change any hit. To check this, each contender traces a few rays after its frames are
//! timed. Contenders of one backend and intersector whose hits are equal, bit for bit, share one comparison
//! ([`accuracy`]). A contender whose hits differ is compared separately.
//!
//! All contenders are timed before any comparison, so that the oracle's memory is not measured. Host memory is the
//! resident memory of the process, including memory that earlier runs left allocated.

mod accuracy;
mod hard;
mod plan;

use crate::command::{Requirement, RunCommand};
use crate::console::{self, ProgressLine};
use crate::devices::{BackendChoice, DeviceRequest, Opening};
use crate::error::{self, CliError};
use crate::machine::{self, VERSION};
use crate::measure::rival::RivalDevice;
use crate::measure::{
    self, Contender, Contenders, LoadedScene, MeasureSettings, MeasuredRays, MeasuredRow,
    MeasuredScene, Measuring,
};
use crate::parsers;
use crate::scene_source::is_demo;
use crate::table::table;
use accuracy::{RaySampler, STAGES, Tally};
use backend::{Backend, BackendName, DeviceKind, Hits, Intersector};
use clap::Args;
use output::plot::{self, Adapter, Chart, ChartPoint, ChartScene, Machine, TimeSpread};
use output::{FrameStats, Summary};
use plan::HitMethod;
use scene::Scene;
use std::path::PathBuf;

const LEGEND: &str = "wrong: closest hits that differ from exact arithmetic; aimed: rays at edges and vertices; \
    mixed range: scenes with far or large parts\n\
    after an eighth or half of the rays, a method stops if the 95 % interval of its error rate \
    overlaps that of no other intersector on its backend (Wilson interval; 0 to 3 / rays if no hit is wrong)\n";

/// Minimum seconds of warm-up if the previous run was on the same device. The device has hardly cooled down while the
/// scene was loaded and a first tree was built. As always, the warm-up continues until frame times are steady.
const LATER_WARM_UP: f64 = 0.2;

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
    /// Maximum number of rays per scene that are compared with exact arithmetic: half from a camera, half random. A
    /// quarter more rays are aimed at edges and vertices. Fewer are traced if the intersectors' error rates differ
    /// clearly
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
        let methods = plan::methods(&all);
        let ours = methods.iter().filter(|m| matches!(m, HitMethod::Ours(..)));
        let compared = STAGES.len() * (1 + methods.len());
        let steps = scenes.len() * (all.len() + compared) + ours.count();
        let mut run = ChartRun {
            settings: self,
            progress: ProgressLine::new(steps as u64, self.measure.quiet),
            chart: Chart {
                machine: Machine {
                    cpu: machine::cpu_model(),
                    version: VERSION.to_owned(),
                    date: time::OffsetDateTime::now_utc().date().to_string(),
                    adapters: Vec::new(),
                },
                ..Chart::default()
            },
            errors: Vec::new(),
            idle: None,
        };
        let mut entries = Vec::new();
        for name in &scenes {
            entries.push(run.time_scene(name, &all)?);
        }
        run.count_hard_rays(&mut entries);
        for (name, entries) in scenes.iter().zip(&mut entries) {
            if let Err(error) = run.compare_scene(name, entries) {
                run.fail_all(entries, &error, |_| true);
            }
        }
        let points = entries.into_iter().flatten().map(|entry| entry.point);
        run.chart.points = points.collect();
        if run.chart.points.is_empty() {
            return Err(error::all_failed(run.errors));
        }
        drop(run.progress);
        self.write(&run.chart)?;
        match run.chart.failures.len() {
            0 => Ok(()),
            n => Err(CliError::failed(format!(
                "{n} of {} points could not be measured; chart.html and points.csv give the reasons",
                n + run.chart.points.len()
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

/// One contender with its point, and its hits for a few rays.
struct ChartEntry {
    contender: Contender,
    point: ChartPoint,
    probe: Vec<Hits>,
    /// Index of the tally that counts its wrong answers.
    group: usize,
}

impl ChartEntry {
    fn method(&self) -> HitMethod {
        HitMethod::of(&self.contender)
    }

    /// Returns whether two contenders give the same answers.
    fn is_like(&self, other: &Self) -> bool {
        self.method() == other.method() && self.probe == other.probe
    }
}

/// The measurement of a chart.
struct ChartRun<'a> {
    settings: &'a ChartSettings,
    progress: ProgressLine,
    chart: Chart,
    /// Reasons of all failures.
    errors: Vec<CliError>,
    /// Backend of the latest run, which is ready for another scene.
    idle: Option<IdleBackend>,
}

struct IdleBackend {
    name: BackendChoice,
    backend: Box<dyn Backend>,
}

impl ChartRun<'_> {
    /// Times every contender over one scene.
    fn time_scene(
        &mut self,
        name: &str,
        contenders: &[Contender],
    ) -> Result<Vec<ChartEntry>, CliError> {
        let scene = match self.settings.measure.open(name) {
            Ok(scene) => scene,
            Err(error) => {
                for contender in contenders {
                    self.fail(name, contender, error.clone());
                }
                self.progress.skip(contenders.len() as u64);
                return Ok(Vec::new());
            }
        };
        if self.chart.scenes.is_empty() {
            output::prepare_dir(&self.settings.out).map_err(CliError::invalid)?;
        }
        let title = self.add_scene(&scene);
        let mut entries = Vec::new();
        for contender in contenders {
            match self.time(&scene, contender) {
                Ok((row, probe)) => {
                    self.progress.step(&format!("{title} timed {contender}"));
                    self.add_adapter(&row);
                    entries.push(ChartEntry {
                        contender: contender.clone(),
                        point: timed_point(&title, &row),
                        probe,
                        group: 0,
                    });
                }
                Err(error) => {
                    self.progress
                        .step(&format!("{title} {contender} failed: {error}"));
                    self.fail(&title, contender, error);
                }
            }
        }
        Ok(entries)
    }

    /// Adds a scene to the chart. Returns its title: its own name or, for demos and repeated names, its name on the
    /// command line.
    fn add_scene(&mut self, measured: &MeasuredScene) -> String {
        let MeasuredScene {
            name,
            scene,
            frames,
            ..
        } = measured;
        let is_taken = self.chart.scenes.iter().any(|s| s.name == scene.name);
        let title = if is_demo(name) || is_taken {
            name.clone()
        } else {
            scene.name.clone()
        };
        self.chart.scenes.push(ChartScene {
            name: title.clone(),
            triangles: scene.animation.triangle_count() as u64,
            size: self.settings.measure.camera.size,
            frames: frames.len() as u64,
        });
        title
    }

    /// Times one contender, then traces a few rays.
    fn time(
        &mut self,
        scene: &MeasuredScene,
        contender: &Contender,
    ) -> Result<(MeasuredRow, Vec<Hits>), CliError> {
        let (opening, is_warm) = self.opening(contender);
        let later = is_warm.then_some(LATER_WARM_UP);
        let measuring = Measuring {
            scene,
            rays: MeasuredRays::Camera,
            warm_up: self.settings.measure.warm_up.or(later),
            rival_device: RivalDevice::default(),
        };
        let measure::Measurement { row, mut loaded } = measuring.measure(contender, opening)?;
        let probe = self.sampler(&scene.scene)?.probe(&mut loaded)?;
        self.keep(contender, loaded);
        Ok((row, probe))
    }

    fn sampler<'s>(&self, scene: &'s Scene) -> Result<RaySampler<'s>, CliError> {
        Ok(RaySampler {
            animation: &scene.animation,
            view: self.settings.measure.camera.view(scene)?,
            rays: self.settings.rays,
        })
    }

    /// Keeps the device of a backend for the next run.
    fn keep(&mut self, contender: &Contender, loaded: LoadedScene) {
        self.idle = match (contender, loaded) {
            (Contender::Ours(tracer), LoadedScene::Ours(driver)) => Some(IdleBackend {
                name: tracer.device.backend,
                backend: driver.into_backend(),
            }),
            _ => None,
        };
    }

    /// Returns the backend of the latest run if the contender uses it, and whether it is a warm GPU.
    fn opening(&mut self, contender: &Contender) -> (Opening, bool) {
        let Contender::Ours(tracer) = contender else {
            self.idle = None;
            return (Opening::default(), false);
        };
        match self.take_idle(tracer.device.backend) {
            Some(backend) => {
                let is_warm = backend.device().kind == DeviceKind::Gpu;
                (Opening::of(backend), is_warm)
            }
            None => (Opening::default(), false),
        }
    }

    fn take_idle(&mut self, name: BackendChoice) -> Option<Box<dyn Backend>> {
        let idle = self.idle.take().filter(|idle| idle.name == name);
        idle.map(|idle| idle.backend)
    }

    fn fail(&mut self, scene: &str, contender: &Contender, error: CliError) {
        let failure = plan::failure(scene, contender, &error);
        self.chart.failures.push(failure);
        self.errors.push(error);
    }

    /// Turns the selected entries into failures.
    fn fail_all(
        &mut self,
        entries: &mut Vec<ChartEntry>,
        error: &CliError,
        is_failed: impl Fn(&ChartEntry) -> bool,
    ) {
        for failed in entries.extract_if(.., |entry| is_failed(entry)) {
            self.fail(&failed.point.scene, &failed.contender, error.clone());
        }
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

    /// Traces scenes of mixed range, once for each backend and intersector, but not for rivals.
    fn count_hard_rays(&mut self, entries: &mut [Vec<ChartEntry>]) {
        let families = hard::families(self.settings.rays);
        for method in plan::methods(entries.iter().flatten().map(|entry| &entry.contender)) {
            let HitMethod::Ours(name, intersector) = method else {
                continue;
            };
            let is_of = |entry: &ChartEntry| entry.method() == method;
            let idle = self.take_idle(name);
            let opened = idle.map_or_else(|| DeviceRequest::of(name).open(), Ok);
            let counted = opened.and_then(|mut backend| {
                let counts = hard::count(backend.as_mut(), intersector, &families)?;
                self.idle = Some(IdleBackend { name, backend });
                Ok(counts)
            });
            self.progress.step(&format!("hard rays {method}"));
            match counted {
                Ok(counts) => {
                    for entry in entries.iter_mut().flatten().filter(|entry| is_of(entry)) {
                        entry.point.mixed_range.clone_from(&counts);
                    }
                }
                Err(error) => {
                    for entries in entries.iter_mut() {
                        self.fail_all(entries, &error, is_of);
                    }
                }
            }
        }
    }

    /// Compares every method's answers over one scene with exact answers, until the methods' rates differ clearly.
    fn compare_scene(&mut self, name: &str, entries: &mut Vec<ChartEntry>) -> Result<(), CliError> {
        let Some(title) = entries.first().map(|entry| entry.point.scene.clone()) else {
            return Ok(());
        };
        let scene = self.settings.measure.open(name)?.scene;
        let sampler = self.sampler(&scene)?;
        let mut tallies = tallies(entries);
        for (number, stage) in STAGES.iter().enumerate() {
            if number > 0 {
                accuracy::decide(&mut tallies);
            }
            if !tallies.iter().any(Tally::is_going) {
                self.progress.skip(1 + tallies.len() as u64);
                continue;
            }
            let answered = sampler.answer(stage, &tallies)?;
            let part = format!("{title} {}/{}", number + 1, STAGES.len());
            self.progress.step(&format!("{part} exact answers"));
            for mut tally in std::mem::take(&mut tallies) {
                if !tally.is_going() {
                    self.progress.skip(1);
                    tallies.push(tally);
                    continue;
                }
                let contender = tally.contender.clone();
                let (opening, _) = self.opening(&contender);
                let loaded = LoadedScene::load(&contender, &scene.animation, opening);
                let compared = loaded.and_then(|mut loaded| {
                    sampler.compare(&mut loaded, &answered, &mut tally)?;
                    Ok(loaded)
                });
                match compared {
                    Ok(loaded) => {
                        self.keep(&contender, loaded);
                        self.progress.step(&format!("{part} compared {contender}"));
                        tallies.push(tally);
                    }
                    Err(error) => {
                        self.progress
                            .step(&format!("{part} {contender} failed: {error}"));
                        self.fail_all(entries, &error, |entry| entry.group == tally.group);
                    }
                }
            }
        }
        for tally in &tallies {
            let members = entries
                .iter_mut()
                .filter(|entry| entry.group == tally.group);
            members.for_each(|entry| tally.write(&mut entry.point));
        }
        Ok(())
    }
}

/// Groups entries that give the same answers. The fastest contender of each group traces the rays.
fn tallies(entries: &mut [ChartEntry]) -> Vec<Tally> {
    let mut firsts: Vec<usize> = Vec::new();
    for i in 0..entries.len() {
        let group = firsts.iter().position(|&f| entries[f].is_like(&entries[i]));
        entries[i].group = group.unwrap_or_else(|| {
            firsts.push(i);
            firsts.len() - 1
        });
    }
    let ms = |e: &&ChartEntry| e.point.ms_per_frame.median.unwrap_or(f64::INFINITY);
    let tally = |group| {
        let members = entries.iter().filter(|entry| entry.group == group);
        let fastest = members.min_by(|a, b| ms(a).total_cmp(&ms(b)))?;
        Some(Tally::new(fastest.contender.clone(), group))
    };
    (0..firsts.len()).filter_map(tally).collect()
}

fn timed_point(scene: &str, row: &MeasuredRow) -> ChartPoint {
    let frames = row.later_frames();
    let spread = || frames.iter().map(measure::frame_ms);
    let summary = Summary::of(spread());
    let most = |bytes: fn(&FrameStats) -> Option<u64>| frames.iter().filter_map(bytes).max();
    let is_on_host = row.setup.backend.parse().is_ok_and(BackendName::is_on_host);
    let on_host = is_on_host.then(|| most(|f| f.host_bytes));
    ChartPoint {
        backend: row.setup.backend.to_owned(),
        intersector: row.setup.intersector.to_owned(),
        update: row.setup.update.to_owned(),
        scene: scene.to_owned(),
        ms_per_frame: TimeSpread {
            median: summary.map(|s| s.median),
            // The 5th percentile, as the 95th of the negated times.
            p5: Summary::of(spread().map(|ms| -ms)).map(|s| -s.p95),
            p95: summary.map(|s| s.p95),
        },
        mrays_per_s: row.mrays_per_s,
        memory_bytes: most(|f| f.device_bytes).or(on_host.flatten()),
        samples: frames.len() as u64,
        warm_up_s: row.warm_up.map(|w| w.seconds),
        ..ChartPoint::default()
    }
}
