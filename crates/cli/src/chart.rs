//! `abvh chart`: the speed of every way to trace a scene, against its rate of wrong answers.
//!
//! Times are those of `bench`: the device's time and, with `rebuild`, the wait for the frame's own tree. They cover all
//! frames but the first, which warms up. Answers are compared with those of the exact oracle, which shares no code with
//! any backend. Shadow rays start at the reported hit, so they are compared with `exact` on the host over fresh trees.
//!
//! A policy changes no hit. So each way first traces a few rays. All ways of one intersector and backend with
//! the same hits, bit for bit, are judged together ([`accuracy`]). A way whose hits differ is judged by itself.
//!
//! All ways are timed before any is judged, so that the judge's memory is not measured. Host memory is the resident
//! memory of the process, including memory that earlier runs left allocated.

mod accuracy;
mod hard;
mod plan;

use crate::args::{BackendChoice, ChartArgs, RaysName};
use crate::bench::{self, Combination, Row};
use crate::open::{self, Opening};
use crate::rival::Running;
use crate::session;
use crate::stop::{self, Stop};
use crate::table::table;
use crate::talk::Progress;
use crate::{frames, info, talk};
use accuracy::{STAGES, Sampler, Tally, Tracing};
use backend::{Backend, BackendName, DeviceKind, Hits};
use geom::Animation;
use output::plot::{self, Adapter, Chart, Machine, Point, Spread};
use output::{FrameStats, Summary};
use pipeline::Frame;
use plan::{Method, Way};
use scene::Scene;
use std::sync::Arc;

const LEGEND: &str = "wrong: closest hits of so many that differ from exact arithmetic; aimed: rays at edges and vertices; \
    mixed range: scenes of far or large parts\n\
    after an eighth and after half of the rays, methods stop whose 95 % intervals (Wilson; of none wrong 3 / rays) are apart\n\
    t off: 99.9 % of hits are off by no more; leaks: of so many rays from inside closed bodies, at all offsets\n";

/// Seconds of warm-up if the previous run was on the same device. The device has hardly cooled down while the scene was
/// loaded and a first tree was built. As always, the warm-up continues until frame times are steady.
const LATER_WARM_UP: f64 = 0.2;

/// One way with its point, and its hits for a few rays.
struct Measured {
    way: Way,
    point: Point,
    probe: Vec<Hits>,
    /// Index of the tally that counts its wrong answers.
    group: usize,
}

impl Measured {
    /// Returns whether two ways give the same answers.
    fn is_like(&self, other: &Self) -> bool {
        self.way.method() == other.way.method() && self.probe == other.probe
    }
}

pub(crate) fn run(args: &ChartArgs) -> Result<(), Stop> {
    let (ways, skipped) = plan::ways(args)?;
    let scenes = plan::unique(&args.measure.scenes);
    if !args.measure.quiet {
        skipped.iter().for_each(|s| talk::say(s));
    }
    let machine = Machine {
        cpu: info::cpu_model(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        date: time::OffsetDateTime::now_utc().date().to_string(),
        adapters: Vec::new(),
    };
    let methods = plan::methods(ways.iter().copied());
    let ours = methods.iter().filter(|m| matches!(m, Method::Ours(..)));
    let judged = STAGES.len() * (1 + methods.len());
    let steps = scenes.len() * (ways.len() + judged) + ours.count();
    let mut work = Work {
        args,
        progress: Progress::new(steps as u64, args.measure.quiet),
        chart: Chart {
            machine,
            ..Chart::default()
        },
        stops: Vec::new(),
        spare: None,
    };
    let mut measured = Vec::new();
    for spec in &scenes {
        measured.push(work.time_scene(spec, &ways)?);
    }
    work.ask_hard_rays(&mut measured);
    for (spec, points) in scenes.iter().zip(&mut measured) {
        if let Err(stop) = work.judge_scene(spec, points) {
            work.fail_all(points, &stop, |_| true);
        }
    }
    let points = measured.into_iter().flatten().map(|m| m.point);
    work.chart.points = points.collect();
    if work.chart.points.is_empty() {
        return Err(stop::all_failed(work.stops));
    }
    drop(work.progress);
    finish(args, &work.chart)?;
    match work.chart.failures.len() {
        0 => Ok(()),
        n => Err(Stop::failed(format!(
            "{n} of {} points could not be measured; chart.html and points.csv give the reasons",
            n + work.chart.points.len()
        ))),
    }
}

/// Writes the four files, up to the first that cannot be written. Links at their paths are replaced.
fn finish(args: &ChartArgs, chart: &Chart) -> Result<(), Stop> {
    let mut text = table(chart.points.iter().map(plot::row), 5) + LEGEND;
    text.extend(chart.failures.iter().map(|failure| format!("{failure}\n")));
    for (name, content) in [
        ("chart.svg", plot::svg(chart)),
        ("chart.html", plot::html(chart)),
        ("points.csv", plot::csv(chart)),
        ("points.json", plot::json(chart)),
    ] {
        let path = args.out.join(name);
        let content = content.map_err(Stop::failed)?;
        output::remove_special_file(&path)?;
        output::write_whole(&path, content.as_bytes())?;
        text += &format!("{}\n", path.display());
    }
    talk::print(&text)
}

struct Work<'a> {
    args: &'a ChartArgs,
    progress: Progress,
    chart: Chart,
    /// Reasons of all failures.
    stops: Vec<Stop>,
    /// Backend of the latest run, which is ready for another scene.
    spare: Option<(BackendChoice, Box<dyn Backend>)>,
}

