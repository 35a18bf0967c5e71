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
mod hard;
mod plan;

use crate::args::{ChartArgs, RaysName};
use crate::bench::{self, Row};
use crate::choose::Ask;
use crate::stop::Stop;
use crate::table::table;
use crate::talk::Progress;
use crate::{frames, info, talk};
use output::plot::{self, Adapter, Chart, Machine, Point, Spread};
use output::{FrameStats, Summary};

const LEGEND: &str = "wrong: closest hits of so many that differ from exact arithmetic; aimed: rays at edges and vertices; \
    mixed range: scenes of far or large parts\n\
    t off: 99.9 % of hits are off by no more; leaks: of so many rays from inside closed bodies, at all offsets\n";

/// A point, and the way it stands for.
type Measured = (Ask<'static>, Point);

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
    let mut work = Work {
        args,
        progress: Progress::new(0, args.measure.quiet),
        chart: Chart {
            machine,
            ..Chart::default()
        },
    };
    let mut measured = Vec::new();
    for spec in &scenes {
        measured.push(work.time_scene(spec, &ways)?);
    }
    work.ask_hard_rays(&mut measured)?;
    for (spec, points) in scenes.iter().zip(&mut measured) {
        work.judge_scene(spec, points)?;
    }
    let points = measured.into_iter().flatten().map(|(_, point)| point);
    work.chart.points = points.collect();
    if work.chart.points.is_empty() {
        return Err(Stop::failed("nothing could be measured"));
    }
    drop(work.progress);
    finish(args, &work.chart)
}

/// Writes the four files, up to the first that cannot be written; links there are replaced.
fn finish(args: &ChartArgs, chart: &Chart) -> Result<(), Stop> {
    let mut text = table(chart.points.iter().map(plot::row), 5) + LEGEND;
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
}

impl Work<'_> {
    /// Every way's times over one scene.
    fn time_scene(&mut self, spec: &str, ways: &[Ask<'static>]) -> Result<Vec<Measured>, Stop> {
        let scene = bench::open_scene(&self.args.measure, spec)?;
        if self.chart.scenes.is_empty() {
            output::prepare_dir(&self.args.out).map_err(Stop::bad)?;
        }
        let (keys, measure) = (scene.animation.whole_times(), &self.args.measure);
        let frames = frames::list(Some(&measure.frames), None, keys, false)?;
        // Its own name, or what it was requested by, where that alone is unique.
        let is_taken = self.chart.scenes.iter().any(|s| s.name == scene.name);
        let name = match frames::is_demo(spec) || is_taken {
            true => spec.to_owned(),
            false => scene.name.clone(),
        };
        self.chart.scenes.push(plot::Scene {
            name: name.clone(),
            triangles: scene.animation.triangle_count() as u64,
            size: measure.size,
            frames: frames.len() as u64,
        });
        let mut points = Vec::new();
        self.progress.lengthen(2 * ways.len() as u64 + 1);
        for &way in ways {
            let of = (spec, &scene);
            let row = bench::measure(RaysName::Camera, measure, of, &frames, &way);
            self.progress.step(&format!("{name} timed {way}"));
            match row {
                Ok(row) => {
                    self.add_adapter(&row);
                    let command = plan::command(self.args, spec, &row);
                    points.push((way, timed(&name, &row, command)));
                }
                Err(stop) if measure.backend.contains(&way.backend) => return Err(stop),
                Err(stop) => self.progress.say(&format!("{way} is skipped: {stop}")),
            }
        }
        Ok(points)
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

    /// Closed bodies and scenes of mixed range, once by each backend and method.
    fn ask_hard_rays(&mut self, measured: &mut [Vec<Measured>]) -> Result<(), Stop> {
        let families = hard::families(self.args.rays);
        let mut known = Vec::new();
        for (way, point) in measured.iter_mut().flatten() {
            let kind = (way.backend, way.method);
            if !known.iter().any(|(of, _)| *of == kind) {
                known.push((kind, hard::ask(way, &families, self.args.rays)?));
                self.progress.lengthen(1);
                self.progress.step(&format!("hard rays {way}"));
            }
            let found = known.iter().find(|(of, _)| *of == kind);
            (point.mixed_range, point.leaks) = found.map(|f| f.1.clone()).unwrap_or_default();
        }
        Ok(())
    }

    /// Every way's answers over one scene.
    fn judge_scene(&mut self, spec: &str, points: &mut [Measured]) -> Result<(), Stop> {
        let Some(name) = points.first().map(|(_, point)| point.scene.clone()) else {
            return Ok(());
        };
        let animation = bench::open_scene(&self.args.measure, spec)?.animation;
        let truth = accuracy::GroundTruth::of(&animation, self.args)?;
        self.progress.step(&format!("{name} exact answers"));
        for (way, point) in points {
            truth.judge(&animation, way, point)?;
            self.progress.step(&format!("{name} judged {way}"));
        }
        Ok(())
    }
}

fn timed(scene: &str, row: &Row, command: String) -> Point {
    let frames = row.later_frames();
    let spread = || frames.iter().filter_map(bench::frame_ms);
    let summary = Summary::of(spread());
    let most = |bytes: fn(&FrameStats) -> Option<u64>| frames.iter().filter_map(bytes).max();
    let on_host = (row.setup.backend == "cpu").then(|| most(|f| f.host_bytes));
    Point {
        backend: row.setup.backend.to_owned(),
        layout: row.setup.layout.to_owned(),
        intersector: row.setup.intersector.to_owned(),
        update: row.setup.update.to_owned(),
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
        warm_up_s: row.warm_up.map(|w| w.seconds),
        command,
        ..Point::default()
    }
}
