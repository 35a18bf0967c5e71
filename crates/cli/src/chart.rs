//! `abvh chart`: how fast every way of tracing a scene is, against how often it is wrong.
//!
//! Times are those of `bench`: what the device took, and what the frame waited for its own tree before
//! that (with `rebuild`), over all frames but the first, which warms up. Answers are compared with the exact oracle's,
//! which shares no code with any backend. Shadows, whose rays begin at the reported hit, are compared with
//! those of `exact` on the host over fresh trees.
//!
//! First all is timed, then all is judged, so that the memory of the process is not the judge's. The host's memory is
//! all that is resident of the process, with whatever earlier runs left behind.

mod accuracy;
mod command;
mod hard;
mod plan;
mod rays;
mod truth;

use crate::args::{ChartArgs, RaysName};
use crate::bench::{self, Row};
use crate::progress::Progress;
use crate::session::Ask;
use crate::stop::Stop;
use crate::table::table;
use crate::warm_up::Warmed;
use crate::{frames, info, memory, reduce, talk};
use geom::Animation;
use output::plot::{self, Adapter, Chart, KeyFrameStep, KeyFrames, Machine, Point, Spread};
use output::{FrameStats, Summary};
use pipeline::Frame;
use plan::{ChartPlan, Way};
use scene::Scene;
use std::sync::Arc;

/// What the numbers of the table mean.
const LEGEND: &str = "wrong: closest hits of so many that differ from exact arithmetic; aimed: rays at edges and vertices; \
    mixed range: scenes of far or large parts\n\
    t off: 99.9 % of hits are off by no more; leaks: of so many rays from inside closed bodies, at all offsets\n";

/// A point, and the way it stands for.
type Measured = (Way, Point);

/// Times, judges, draws.
pub(crate) fn run(args: &ChartArgs) -> Result<(), Stop> {
    let plan = ChartPlan::of(args)?;
    if !args.quiet {
        plan.skipped.iter().for_each(|s| talk::say(s));
    }
    let mut work = Work {
        args,
        progress: Progress::new(0, args.quiet),
        chart: Chart {
            title: "abvh: speed against accuracy".to_owned(),
            machine: machine(),
            ..Chart::default()
        },
    };
    let mut measured = Vec::new();
    for spec in &plan.scenes {
        measured.push(work.time_scene(spec, &plan.ways)?);
    }
    work.ask_hard_rays(&mut measured)?;
    for (spec, points) in plan.scenes.iter().zip(&mut measured) {
        work.judge_scene(spec, points)?;
    }
    let Work { chart, .. } = &mut work;
    chart.points = measured
        .into_iter()
        .flatten()
        .map(|(_, point)| point)
        .collect();
    if chart.points.is_empty() {
        return Err(Stop::failed("nothing could be measured"));
    }
    drop(work.progress);
    finish(args, &work.chart)
}

/// Writes the four files, up to the first that cannot be written; links there are replaced.
fn finish(args: &ChartArgs, chart: &Chart) -> Result<(), Stop> {
    let mut text = table(&plot::HEAD, &plot::rows(chart), 5) + LEGEND;
    for (name, content) in [
        ("chart.svg", plot::svg(chart)),
        ("chart.html", plot::html(chart)),
        ("points.csv", plot::csv(chart)),
        ("points.json", plot::json(chart)),
    ] {
        let path = args.out.join(name);
        let content = content.map_err(Stop::failed)?;
        output::remove_link(&path)?;
        output::write_whole(&path, content.as_bytes())?;
        text += &format!("{}\n", path.display());
    }
    talk::print(&text)
}

/// This machine, today; its adapters are found as backends are opened.
pub(crate) fn machine() -> Machine {
    Machine {
        cpu: info::cpu_model(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        date: time::OffsetDateTime::now_utc().date().to_string(),
        adapters: Vec::new(),
    }
}

/// Notes who stands behind a backend's name.
pub(crate) fn add_adapter(machine: &mut Machine, row: &Row) {
    let adapter = Adapter {
        backend: row.backend.to_owned(),
        adapter: row.adapter.clone(),
        driver: row.driver.clone().unwrap_or_default(),
    };
    if !machine.adapters.contains(&adapter) {
        machine.adapters.push(adapter);
    }
}

/// All that is under way.
struct Work<'a> {
    args: &'a ChartArgs,
    progress: Progress,
    chart: Chart,
}

