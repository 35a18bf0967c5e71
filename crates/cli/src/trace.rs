//! `abvh trace`: traces the rays of a file at one time.

use crate::args::TraceArgs;
use crate::choose::Ask;
use crate::conflicts::Files;
use crate::session;
use crate::stop::Stop;
use crate::table::counted;
use crate::{frames, talk};
use abvh::Query;
use backend::Policy;
use output::HitArrays;

pub(crate) fn run(args: &TraceArgs) -> Result<(), Stop> {
    let files = Files {
        read: vec![("--rays", args.rays.clone())],
        written: vec![("--out", args.out.clone())],
        ..Files::default()
    };
    files.check(std::slice::from_ref(&args.scene))?;
    let update = args.update.unwrap_or(Policy::Rebuild);
    let mut ask = Ask {
        adapter: args.device.adapter.as_deref(),
        threads: args.device.threads,
        builder_threads: args.device.builder_threads,
        ..Ask::of(args.device.backend, args.intersector, Some(update))
    };
    let mut opening = session::begin(&ask);
    let file = output::RayFile::open(&args.rays).map_err(Stop::bad)?;
    let scene = scene::open(&args.scene, &args.source.options_of_run(file.count()))?;
    let offset = scene.facts.offset;
    let rays = file.read(offset.unwrap_or_default()).map_err(Stop::bad)?;
    let (tree_time, time) = moments(args, scene.animation.whole_times())?;
    let query = match args.any_hit {
        true => Query::Any,
        false => Query::Closest,
    };
    ask.rays = rays.len();
    let (mut tracer, setup) = session::start(&scene, &ask, &mut opening)?;
    if !args.quiet {
        setup.auto.iter().for_each(|t| talk::say(&t.to_string()));
        scene.facts.notes.iter().for_each(|note| talk::say(note));
    }
    if let Some(time) = tree_time {
        tracer.warm_up(time)?;
    }
    let mut step = tracer.step(time);
    let query = step.trace(&rays, query)?;
    let done = step.submit()?;
    let hits = tracer.hits(done, query)?;
    if args.any_hit {
        output::write_found(&args.out, hits.any())?;
    } else {
        let shape = [rays.len() as u64];
        let hits = HitArrays {
            offset,
            ..HitArrays::of(hits.in_scene(), &shape)
        };
        hits.write(&args.out)?;
    }
    let closest = hits.in_scene().iter().filter(|h| h.is_hit()).count();
    let any = hits.any().iter().filter(|&&b| b != 0).count();
    let caption = &setup.caption;
    let rays = counted(rays.len(), ["ray", "rays"]);
    let met = counted(closest + any, ["hit", "hits"]);
    talk::print(&format!("{rays}, {met} at time {time}\n{caption}\n"))
}

/// Returns the time at which `refit` builds its tree, and the time to trace.
fn moments(args: &TraceArgs, keys: usize) -> Result<(Option<f64>, f64), Stop> {
    let time = frames::moment("--time", args.time, keys)?;
    match (args.update, args.tree_time) {
        (Some(policy), _) if policy.builds_beside_frames() => {
            let others = Policy::ALL
                .into_iter()
                .filter(|p| !p.builds_beside_frames());
            let others: Vec<_> = others.map(Policy::name).collect();
            Err(Stop::bad(format!(
                "--update {policy} needs more than one moment; trace takes {}",
                others.join(", ")
            )))
        }
        (Some(Policy::Refit), tree_time) => {
            let tree_time = frames::moment("--tree-time", tree_time.unwrap_or(0.0), keys)?;
            Ok((Some(tree_time), time))
        }
        _ => Ok((None, time)),
    }
}
