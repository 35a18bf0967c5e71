//! `abvh chart`: how fast every way of tracing a scene is, against how often it is wrong.
//!
//! Times are those of `bench`: what the device took, and what the frame waited for its own tree before
//! that (with `rebuild`), over all frames but the first, which warms up. Answers are compared with crate `oracle`'s,
//! which shares no code with any backend; shadows, whose rays begin at what the hit says of itself, with
//! those of `exact` on the host over fresh trees; so those of `exact` itself can but differ from tree to tree. First
//! all is timed, then all is judged, so that the memory of the process is not the judge's. The host's memory is
//! all that is resident of the process, with whatever earlier runs left behind.

mod accuracy;
mod bodies;
mod files;
mod plan;
mod questions;
mod text;
mod truth;

use crate::args::{ChartArgs, PolicyArgs, RaysName};
use crate::bench::{self, Row};
use crate::choose::{self, Ahead, Choice};
use crate::progress::Progress;
use crate::session::Ask;
use crate::stop::Stop;
use crate::warm_up::Warmed;
use crate::{frames, info, reduce, talk};
use chart::{Adapter, Chart, Companions, KeyFrameStep, KeyFrames, Machine, Point, Spread};
use output::{FrameStats, Summary};
use pipeline::Update;
use plan::{ChartPlan, Way};
use scene::Scene;
use std::sync::Arc;

/// A point, and the way it stands for.
struct Measured {
    way: Way,
    update: Choice<Update>,
    point: Point,
}

/// Times, judges, draws.
pub(crate) fn run(args: &ChartArgs) -> Result<(), Stop> {
    let plan = ChartPlan::of(args)?;
    if !args.quiet {
        plan.skipped.iter().for_each(|s| talk::say(s));
    }
    let mut work = Work {
        args,
        progress: Progress::new(plan.steps(), args.quiet),
        chart: Chart {
            title: "abvh: speed against accuracy".to_owned(),
            machine: Machine {
                cpu: info::cpu_model(),
                version: env!("CARGO_PKG_VERSION").to_owned(),
                date: time::OffsetDateTime::now_utc().date().to_string(),
                adapters: Vec::new(),
            },
            ..Chart::default()
        },
    };
    let mut points = Vec::new();
    for spec in &plan.scenes {
        points.push(work.time_scene(spec, &plan.ways)?);
    }
    let leaks = work.bodies(&points)?;
    for (spec, points) in plan.scenes.iter().zip(&mut points) {
        work.judge_scene(spec, points)?;
    }
    let Work {
        progress,
        mut chart,
        ..
    } = work;
    drop(progress);
    chart.points = points.into_iter().flatten().map(|m| m.point).collect();
    leaks.hand_out(&mut chart.points);
    if chart.points.is_empty() {
        return Err(Stop::failed("nothing could be measured"));
    }
    let written = files::write(&args.out, &chart)?;
    talk::print(&text::text(&chart, &written))
}

/// All that is under way.
struct Work<'a> {
    args: &'a ChartArgs,
    progress: Progress,
    chart: Chart,
}