impl Work<'_> {
    /// Times every way over one scene.
    fn time_scene(&mut self, spec: &str, ways: &[Way]) -> Result<Vec<Measured>, Stop> {
        let (scene, frames) = match self.open(spec) {
            Ok(opened) => opened,
            Err(stop) => {
                for way in ways {
                    self.fail(spec, way, stop.clone());
                }
                self.progress.skip(ways.len() as u64);
                return Ok(Vec::new());
            }
        };
        if self.chart.scenes.is_empty() {
            output::prepare_dir(&self.args.out).map_err(Stop::bad)?;
        }
        // The scene's own name, or its name on the command line for demos and repeated names.
        let is_taken = self.chart.scenes.iter().any(|s| s.name == scene.name);
        let name = if frames::is_demo(spec) || is_taken {
            spec.to_owned()
        } else {
            scene.name.clone()
        };
        self.chart.scenes.push(plot::Scene {
            name: name.clone(),
            triangles: scene.animation.triangle_count() as u64,
            size: self.args.measure.size,
            frames: frames.len() as u64,
        });
        let mut measured = Vec::new();
        for &way in ways {
            match self.time((spec, &scene), &frames, way) {
                Ok((row, probe)) => {
                    self.progress.step(&format!("{name} timed {way}"));
                    self.add_adapter(&row);
                    let command = plan::command(self.args, (spec, &way), &row);
                    let point = timed(&name, &row, command);
                    measured.push(Measured {
                        way,
                        point,
                        probe,
                        group: 0,
                    });
                }
                Err(stop) => {
                    self.progress.step(&format!("{name} {way} failed: {stop}"));
                    self.fail(&name, &way, stop);
                }
            }
        }
        Ok(measured)
    }

    /// Opens a scene, and lists the frames to measure.
    fn open(&self, spec: &str) -> Result<(Scene, Vec<Frame>), Stop> {
        let measure = &self.args.measure;
        let scene = bench::open_scene(measure, spec)?;
        let keys = scene.animation.whole_times();
        let frames = frames::list(Some(&measure.frames), None, keys, false)?;
        Ok((scene, frames))
    }

    /// Times one way, then traces a few rays.
    fn time(
        &mut self,
        (spec, scene): (&str, &Scene),
        frames: &[Frame],
        way: Way,
    ) -> Result<(Row, Vec<Hits>), Stop> {
        let mut combination = Combination {
            spec,
            scene,
            frames,
            rays: RaysName::Camera,
            size: self.args.measure.size,
            warm_up: self.args.measure.warm_up,
        };
        let sampler = Sampler::new(&scene.animation, self.args);
        let (row, mut tracing) = match way {
            Way::Ours(ask) => {
                let (opening, is_warm) = self.opening(ask.backend);
                let later = is_warm.then_some(LATER_WARM_UP);
                combination.warm_up = combination.warm_up.or(later);
                let (row, driver) = bench::measure(&combination, &ask, opening)?;
                (row, Tracing::Ours(Box::new(driver)))
            }
            Way::Rival(contest) => {
                self.spare = None;
                let (row, running) = bench::measure_rival(&combination, contest, (None, None))?;
                (row, Tracing::Rival(running))
            }
        };
        let probe = sampler.probe(&mut tracing)?;
        self.keep(way, tracing);
        Ok((row, probe))
    }

    /// Keeps the device of a backend for the next run.
    fn keep(&mut self, way: Way, tracing: Tracing) {
        self.spare = match (way, tracing) {
            (Way::Ours(ask), Tracing::Ours(driver)) => Some((ask.backend, driver.into_backend())),
            _ => None,
        };
    }

    /// Returns the backend of the latest run if it has that name, and whether it is a warm GPU.
    fn opening(&mut self, name: BackendChoice) -> (Opening, bool) {
        let spare = self.spare.take();
        match spare.filter(|(spare, _)| *spare == name) {
            Some((_, backend)) => {
                let is_warm = backend.device().kind == DeviceKind::Gpu;
                (Opening::of(backend), is_warm)
            }
            None => (Opening::default(), false),
        }
    }

    fn fail(&mut self, scene: &str, way: &Way, stop: Stop) {
        self.chart.failures.push(plan::failure(scene, way, &stop));
        self.stops.push(stop);
    }

    /// Turns the selected points into failures.
    fn fail_all(
        &mut self,
        points: &mut Vec<Measured>,
        stop: &Stop,
        is_failed: impl Fn(&Measured) -> bool,
    ) {
        for failed in points.extract_if(.., |m| is_failed(m)) {
            self.fail(&failed.point.scene, &failed.way, stop.clone());
        }
    }

    fn add_adapter(&mut self, row: &Row) {
        let how = &row.setup;
        let adapter = Adapter {
            backend: how.backend.to_owned(),
            adapter: how.adapter.clone(),
            driver: how.driver.clone().unwrap_or_default(),
        };
        let adapters = &mut self.chart.machine.adapters;
        if !adapters.contains(&adapter) {
            adapters.push(adapter);
        }
    }

    /// Traces closed meshes and scenes of mixed range, once for each backend and intersector. Rivals trace none.
    fn ask_hard_rays(&mut self, measured: &mut [Vec<Measured>]) {
        let rays = self.args.rays;
        let families = hard::families(rays);
        for method in plan::methods(measured.iter().flatten().map(|m| m.way)) {
            let Method::Ours(name, intersector) = method else {
                continue;
            };
            let is_of = |m: &Measured| m.way.method() == method;
            let spare = self.spare.take().filter(|(spare, _)| *spare == name);
            let opened = spare.map_or_else(
                || open::bare(name, None, host::cores()),
                |(_, backend)| Ok(backend),
            );
            let found = opened.and_then(|mut backend| {
                let found = hard::ask(backend.as_mut(), intersector, (&families, rays))?;
                self.spare = Some((name, backend));
                Ok(found)
            });
            self.progress.step(&format!("hard rays {method}"));
            match found {
                Ok((mixed_range, leaks)) => {
                    for m in measured.iter_mut().flatten().filter(|m| is_of(m)) {
                        m.point.mixed_range.clone_from(&mixed_range);
                        m.point.leaks.clone_from(&leaks);
                    }
                }
                Err(stop) => {
                    for points in measured.iter_mut() {
                        self.fail_all(points, &stop, is_of);
                    }
                }
            }
        }
    }

    /// Loads a scene for a way that traces lists of rays.
    fn start(&mut self, way: Way, animation: &Arc<Animation>) -> Result<Tracing, Stop> {
        match way {
            Way::Ours(ask) => {
                let (opening, _) = self.opening(ask.backend);
                let (driver, _) = session::start_driver_on(opening, animation, &ask)?;
                Ok(Tracing::Ours(Box::new(driver)))
            }
            Way::Rival(contest) => {
                let running = Running::start(contest, (None, None), animation)?;
                Ok(Tracing::Rival(running))
            }
        }
    }

    /// Compares every method's answers over one scene with exact answers, until the methods' rates differ clearly.
    fn judge_scene(&mut self, spec: &str, points: &mut Vec<Measured>) -> Result<(), Stop> {
        let Some(name) = points.first().map(|m| m.point.scene.clone()) else {
            return Ok(());
        };
        let animation = bench::open_scene(&self.args.measure, spec)?.animation;
        let sampler = Sampler::new(&animation, self.args);
        let mut tallies = tallies(points);
        for (number, stage) in STAGES.iter().enumerate() {
            if number > 0 {
                accuracy::decide(&mut tallies);
            }
            if !tallies.iter().any(Tally::is_going) {
                self.progress.skip(1 + tallies.len() as u64);
                continue;
            }
            let answered = sampler.stage(stage, &tallies)?;
            let part = format!("{name} {}/{}", number + 1, STAGES.len());
            self.progress.step(&format!("{part} exact answers"));
            for mut tally in std::mem::take(&mut tallies) {
                let way = tally.way;
                if !tally.is_going() {
                    self.progress.skip(1);
                    tallies.push(tally);
                    continue;
                }
                let traced = self.start(way, &animation).and_then(|mut tracing| {
                    sampler.judge(&mut tracing, &answered, &mut tally)?;
                    Ok(tracing)
                });
                match traced {
                    Ok(tracing) => {
                        self.keep(way, tracing);
                        self.progress.step(&format!("{part} judged {way}"));
                        tallies.push(tally);
                    }
                    Err(stop) => {
                        self.progress.step(&format!("{part} {way} failed: {stop}"));
                        self.fail_all(points, &stop, |m| m.group == tally.group);
                    }
                }
            }
        }
        for tally in &mut tallies {
            let spread = tally.take_errors();
            let members = points.iter_mut().filter(|m| m.group == tally.group);
            members.for_each(|m| tally.write(spread, &mut m.point));
        }
        Ok(())
    }
}

