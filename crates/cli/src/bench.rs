//! `abvh bench`: measures every stage over scenes, backends, update policies and intersectors.

mod compare;
mod failure;
mod results;
mod row;

use crate::args::{
    BackendChoice, BenchArgs, MeasureArgs, RaysName, UpdateName, backend_name, update_name,
};
use crate::choose::Ask;
use crate::conflicts::Files;
use crate::open::{Opening, makes_trees};
use crate::rival::{self, Contest, Running};
use crate::stop::{self, Stop};
use crate::talk::Progress;
use crate::{frames, info, talk, values};
use backend::Policy;
use failure::Failure;
use pipeline::Frame;
pub(crate) use row::{Combination, Row, frame_ms, measure, random_rays};
use row::{Measured, Shots};
use scene::Scene;
use serde_json::json;

/// Vertical field of view, in degrees, as with `render`.
pub(crate) const FOV: f32 = 40.0;

pub(crate) fn run(args: &BenchArgs) -> Result<(), Stop> {
    let read = args.compare.iter().map(|file| ("--compare", file.clone()));
    let files = Files {
        read: read.collect(),
        ..Files::written(&[("--json", &args.json), ("--csv", &args.csv)])
    };
    files.check(&args.measure.scenes)?;
    if !args.compare.is_empty() {
        return compare::run(args);
    }
    let results = measure_all(args)?;
    let (rows, failures) = (&results.rows, &results.failures);
    // A baseline that failed must not discard the other runs.
    if failures.is_empty() {
        results::check(rows, args.against.as_deref())?;
    }
    let (cpu, size) = (info::cpu_model(), args.measure.size);
    if let Some(file) = &args.json {
        let report = json!({
            "schema": output::SCHEMA,
            "version": env!("CARGO_PKG_VERSION"),
            "command_line": info::command_line(),
            "cpu": cpu,
            "cores": host::cores(),
            "size": size,
            "ratios": results::ratios(rows),
            "rows": results::json(&results),
        });
        output::write_json(file, &report)?;
    }
    if let Some(file) = &args.csv {
        output::write_whole(file, results::csv(&results)?.as_bytes())?;
    }
    let [width, height] = size;
    let cpu = cpu.as_deref().unwrap_or("unknown cpu");
    let text = results::text(&results, args.against.as_deref());
    let head = format!("medians in ms at {width}x{height} on {cpu}\n");
    talk::print(&(head + &text))?;
    match failures.len() {
        0 => Ok(()),
        n => Err(Stop::failed(format!(
            "{n} of {} runs failed; their rows give the reason",
            n + rows.len()
        ))),
    }
}

/// Results of all combinations.
struct Results {
    rows: Vec<Row>,
    /// Combinations that could not be measured.
    failures: Vec<Failure>,
}

pub(crate) fn open_scene(args: &MeasureArgs, spec: &str) -> Result<Scene, Stop> {
    let options = args.source.options_of_run(values::pixels(args.size));
    Ok(scene::open(spec, &options)?)
}

/// A way to measure a combination.
#[derive(Clone, Copy)]
enum Way<'a> {
    Ours(&'a Ask<'a>),
    Rival(Contest),
}

