//! `abvh bench`: every stage over scenes, backends, update policies, intersectors and layouts.

mod auto;
mod compare;
mod floor;
mod fresh;
mod rays;
mod repetition;
mod rivals;
mod row;
mod text;

use crate::ahead::Ahead;
use crate::args::{BackendName, BenchArgs, MethodArgs, PolicyArgs, Switch, UpdateName};
use crate::progress::Progress;
use crate::session::Ask;
use crate::stop::Stop;
use crate::{choose, conflicts, frames, info, record, talk, threads};
use clap::ValueEnum;
use pipeline::Frame;
pub(crate) use repetition::FrameRepetition;
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
    /// The byte floor of every run, where that was asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    floors: Vec<floor::Floor>,
    /// How `auto` fared, where that was asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    with_auto: Vec<auto::Check>,
}

/// Measures.
pub(crate) fn run(args: &BenchArgs) -> Result<(), Stop> {
    let read = args.compare.iter().map(|file| ("--compare", file.clone()));
    conflicts::of_files(&args.scenes, read, [("--json", args.json.as_ref())])?;
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
        let frames = frames::list(Some(&args.frames), args.time_range, keys, false)?;
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
            if combinations.is_empty() {
                let why = skipped.join("; ");
                return Err(Stop::bad(format!("nothing is left to measure: {why}")));
            }
            skipped.iter().for_each(|s| progress.say(s));
        }
        Ok(Self {
            args,
            tolerance: args.tolerance.ppm(),
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
        let runs = args.rays.iter().flat_map(|&rays| {
            let all = self.combinations.iter();
            all.map(move |&combination| (rays, combination))
        });
        let runs: Vec<_> = runs.collect();
        self.progress.lengthen(runs.len() as u64);
        let mut rows = Vec::with_capacity(runs.len());
        for (rays, (backend, (policy, predict), method)) in runs {
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
            let run = Run {
                rays,
                size: args.size.size,
                warm_up: args.warm_up.warm_up(),
                dwell: args.dwell(),
            };
            let row = measure(run, (spec, scene), frames, &ask)?;
            let words = [spec, row.backend, row.update, row.intersector];
            self.progress.step(&words.join(" "));
            rows.push(row);
        }
        fresh::note(&mut rows);
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
            size: args.size.size,
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

/// The mean; `None` of nothing.
fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
    (count > 0.0).then(|| sum / count)
}
