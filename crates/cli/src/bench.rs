//! `abvh bench`: every stage over scenes, backends, update policies, intersectors and layouts.

mod auto;
mod compare;
mod floor;
mod rivals;
mod text;

use crate::ahead::Ahead;
use crate::args::{BackendName, BenchArgs, LayoutName, MethodArgs, PolicyArgs, Switch, UpdateName};
use crate::progress::Progress;
use crate::session::{self, Ask, Session};
use crate::stop::Stop;
use crate::table::mrays;
use crate::trial::Run;
use crate::{choose, frames, info, record, talk, threads};
use backend::{Intersector, Query, Rays, Seek};
use clap::ValueEnum;
use pipeline::Frame;
use report::{FrameStats, Summary, Taken, Time};
use scene::Scene;
use serde::Serialize;

/// Vertical field of view, in degrees, as with `render`.
pub(crate) const FOV: f32 = 40.0;

#[derive(Serialize)]
struct Report {
    schema: u32,
    version: &'static str,
    command_line: Vec<String>,
    cpu: Option<String>,
    cores: usize,
    size: [u32; 2],
    rows: Vec<Row>,
    /// Every run over every other of its scene.
    ratios: Vec<rivals::Ratio>,
    /// The byte floor of every run, where that was asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    floors: Vec<floor::Floor>,
    /// How `auto` fared, where that was asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    with_auto: Vec<auto::Check>,
}

/// One run. Times are medians over its frames, in milliseconds.
#[derive(Serialize)]
pub(crate) struct Row {
    scene: String,
    pub(crate) triangles: usize,
    /// Triangles that move.
    moving: usize,
    pub(crate) backend: &'static str,
    pub(crate) adapter: String,
    pub(crate) driver: Option<String>,
    threads: usize,
    builder_threads: usize,
    pub(crate) update: &'static str,
    /// With `async`: whether trees are built for what comes.
    predict: Option<bool>,
    pub(crate) intersector: &'static str,
    pub(crate) layout: &'static str,
    frames: usize,
    interpolate_ms: Option<f64>,
    preprocess_ms: Option<f64>,
    rebuild_ms: Option<f64>,
    refit_ms: Option<f64>,
    /// All that comes before rays: the four above.
    geometry_ms: Option<f64>,
    trace_primary_ms: Option<f64>,
    trace_shadow_ms: Option<f64>,
    device_ms: Option<f64>,
    wall_ms: Option<f64>,
    /// Primary and shadow rays in the time of both.
    pub(crate) mrays_per_s: Option<f64>,
    build_ms: Option<f64>,
    convert_ms: Option<f64>,
    build_ns_per_triangle: Option<f64>,
    convert_ns_per_triangle: Option<f64>,
    trees: usize,
    /// Trees that were no better than the one in use.
    rejected: usize,
    tree_age_frames: Option<f64>,
    sah_ratio: Option<f64>,
    sah_cost: Option<f64>,
    /// What a frame has to move at least.
    bytes: floor::Bytes,
    /// What was left to `auto`.
    auto: Vec<Taken>,
    /// Intersectors that are known to meet the tolerance.
    #[serde(skip)]
    meets: Vec<&'static str>,
    /// Every frame, as in the statistics of `render`.
    pub(crate) per_frame: Vec<FrameStats>,
}

/// Measures.
pub(crate) fn run(args: &BenchArgs) -> Result<(), Stop> {
    crate::threads::limit(args.threads);
    if let Some(file) = &args.json {
        report::check_writable(file).map_err(Stop::bad)?;
    }
    if !args.compare.is_empty() {
        return compare::run(args);
    }
    let mut bench = Bench::new(args)?;
    for spec in &args.scenes {
        let scene = scene::open(spec, &args.source.options())?;
        let keys = scene.animation.whole_times();
        let frames = frames::list(Some(args.frames), args.time_range, keys, false)?;
        let place = (&spec[..], &scene, &frames[..]);
        if args.with_auto {
            bench.with_auto(place)?;
        } else {
            let rows = bench.all(place, args.builder_threads)?;
            bench.rows.extend(rows);
        }
    }
    let report = bench.report()?;
    if let Some(file) = &args.json {
        report::write_json(file, &report)?;
    }
    talk::print(&text::text(&report, args.against.as_deref()))
}

/// All that is under way.
struct Bench<'a> {
    args: &'a BenchArgs,
    tolerance: f64,
    combinations: Vec<Combination>,
    progress: Progress,
    rows: Vec<Row>,
    checks: Vec<auto::Check>,
}

/// A scene by its name, and the frames to run.
type Place<'a> = (&'a str, &'a Scene, &'a [Frame]);

