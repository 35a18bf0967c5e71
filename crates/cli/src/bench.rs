//! `abvh bench`: every stage over scenes, backends, update policies, intersectors and layouts.

mod compare;
mod results;
mod row;

use crate::args::{BackendName, BenchArgs, MethodArgs, RaysName, Switch, UpdateName, word};
use crate::choose::{self, Ahead, Ask};
use crate::progress::Progress;
use crate::stop::Stop;
use crate::{conflicts, frames, info, memory, open, record, talk, threads};
pub(crate) use row::{Row, Run, frame_ms, measure};
use serde::Serialize;
use serde_json::Value;

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
    ratios: Vec<Value>,
}

pub(crate) fn run(args: &BenchArgs) -> Result<(), Stop> {
    let read = args.compare.iter().map(|file| ("--compare", file.clone()));
    let written = [("--json", args.json.as_ref()), ("--csv", args.csv.as_ref())];
    conflicts::of_files(&args.scenes, read, written)?;
    if !args.compare.is_empty() {
        return compare::run(args);
    }
    let rows = measure_all(args)?;
    results::check(&rows, args.against.as_deref())?;
    let report = Report {
        schema: output::SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        command_line: record::command_line(),
        cpu: info::cpu_model(),
        cores: threads::cores(),
        size: args.size.size,
        ratios: results::ratios(&rows),
        rows,
    };
    if let Some(file) = &args.json {
        output::write_json(file, &report)?;
    }
    if let Some(file) = &args.csv {
        output::write_whole(file, &results::csv(&report.rows)?)?;
    }
    talk::print(&results::text(&report, args.against.as_deref()))
}

fn measure_all(args: &BenchArgs) -> Result<Vec<Row>, Stop> {
    let (combinations, skipped) = combinations(args);
    let mut progress = Progress::new(0, args.quiet);
    if combinations.is_empty() {
        let why = skipped.join("; ");
        return Err(Stop::bad(format!("nothing is left to measure: {why}")));
    }
    skipped.iter().for_each(|s| progress.say(s));
    let mut rows = Vec::new();
    for spec in &args.scenes {
        let options = memory::with_run(args.source.options(), args.size.count());
        let scene = scene::open(spec, &options)?;
        let keys = scene.animation.whole_times();
        let frames = frames::list(Some(&args.frames), args.time_range, keys, false)?;
        progress.lengthen((args.rays.len() * combinations.len()) as u64);
        let each = |&rays: &RaysName| combinations.iter().map(move |c| (rays, c));
        for (rays, (ask, predict)) in args.rays.iter().flat_map(each) {
            let ask = Ask {
                ahead: Ahead::of(&frames, *predict),
                ..*ask
            };
            let run = Run {
                rays,
                size: args.size.size,
                warm_up: args.warm_up.warm_up,
            };
            let row = measure(run, (spec, &scene), &frames, &ask)?;
            let words = [spec, row.backend, row.update, row.intersector];
            progress.step(&words.join(" "));
            rows.push(row);
        }
    }
    Ok(rows)
}

/// What to set up, and whether trees are built for what comes.
type Combination<'a> = (Ask<'a>, Switch);

/// Everything with everything that makes sense, and remarks on what does not.
fn combinations(args: &BenchArgs) -> (Vec<Combination<'_>>, Vec<String>) {
    let builders: Vec<Option<usize>> = match args.builder_threads.as_slice() {
        [] => vec![None],
        some => some.iter().copied().map(Some).collect(),
    };
    let (mut sound, mut skipped) = (Vec::new(), Vec::new());
    for &backend in &args.backend {
        for (update, predict) in policies(args) {
            for method in methods(args) {
                if let Some(why) = nonsense(backend, update, method) {
                    skipped.push(why);
                    continue;
                }
                let ask = Ask {
                    adapter: args.adapter.as_deref(),
                    threads: args.threads,
                    tolerance: args.tolerance.ppm(),
                    ..Ask::of(backend, method, choose::free_update(update))
                };
                sound.extend(builders.iter().map(|&builder_threads| {
                    let ask = Ask {
                        builder_threads,
                        ..ask
                    };
                    (ask, predict)
                }));
            }
        }
    }
    skipped.dedup();
    (sound, skipped)
}

/// What is wrong with a combination.
fn nonsense(backend: BackendName, update: UpdateName, method: MethodArgs) -> Option<String> {
    let (name, policy) = (word(&backend), word(&update));
    if update == UpdateName::DeviceRebuild && !open::makes_trees(backend) {
        return Some(format!(
            "{name} with device-rebuild is left out: it makes no trees"
        ));
    }
    if !open::has_own_trees(backend) {
        return None;
    }
    if let UpdateName::Async | UpdateName::TSah = update {
        return Some(format!(
            "{name} with {policy} is left out: it makes its trees itself, within each frame"
        ));
    }
    choose::beyond_drivers(method)
        .map(|what| format!("{name} with {what} is left out: it has its own"))
}

/// Each update policy, with and without prediction where that makes a difference.
fn policies(args: &BenchArgs) -> impl Iterator<Item = (UpdateName, Switch)> {
    args.policies.update.iter().flat_map(|&update| {
        let differ = matches!(update, UpdateName::Async | UpdateName::Auto);
        let take = if differ { args.predict.len() } else { 1 };
        args.predict.iter().take(take).map(move |&p| (update, p))
    })
}

fn methods(args: &BenchArgs) -> impl Iterator<Item = MethodArgs> {
    args.intersector.iter().flat_map(|&intersector| {
        let layouts = args.layout.iter();
        layouts.map(move |&layout| MethodArgs {
            intersector,
            layout,
        })
    })
}
