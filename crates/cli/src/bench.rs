//! `abvh bench`: every stage over scenes, backends, update policies, intersectors and layouts.

mod compare;
mod growth;
mod rays;
mod rivals;
mod row;
mod sheet;
mod text;

use crate::ahead::Ahead;
use crate::args::{BackendName, BenchArgs, MethodArgs, PolicyArgs, Switch, UpdateName};
use crate::progress::Progress;
use crate::session::Ask;
use crate::stop::Stop;
use crate::{choose, conflicts, frames, info, record, talk, threads};
use clap::ValueEnum;
use pipeline::Frame;
pub(crate) use row::{Row, Run, measure};
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
}

/// Measures.
pub(crate) fn run(args: &BenchArgs) -> Result<(), Stop> {
    let read = args.compare.iter().map(|file| ("--compare", file.clone()));
    let written = [
        ("--json", args.json.as_ref()),
        ("--csv", args.csv.as_ref()),
        ("--growth", args.growth.as_ref()),
    ];
    conflicts::of_files(&args.scenes, read, written)?;
    for file in written.iter().filter_map(|(_, file)| *file) {
        output::check_writable(file).map_err(Stop::bad)?;
    }
    if !args.compare.is_empty() {
        return compare::run(args);
    }
    let mut bench = Bench::new(args)?;
    for spec in &args.scenes {
        let scene = scene::open(spec, &args.source.options())?;
        let keys = scene.animation.whole_times();
        let frames = frames::list(Some(&args.frames), args.time_range, keys, false)?;
        let place = (&spec[..], &scene, &frames[..]);
        bench.all(place)?;
    }
    let report = bench.report()?;
    if let Some(file) = &args.json {
        output::write_json(file, &report)?;
    }
    if let Some(file) = &args.csv {
        output::write_whole(file, sheet::csv(&report.rows)?.as_bytes())?;
    }
    if let Some(file) = &args.growth {
        output::write_whole(file, growth::svg(&report)?.as_bytes())?;
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
}

/// A scene by its name, and the frames to run.
type Place<'a> = (&'a str, &'a Scene, &'a [Frame]);

impl<'a> Bench<'a> {
    fn new(args: &'a BenchArgs) -> Result<Self, Stop> {
        let (combinations, skipped) = combinations(args);
        let progress = Progress::new(0, args.quiet);
        if combinations.is_empty() {
            let why = skipped.join("; ");
            return Err(Stop::bad(format!("nothing is left to measure: {why}")));
        }
        skipped.iter().for_each(|s| progress.say(s));
        Ok(Self {
            args,
            tolerance: args.tolerance.ppm(),
            combinations,
            progress,
            rows: Vec::new(),
        })
    }

    /// Every combination over one scene.
    fn all(&mut self, (spec, scene, frames): Place<'_>) -> Result<(), Stop> {
        let args = self.args;
        let builders: Vec<Option<usize>> = match args.builder_threads.as_slice() {
            [] => vec![None],
            some => some.iter().copied().map(Some).collect(),
        };
        let mut runs = Vec::new();
        for &rays in &args.rays {
            for &combination in &self.combinations {
                runs.extend(builders.iter().map(|&builder| (rays, combination, builder)));
            }
        }
        self.progress.lengthen(runs.len() as u64);
        for (rays, (backend, (policy, predict), method), builder_threads) in runs {
            let ask = Ask {
                backend,
                adapter: args.adapter.as_deref(),
                threads: args.threads,
                builder_threads,
                method,
                update: choose::update(policy)?,
                tolerance: self.tolerance,
                run: None,
                ahead: Ahead::of(frames, predict),
            };
            let run = Run {
                rays,
                size: args.size.size,
                warm_up: args.warm_up.warm_up(),
            };
            let row = measure(run, (spec, scene), frames, &ask)?;
            let words = [spec, row.backend, row.update, row.intersector];
            self.progress.step(&words.join(" "));
            self.rows.push(row);
        }
        Ok(())
    }

    fn report(self) -> Result<Report, Stop> {
        let Self { args, rows, .. } = self;
        rivals::check(&rows, args.against.as_deref())?;
        Ok(Report {
            schema: 1,
            version: env!("CARGO_PKG_VERSION"),
            command_line: record::command_line(),
            cpu: info::cpu_model(),
            cores: threads::cores(),
            size: args.size.size,
            ratios: rivals::ratios(&rows),
            rows,
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
        return None;
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
        let layouts = args.layouts.layout.iter();
        layouts.map(move |&layout| MethodArgs {
            intersector,
            layout,
        })
    })
}

/// Each update policy, with and without prediction where that makes a difference.
fn policies(args: &BenchArgs) -> impl Iterator<Item = (UpdateName, Switch)> {
    args.policies.update.iter().flat_map(|&update| {
        let differ = matches!(update, UpdateName::Async | UpdateName::Auto);
        let take = if differ { args.predict.len() } else { 1 };
        args.predict.iter().take(take).map(move |&p| (update, p))
    })
}