impl Work<'_> {
    fn options(&self) -> scene::Options {
        memory::with_run(self.args.source.options(), self.args.size.count())
    }

    /// Every way's times over one scene.
    fn time_scene(&mut self, spec: &str, ways: &[Way]) -> Result<Vec<Measured>, Stop> {
        let scene = scene::open(spec, &self.options())?;
        if self.chart.scenes.is_empty() {
            output::prepare_dir(&self.args.out).map_err(Stop::bad)?;
        }
        let frames = self.frames(&scene.animation)?;
        // Its own name, or what it was requested by, where that alone is unique.
        let is_taken = self.chart.scenes.iter().any(|s| s.name == scene.name);
        let name = match frames::is_demo(spec) || is_taken {
            true => spec.to_owned(),
            false => scene.name.clone(),
        };
        self.chart.scenes.push(plot::Scene {
            name: name.clone(),
            triangles: scene.animation.triangle_count() as u64,
            size: self.args.size.size,
            frames: frames.len() as u64,
        });
        let mut points = Vec::new();
        self.progress.lengthen(2 * ways.len() as u64 + 2);
        for &way in ways {
            let row = bench::measure(self.run(), (spec, &scene), &frames, &way.ask());
            self.progress.step(&format!("{name} timed {way}"));
            match row {
                Ok(row) => {
                    add_adapter(&mut self.chart.machine, &row);
                    let command = command::of(self.args, spec, &row);
                    points.push((way, timed(&name, &row, command)));
                }
                Err(stop) if way.named => return Err(stop),
                Err(stop) => self.progress.say(&format!("{way} is skipped: {stop}")),
            }
        }
        Ok(points)
    }

    /// Closed bodies and scenes of mixed range, once by each backend and method.
    fn ask_hard_rays(&mut self, measured: &mut [Vec<Measured>]) -> Result<(), Stop> {
        let families = hard::families(self.args.rays);
        let mut known = Vec::new();
        for (way, point) in measured.iter_mut().flatten() {
            let found = known.iter().find(|(of, _)| way.is_like(of));
            let (mixed_range, leaks) = match found.cloned() {
                Some((_, found)) => found,
                None => hard::ask(way, &families, self.args.rays)?,
            };
            if found.is_none() {
                self.progress.lengthen(1);
                self.progress.step(&format!("hard rays {way}"));
                known.push((*way, (mixed_range.clone(), leaks.clone())));
            }
            (point.mixed_range, point.leaks) = (mixed_range, leaks);
        }
        Ok(())
    }

    /// Every way's answers over one scene, and how many key frames it needs.
    fn judge_scene(&mut self, spec: &str, points: &mut [Measured]) -> Result<(), Stop> {
        let mut scene = scene::open(spec, &self.options())?;
        let Some((first, point)) = points.first() else {
            return Ok(());
        };
        let (first, name) = (first.ask(), point.scene.clone());
        let truth = truth::GroundTruth::of(&scene.animation, self.args)?;
        self.progress.step(&format!("{name} exact answers"));
        for (way, point) in points.iter_mut() {
            accuracy::judge(&scene, &way.ask(), &truth)?.enter(point);
            self.progress.step(&format!("{name} judged {way}"));
        }
        if scene.animation.keys().len() > 1 && scene.animation.times().is_none() {
            let steps = self.key_frames(spec, &mut scene, &first)?;
            let scene = name.clone();
            let curves = &mut self.chart.companions.key_frames;
            curves.push(KeyFrames { scene, steps });
        }
        self.progress.step(&format!("{name} key frames"));
        Ok(())
    }

    /// How many key frames a scene needs, and what a frame takes with so many.
    fn key_frames(
        &self,
        spec: &str,
        scene: &mut Scene,
        ask: &Ask<'_>,
    ) -> Result<Vec<KeyFrameStep>, Stop> {
        let animation = Arc::clone(&scene.animation);
        let reduce::Curve { diagonal, points } = reduce::curve(&animation)?;
        let frames = self.frames(&animation)?;
        let mut last: Option<(Vec<usize>, Option<f64>)> = None;
        let mut steps = Vec::new();
        for (point, kept) in points {
            let ms = match last.take().filter(|(of, _)| *of == kept) {
                Some((_, ms)) => ms,
                None => {
                    scene.animation = Arc::new(reduce::left(&animation, &kept)?);
                    let row = bench::measure(self.run(), (spec, &*scene), &frames, ask)?;
                    timed("", &row, String::new()).ms_per_frame.median
                }
            };
            last = Some((kept, ms));
            steps.push(KeyFrameStep {
                tolerance: Some(point.share),
                key_frames: point.keys as u64,
                max_error: Some(point.max_error / diagonal),
                ms,
            });
        }
        Ok(steps)
    }

    fn frames(&self, animation: &Animation) -> Result<Vec<Frame>, Stop> {
        let keys = animation.whole_times();
        frames::list(Some(&self.args.frames), None, keys, false)
    }

    /// What all runs share.
    fn run(&self) -> bench::Run {
        bench::Run {
            rays: RaysName::Camera,
            size: self.args.size.size,
            warm_up: self.args.warm_up.warm_up(),
        }
    }
}

/// How fast a way was.
fn timed(scene: &str, row: &Row, command: String) -> Point {
    let frames = match row.per_frame.as_slice() {
        [_, rest @ ..] if !rest.is_empty() => rest,
        all => all,
    };
    // What the device took, after what the frame waited for its tree.
    let ms = |frame: &FrameStats| Some(frame.device_ms? + frame.build_wait_ms.unwrap_or(0.0));
    let spread = || frames.iter().filter_map(ms);
    let summary = Summary::of(spread());
    let most = |bytes: fn(&FrameStats) -> Option<u64>| frames.iter().filter_map(bytes).max();
    let on_host = (row.backend == "cpu").then(|| most(|f| f.host_bytes));
    Point {
        backend: row.backend.to_owned(),
        layout: row.layout.to_owned(),
        intersector: row.intersector.to_owned(),
        update: row.update.to_owned(),
        scene: scene.to_owned(),
        ms_per_frame: Spread {
            median: summary.map(|s| s.median),
            // The largest that 95 of 100 do not fall below.
            p5: Summary::of(spread().map(|ms| -ms)).map(|s| -s.p95),
            p95: summary.map(|s| s.p95),
        },
        mrays_per_s: row.mrays_per_s,
        memory_bytes: most(|f| f.device_bytes).or(on_host.flatten()),
        samples: frames.len() as u64,
        warm_up_s: row.warm_up.map(Warmed::seconds),
        command,
        ..Point::default()
    }
}