impl<'a> Bench<'a> {
    fn new(args: &'a BenchArgs) -> Result<Self, Stop> {
        let (combinations, skipped) = combinations(args);
        let progress = Progress::new(0, args.quiet);
        if !args.with_auto {
            skipped.iter().for_each(|s| progress.say(s));
        }
        Ok(Self {
            args,
            tolerance: args.tolerance.of(&args.intersector)?,
            combinations,
            progress,
            rows: Vec::new(),
            checks: Vec::new(),
        })
    }

    /// Every combination over one scene.
    fn all(
        &mut self,
        (spec, scene, frames): Place<'_>,
        builder_threads: Option<usize>,
    ) -> Result<Vec<Row>, Stop> {
        let args = self.args;
        self.progress.lengthen(self.combinations.len() as u64);
        let mut rows = Vec::with_capacity(self.combinations.len());
        for &(backend, (policy, predict), method) in &self.combinations {
            let ask = Ask {
                backend,
                adapter: args.adapter.as_deref(),
                threads: args.threads,
                builder_threads,
                method,
                update: choose::update(policy, &scene.animation, frames)?,
                tolerance: self.tolerance,
                run: None,
                ahead: Ahead::of(frames, predict),
            };
            let row = measure(args.size, (spec, scene), frames, &ask)?;
            let words = [spec, row.backend, row.update, row.intersector];
            self.progress.step(&words.join(" "));
            rows.push(row);
        }
        Ok(rows)
    }

    /// What `auto` takes beside all it could take.
    fn with_auto(&mut self, (spec, scene, frames): Place<'_>) -> Result<(), Stop> {
        let (args, tolerance) = (self.args, self.tolerance);
        let place = auto::Place {
            args,
            tolerance,
            spec,
            scene,
            frames,
        };
        for &backend in &args.backend {
            for &intersector in &args.intersector {
                let (check, runs) = place.check((backend, intersector), &mut self.progress)?;
                self.checks.push(check);
                self.rows.extend(runs);
            }
        }
        Ok(())
    }

    fn report(self) -> Result<Report, Stop> {
        let Self {
            args, rows, checks, ..
        } = self;
        rivals::check(&rows, args.against.as_deref())?;
        let mut bandwidths = floor::Bandwidths::default();
        let adapter = args.adapter.as_deref();
        let floored = rows.iter().filter(|_| args.floor);
        let floors: Result<_, Stop> = floored.map(|r| bandwidths.floor(r, adapter)).collect();
        Ok(Report {
            schema: 1,
            version: env!("CARGO_PKG_VERSION"),
            command_line: record::command_line(),
            cpu: info::cpu_model(),
            cores: threads::cores(),
            size: args.size,
            ratios: rivals::ratios(&rows),
            floors: floors?,
            rows,
            with_auto: checks,
        })
    }
}

type Combination = (BackendName, (PolicyArgs, Switch), MethodArgs);

/// Everything with everything that makes sense, and remarks on what does not.
fn combinations(args: &BenchArgs) -> (Vec<Combination>, Vec<String>) {
    let all = everything(args).into_iter();
    let (sound, senseless): (Vec<_>, Vec<_>) = all.partition(|c| nonsense(c).is_none());
    let mut skipped: Vec<String> = senseless.iter().filter_map(nonsense).collect();
    skipped.dedup();
    (sound, skipped)
}

/// What is wrong with a combination.
fn nonsense(&(backend, (policy, _), method): &Combination) -> Option<String> {
    let value = backend.to_possible_value()?;
    let name = value.get_name();
    if policy.update == UpdateName::DeviceRebuild && !crate::open::makes_trees(backend) {
        return Some(format!(
            "{name} with device-rebuild is left out: it makes no trees"
        ));
    }
    if !crate::open::has_own_trees(backend) {
        let treelets = method.layout == LayoutName::Fast;
        return (policy.update == UpdateName::DeviceRebuild && treelets).then(|| {
            "device-rebuild is left out with layout fast: it makes bvh2 alone".to_owned()
        });
    }
    let backend = name;
    if let UpdateName::Async | UpdateName::TSah = policy.update {
        let update = policy.update.to_possible_value()?;
        return Some(format!(
            "{backend} with {} is left out: it makes its trees itself, within each frame",
            update.get_name()
        ));
    }
    choose::beyond_drivers(method)
        .map(|what| format!("{backend} with {what} is left out: it has its own"))
}

/// Everything with everything.
fn everything(args: &BenchArgs) -> Vec<Combination> {
    let mut all = Vec::new();
    for &backend in &args.backend {
        for (update, predict) in policies(args) {
            let policy = PolicyArgs {
                update,
                lockstep: None,
            };
            all.extend(methods(args).map(|method| (backend, (policy, predict), method)));
        }
    }
    all
}

/// Every intersector with every layout.
fn methods(args: &BenchArgs) -> impl Iterator<Item = MethodArgs> {
    args.intersector.iter().flat_map(|&intersector| {
        let layouts = args.layout.iter();
        layouts.map(move |&layout| MethodArgs {
            intersector,
            layout,
        })
    })
}

