//! `abvh trace`: given rays at one moment.

use crate::args::{TraceArgs, UpdateName};
use crate::choose::{self, Ask};
use crate::conflicts::Files;
use crate::session::{self, Session};
use crate::stop::Stop;
use crate::table::counted;
use crate::{frames, memory, talk};
use backend::{Hits, Query, QueryKind, Rays};
use geom::{Animation, Ray};
use output::HitArrays;
use pipeline::Frame;

pub(crate) fn run(args: &TraceArgs) -> Result<(), Stop> {
    let files = Files {
        read: vec![("--rays", args.rays.clone())],
        written: vec![("--out", args.out.clone())],
        ..Files::default()
    };
    files.check(std::slice::from_ref(&args.scene))?;
    let rays = output::read_rays(&args.rays)?;
    let options = memory::with_run(args.source.options(), rays.len());
    let scene = scene::open(&args.scene, &options)?;
    let animation = &scene.animation;
    let moments = moments(args, animation)?;
    let update = match args.update {
        UpdateName::TSah | UpdateName::DeviceRebuild => args.update,
        _ if moments.len() > 1 => UpdateName::Refit,
        _ => UpdateName::Rebuild,
    };
    let mut session = session::start(
        animation,
        &Ask {
            adapter: args.device.adapter.as_deref(),
            threads: args.device.threads,
            builder_threads: args.device.builder_threads,
            tolerance: args.tolerance.ppm(),
            rays: rays.len(),
            ..Ask::of(
                args.device.backend,
                args.method,
                choose::free_update(update),
            )
        },
    )?;
    if !args.quiet {
        let taken = session.taken.iter();
        taken.for_each(|t| talk::say(&t.to_string()));
    }
    let kind = if args.any_hit {
        QueryKind::Any
    } else {
        QueryKind::Closest
    };
    let hits = trace(&mut session, &moments, &rays, kind)?;
    if args.any_hit {
        output::write_found(&args.out, &hits.blocked)?;
    } else {
        let found = HitArrays {
            hits: &hits.closest,
            shadow: None,
            shape: &[rays.len() as u64],
        };
        output::write_hits(&args.out, &found)?;
    }
    let closest = hits.closest.iter().filter(|h| h.is_hit()).count();
    let any = hits.blocked.iter().filter(|&&b| b != 0).count();
    let caption = session.caption();
    let (rays, met) = (rays.len(), closest + any);
    talk::print(&format!(
        "{}, {} at time {}\n{caption}\n",
        counted(rays, ["ray", "rays"]),
        counted(met, ["hit", "hits"]),
        args.time
    ))
}

/// The moment of the tree, if it is another, and the moment to trace.
fn moments(args: &TraceArgs, animation: &Animation) -> Result<Vec<f64>, Stop> {
    let keys = animation.whole_times();
    let time = frames::moment("--time", args.time, keys)?;
    match (args.update, args.tree_time) {
        (UpdateName::Async, _) => Err(Stop::bad(
            "--update async needs more than one moment; trace takes rebuild, refit, t-sah or device-rebuild",
        )),
        (UpdateName::Refit, tree_time) => {
            let tree_time = frames::moment("--tree-time", tree_time.unwrap_or(0.0), keys)?;
            Ok(vec![tree_time, time])
        }
        _ => Ok(vec![time]),
    }
}

/// Goes through the moments without rays, and traces at the last.
fn trace(
    session: &mut Session,
    moments: &[f64],
    rays: &[Ray],
    kind: QueryKind,
) -> Result<Hits, Stop> {
    let mut hits = Hits::default();
    for (i, &time) in moments.iter().enumerate() {
        let last = i + 1 == moments.len();
        let rays = Rays::List(if last { rays } else { &[] });
        let index = i as u64;
        session
            .driver
            .begin(Frame { index, time }, Query { rays, kind })?;
        session.driver.finish(last.then_some(&mut hits))?;
    }
    Ok(hits)
}