fn measure_all(args: &BenchArgs) -> Result<Results, Stop> {
    let (asks, mut skipped) = combinations(args);
    let (contests, unknown) = rival::contests(&args.measure.rival, &args.measure.update);
    skipped.extend(unknown);
    let mut progress = Progress::new(0, args.measure.quiet);
    let ways: Vec<Way<'_>> = asks.iter().map(Way::Ours).collect();
    let ways = [ways, contests.into_iter().map(Way::Rival).collect()].concat();
    if ways.is_empty() {
        let why = skipped.join("; ");
        return Err(Stop::bad(format!("nothing is left to measure: {why}")));
    }
    skipped.iter().for_each(|s| progress.say(s));
    let each = |&rays: &RaysName| ways.iter().map(move |&way| (rays, way));
    let runs: Vec<_> = args.rays.iter().flat_map(each).collect();
    progress.lengthen((args.measure.scenes.len() * runs.len()) as u64);
    let (mut rows, mut failures, mut stops) = (Vec::new(), Vec::new(), Vec::new());
    for spec in &args.measure.scenes {
        let opened = open_with_frames(args, spec);
        for &(rays, way) in &runs {
            let measured = opened.as_ref().map_err(Stop::clone);
            let measured = measured.and_then(|(scene, frames)| {
                let combination = Combination {
                    spec,
                    scene,
                    frames,
                    rays,
                    size: args.measure.size,
                    warm_up: args.measure.warm_up,
                };
                match way {
                    Way::Ours(ask) => Ok(measure(&combination, ask, Opening::default())?.0),
                    Way::Rival(contest) => {
                        let on = (args.adapter.as_deref(), args.threads);
                        Ok(measure_rival(&combination, contest, on)?.0)
                    }
                }
            });
            match measured {
                Ok(row) => {
                    let how = &row.setup;
                    progress.step(&[spec, how.backend, how.update, how.intersector].join(" "));
                    rows.push(row);
                }
                Err(stop) => {
                    let failure = match way {
                        Way::Ours(ask) => Failure::new((spec, rays), ask, &stop),
                        Way::Rival(contest) => Failure::of_rival((spec, rays), contest, &stop),
                    };
                    progress.step(&failure.to_string());
                    failures.push(failure);
                    stops.push(stop);
                }
            }
        }
    }
    match rows.is_empty() {
        true => Err(stop::all_failed(stops)),
        false => Ok(Results { rows, failures }),
    }
}

/// Measures a rival on an adapter, with threads of the host if it uses them. Returns the rival too, with the scene loaded.
pub(crate) fn measure_rival(
    combination: &Combination<'_>,
    contest: Contest,
    on: (Option<&str>, Option<usize>),
) -> Result<(Row, Running), Stop> {
    let Combination { scene, frames, .. } = *combination;
    let shots = Shots::of(combination)?;
    let query = shots.query();
    let mut running = Running::start(contest, on, &scene.animation)?;
    let timed = running.time(frames, query, combination.warm_up)?;
    let measured = Measured {
        setup: timed.setup,
        warm_up: timed.warm_up,
        stats: timed.stats,
        held: timed.held,
        differing: Some(running.differing(frames, query)?),
    };
    Ok((Row::of(combination, measured), running))
}

/// Opens a scene, and lists the frames to measure.
fn open_with_frames(args: &BenchArgs, spec: &str) -> Result<(Scene, Vec<Frame>), Stop> {
    let scene = open_scene(&args.measure, spec)?;
    let keys = scene.animation.whole_times();
    let frames = frames::list(Some(&args.measure.frames), args.time_range, keys, false)?;
    Ok((scene, frames))
}

/// Returns all meaningful combinations, and remarks on the others.
fn combinations(args: &BenchArgs) -> (Vec<Ask<'_>>, Vec<String>) {
    let builders: Vec<Option<usize>> = match args.builder_threads.as_slice() {
        [] => vec![None],
        some => some.iter().copied().map(Some).collect(),
    };
    let (mut sound, mut skipped) = (Vec::new(), Vec::new());
    for &backend in &args.measure.backend {
        for (update, predict) in policies(args) {
            for &intersector in &args.measure.intersector {
                if let Some(why) = nonsense(backend, update) {
                    skipped.push(why);
                    continue;
                }
                let ask = Ask {
                    adapter: args.adapter.as_deref(),
                    threads: args.threads,
                    predict,
                    ..Ask::of(backend, intersector, update)
                };
                sound.extend(builders.iter().map(|&builder_threads| Ask {
                    builder_threads,
                    ..ask
                }));
            }
        }
    }
    skipped.dedup();
    (sound, skipped)
}

/// Returns what is wrong with a combination.
fn nonsense(backend: BackendChoice, update: UpdateName) -> Option<String> {
    let is_sound = !update.is_some_and(Policy::builds_on_device) || makes_trees(backend);
    let (name, policy) = (backend_name(backend), update_name(update));
    (!is_sound).then(|| format!("{name} with {policy} is left out: it makes no trees"))
}

/// Returns each update policy, with and without prediction if that makes a difference.
fn policies(args: &BenchArgs) -> impl Iterator<Item = (UpdateName, bool)> {
    args.measure.update.iter().flat_map(|&update| {
        let differ = update.is_none_or(Policy::builds_beside_frames);
        let take = if differ { args.predict.len() } else { 1 };
        args.predict.iter().take(take).map(move |&p| (update, p))
    })
}