/// Each update policy, with and without prediction where that makes a difference.
fn policies(args: &BenchArgs) -> impl Iterator<Item = (UpdateName, Switch)> {
    args.update.iter().flat_map(|&update| {
        let differ = matches!(update, UpdateName::Async | UpdateName::Auto);
        let take = if differ { args.predict.len() } else { 1 };
        args.predict.iter().take(take).map(move |&p| (update, p))
    })
}

/// One run over `frames`.
pub(crate) fn measure(
    size: [u32; 2],
    (spec, scene): (&str, &Scene),
    frames: &[Frame],
    ask: &Ask<'_>,
) -> Result<Row, Stop> {
    let view = picture::frame_scene(&scene.animation, FOV, size);
    let camera = view
        .camera(size)
        .ok_or_else(|| Stop::bad(format!("no camera frames {spec}")))?;
    let query = Query {
        rays: Rays::Camera(&camera),
        seek: Seek::ClosestAndShadow { light: view.light },
    };
    let run = Some(Run { frames, query });
    let mut session = session::start(&scene.animation, &Ask { run, ..*ask })?;
    let mut stats = Vec::new();
    session
        .driver
        .run::<Stop>(frames.iter().copied(), query, false, |frame, _| {
            stats.push(record::row(frame));
            Ok(())
        })?;
    Ok(row(spec, scene, &session, stats, camera.pixels()))
}

fn row(
    spec: &str,
    scene: &Scene,
    session: &Session,
    frames: Vec<FrameStats>,
    pixels: usize,
) -> Row {
    let median = |time: Time| Summary::of(frames.iter().filter_map(time)).map(|s| s.median);
    let triangles = scene.animation.live_count();
    let per_triangle = |time: Time| median(time).map(|ms| ms * 1e6 / triangles.max(1) as f64);
    let rates = frames.iter().filter_map(|f| {
        let ms = f.trace_primary_ms? + f.trace_shadow_ms.unwrap_or(0.0);
        mrays(pixels as f64 + f.hits as f64, ms)
    });
    let device = &session.device;
    Row {
        scene: spec.to_owned(),
        triangles: scene.animation.triangle_count(),
        moving: scene.animation.moving_count(),
        backend: device.backend,
        adapter: device.adapter.clone(),
        driver: (!device.driver.is_empty()).then(|| device.driver.clone()),
        threads: session.threads.render,
        builder_threads: session.threads.build,
        update: choose::update_name(session.update),
        predict: session.predict,
        intersector: session.method[0],
        layout: session.method[1],
        frames: frames.len(),
        interpolate_ms: median(|f| f.interpolate_ms),
        preprocess_ms: median(|f| f.preprocess_ms),
        rebuild_ms: median(|f| f.rebuild_ms),
        refit_ms: median(|f| f.refit_ms),
        geometry_ms: median(geometry),
        trace_primary_ms: median(|f| f.trace_primary_ms),
        trace_shadow_ms: median(|f| f.trace_shadow_ms),
        device_ms: median(|f| f.device_ms),
        wall_ms: median(|f| f.wall_ms),
        mrays_per_s: Summary::of(rates).map(|s| s.median),
        build_ms: median(|f| f.build_ms),
        convert_ms: median(|f| f.convert_ms),
        build_ns_per_triangle: per_triangle(|f| f.build_ms),
        convert_ns_per_triangle: per_triangle(|f| f.convert_ms),
        trees: frames.iter().filter(|f| f.adopted).count(),
        rejected: frames.iter().filter(|f| f.rejected).count(),
        tree_age_frames: median(|f| Some(f.tree_age_frames as f64)),
        sah_ratio: median(|f| f.sah_ratio),
        sah_cost: median(|f| f.sah_cost),
        bytes: floor::Bytes::of(
            &scene.animation,
            session.method[0].parse().unwrap_or(Intersector::Watertight),
            pixels,
        ),
        auto: session.taken.clone(),
        meets: session.meets.iter().map(|i| i.name()).collect(),
        per_frame: frames,
    }
}

/// Milliseconds of a frame's stages before rays; `None` if it left all of them out.
fn geometry(frame: &FrameStats) -> Option<f64> {
    let stages = [
        frame.interpolate_ms,
        frame.preprocess_ms,
        frame.rebuild_ms,
        frame.refit_ms,
    ];
    stages.into_iter().flatten().reduce(|a, b| a + b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn geometry_is_what_is_known_of_its_stages() {
        let mut frame = FrameStats::default();
        assert_eq!(geometry(&frame), None);
        frame.refit_ms = Some(2.0);
        frame.preprocess_ms = Some(0.5);
        assert_eq!(geometry(&frame), Some(2.5));
    }
}
