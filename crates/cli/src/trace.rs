//! `abvh trace`: given rays at one moment.

use crate::args::{TraceArgs, UpdateName};
use crate::choose::Ask;
use crate::conflicts::Files;
use crate::session;
use crate::stop::Stop;
use crate::table::counted;
use crate::{frames, memory, talk};
use backend::{Hits, QueryKind};
use geom::Animation;

pub(crate) fn run(args: &TraceArgs) -> Result<(), Stop> {
    let files = Files {
        read: vec![("--rays", args.rays.clone())],
        written: vec![("--out", args.out.clone())],
        ..Files::default()
    };
    files.check(std::slice::from_ref(&args.scene))?;
    let update = match args.update {
        UpdateName::Refit | UpdateName::TSah | UpdateName::DeviceRebuild => args.update,
        _ => UpdateName::Rebuild,
    };
    let asked = Ask {
        adapter: args.device.adapter.as_deref(),
        threads: args.device.threads,
        builder_threads: args.device.builder_threads,
        tolerance: args.tolerance.ppm(),
        ..Ask::of(args.device.backend, args.method, update)
    };
    let opening = session::begin(&asked);
    let rays = output::read_rays(&args.rays)?;
    let options = memory::with_run(args.source.options(), rays.len());
    let scene = scene::open(&args.scene, &options)?;
    let animation = &scene.animation;
    let moments = moments(args, animation)?;
    let ask = Ask {
        rays: rays.len(),
        ..asked
    };
    let mut session = session::start(animation, &ask, opening)?;
    if !args.quiet {
        let taken = session.setup.auto.iter();
        taken.for_each(|t| talk::say(&t.to_string()));
    }
    let kind = match args.any_hit {
        true => QueryKind::Any,
        false => QueryKind::Closest,
    };
    // At all moments but the last there are no rays.
    let last = moments.len() - 1;
    let lists = (0..).zip(moments);
    let lists = lists.map(|(i, time)| (time, if i == last { &rays[..] } else { &[] }));
    let traced = session::trace_lists(&mut session.driver, kind, lists);
    let hits = traced.last().unwrap_or_else(|| Ok(Hits::default()))?;
    if args.any_hit {
        output::write_found(&args.out, &hits.blocked)?;
    } else {
        output::write_hits(&args.out, &[rays.len() as u64], &hits.closest, None)?;
    }
    let closest = hits.closest.iter().filter(|h| h.is_hit()).count();
    let any = hits.blocked.iter().filter(|&&b| b != 0).count();
    let caption = &session.setup.caption;
    let (time, rays) = (args.time, counted(rays.len(), ["ray", "rays"]));
    let met = counted(closest + any, ["hit", "hits"]);
    talk::print(&format!("{rays}, {met} at time {time}\n{caption}\n"))
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