/// Groups ways that give the same answers. The fastest way of each group traces the rays.
fn tallies(points: &mut [Measured]) -> Vec<Tally> {
    let mut firsts: Vec<usize> = Vec::new();
    for i in 0..points.len() {
        let group = firsts.iter().position(|&f| points[f].is_like(&points[i]));
        points[i].group = group.unwrap_or_else(|| {
            firsts.push(i);
            firsts.len() - 1
        });
    }
    let ms = |m: &&Measured| m.point.ms_per_frame.median.unwrap_or(f64::INFINITY);
    let tally = |group| {
        let members = points.iter().filter(|m| m.group == group);
        let fastest = members.min_by(|a, b| ms(a).total_cmp(&ms(b)))?;
        Some(Tally::new(fastest.way, group))
    };
    (0..firsts.len()).filter_map(tally).collect()
}

fn timed(scene: &str, row: &Row, command: String) -> Point {
    let frames = row.later_frames();
    let spread = || frames.iter().filter_map(bench::frame_ms);
    let summary = Summary::of(spread());
    let most = |bytes: fn(&FrameStats) -> Option<u64>| frames.iter().filter_map(bytes).max();
    let is_on_host = row.setup.backend.parse().is_ok_and(BackendName::is_on_host);
    let on_host = is_on_host.then(|| most(|f| f.host_bytes));
    Point {
        backend: row.setup.backend.to_owned(),
        intersector: row.setup.intersector.to_owned(),
        update: row.setup.update.to_owned(),
        scene: scene.to_owned(),
        ms_per_frame: Spread {
            median: summary.map(|s| s.median),
            // The 5th percentile, as the 95th of the negated times.
            p5: Summary::of(spread().map(|ms| -ms)).map(|s| -s.p95),
            p95: summary.map(|s| s.p95),
        },
        mrays_per_s: row.mrays_per_s,
        memory_bytes: most(|f| f.device_bytes).or(on_host.flatten()),
        samples: frames.len() as u64,
        warm_up_s: row.warm_up.map(|w| w.seconds),
        command,
        ..Point::default()
    }
}