impl Work<'_> {
    /// Every way's times over one scene.
    fn time_scene(&mut self, spec: &str, ways: &[Way]) -> Result<Vec<Measured>, Stop> {
        let scene = scene::open(spec, &self.args.source.options())?;
        if self.chart.scenes.is_empty() {
            output::prepare_dir(&self.args.out).map_err(Stop::bad)?;
        }
        let keys = scene.animation.whole_times();
        let frames = frames::list(Some(&self.args.frames), None, keys, false)?;
        let name = self.name(spec, &scene);
        self.chart.scenes.push(chart::Scene {
            name: name.clone(),
            triangles: scene.animation.triangle_count() as u64,
            size: self.args.size.size,
            frames: frames.len() as u64,
        });
        let mut points = Vec::new();
        for &way in ways {
            let update = way.update()?;
            if points.iter().any(|m: &Measured| m.is(way, update)) {
                continue;
            }
            let ask = way.ask(update);
            let row = bench::measure(self.run(), (spec, &scene), &frames, &ask);
            self.progress.step(&format!("{name} timed {way}"));
            match row {
                Ok(row) => {
                    self.meet(&row);
                    let command = files::command(self.args, spec, &row);
                    let point = timed(&name, &row, command);
                    points.push(Measured { way, update, point });
                }
                Err(stop) if way.named => return Err(stop),
                Err(stop) => self.progress.say(&format!("{way} is left out: {stop}")),
            }
        }
        Ok(points)
    }

    /// How many key frames a scene needs, and what a frame takes with so many, by the first way that was charted.
    fn key_frames(
        &self,
        name: String,
        (spec, scene): (&str, Scene),
        by: Option<Ask<'_>>,
    ) -> Result<KeyFrames, Stop> {
        let animation = Arc::clone(&scene.animation);
        let reduce::Curve { diagonal, points } = reduce::curve(&animation)?;
        let frames = frames::list(
            Some(&self.args.frames),
            None,
            animation.whole_times(),
            false,
        )?;
        let mut scene = scene;
        let mut last: Option<(Vec<usize>, Option<f64>)> = None;
        let mut steps = Vec::new();
        for (point, kept) in points {
            let known = last.take().filter(|(of, _)| *of == kept).map(|(_, ms)| ms);
            let ms = match (known, &by) {
                (Some(ms), _) => ms,
                (None, None) => None,
                (None, Some(ask)) => {
                    scene.animation = Arc::new(reduce::left(&animation, &kept)?);
                    let row = bench::measure(self.run(), (spec, &scene), &frames, ask)?;
                    timed(&name, &row, String::new()).ms_per_frame.median
                }
            };
            last = Some((kept, ms));
            steps.push(step(point, diagonal, ms));
        }
        let scene = name;
        Ok(KeyFrames { scene, steps })
    }

    /// What all runs share.
    fn run(&self) -> bench::Run {
        bench::Run {
            rays: RaysName::Camera,
            size: self.args.size.size,
            warm_up: self.args.warm_up.warm_up(),
        }
    }

    /// What the chart calls a scene: its own name, or what it was asked for by, where that alone is unique.
    fn name(&self, spec: &str, scene: &Scene) -> String {
        let taken = |name: &str| self.chart.scenes.iter().any(|s| s.name == name);
        if frames::is_demo(spec) || taken(&scene.name) {
            spec.to_owned()
        } else {
            scene.name.clone()
        }
    }

    /// Notes who stands behind a backend's name.
    fn meet(&mut self, row: &Row) {
        let adapters = &mut self.chart.machine.adapters;
        if adapters.iter().all(|a| a.backend != row.backend) {
            adapters.push(Adapter {
                backend: row.backend.to_owned(),
                adapter: row.adapter.clone(),
                driver: row.driver.clone().unwrap_or_default(),
            });
        }
    }

    /// Closed bodies, once a backend and method.
    fn bodies(&mut self, points: &[Vec<Measured>]) -> Result<bodies::LeaksByMethod, Stop> {
        let mut found = bodies::LeaksByMethod::default();
        for Measured { way, point, .. } in points.iter().flatten() {
            if found.knows(point) {
                continue;
            }
            found.fire(way, point, self.args.rays)?;
            let (backend, method) = (&point.backend, &point.intersector);
            let line = format!("closed bodies {backend} {method} {}", point.layout);
            self.progress.step(&line);
        }
        Ok(found)
    }

    /// Every way's answers over one scene, and how many key frames it needs.
    fn judge_scene(&mut self, spec: &str, points: &mut [Measured]) -> Result<(), Stop> {
        let scene = scene::open(spec, &self.args.source.options())?;
        let Some(name) = points.first().map(|m| m.point.scene.clone()) else {
            return Ok(());
        };
        let truth = truth::GroundTruth::of(&scene.animation, self.args)?;
        self.progress
            .step(&format!("{name} exact answers of {} rays", truth.rays()));
        for Measured { way, update, point } in points.iter_mut() {
            let tally = accuracy::judge(&scene, &way.ask(*update), &truth)?;
            tally.enter(point);
            self.progress.step(&format!("{name} judged {way}"));
        }
        let line = format!("{name} key frames");
        if scene.animation.keys().len() > 1 && scene.animation.times().is_none() {
            let by = points.first().map(|m| m.way.ask(m.update));
            let curve = self.key_frames(name, (spec, scene), by)?;
            let Companions { key_frames } = &mut self.chart.companions;
            key_frames.push(curve);
        }
        self.progress.step(&line);
        Ok(())
    }
}

fn step(point: reduce::CurvePoint, diagonal: f64, ms: Option<f64>) -> KeyFrameStep {
    KeyFrameStep {
        tolerance: Some(point.share),
        key_frames: point.keys as u64,
        max_error: Some(point.max_error / diagonal),
        ms,
    }
}

/// How fast a way was.
fn timed(scene: &str, row: &Row, command: String) -> Point {
    let frames = match row.per_frame.as_slice() {
        [_, rest @ ..] if !rest.is_empty() => rest,
        all => all,
    };
    let spread = || frames.iter().filter_map(frame_ms);
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

/// What the device took, after what the frame waited for its tree.
fn frame_ms(frame: &FrameStats) -> Option<f64> {
    Some(frame.device_ms? + frame.build_wait_ms.unwrap_or(0.0))
}

impl Measured {
    /// Whether it stands for the same by another name.
    fn is(&self, way: Way, update: Choice<Update>) -> bool {
        let same = self.way.backend == way.backend && self.way.method == way.method;
        same && self.update.value == update.value
    }
}

impl Way {
    /// How trees follow the motion of a scene.
    fn update(&self) -> Result<Choice<Update>, Stop> {
        let policy = PolicyArgs {
            update: self.update,
            lockstep: None,
        };
        choose::update(policy)
    }

    /// As a session wants it.
    fn ask(&self, update: Choice<Update>) -> Ask<'static> {
        Ask {
            backend: self.backend,
            adapter: None,
            threads: None,
            builder_threads: None,
            method: self.method,
            update,
            tolerance: 0.0,
            run: None,
            ahead: Ahead::default(),
        }
    }
}
