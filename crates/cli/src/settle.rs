//! What is left to `auto`: policy and layout by rule; the intersector, where wrong rays are tolerated, by a sample.
//!
//! Neither policy nor layout changes a hit. The intersector can; it is therefore left to `auto` only by name.
//! A tolerance of 0 is not measured but proven: by definition (`docs/design/hits.md`) `exact` alone is free of wrong
//! answers. A tolerance above 0 is shown by a sample of the run's own rays, at 95 % confidence.

mod reused;
mod sample;

use crate::args::{IntersectorName, LayoutName};
use crate::choose;
use crate::session::Ask;
use crate::stop::Stop;
use backend::{DeviceKind, Intersector, Layout, Method, Query};
use pipeline::{Choice, Frame, RefitDecay, RunFacts, Update};
pub(crate) use reused::ReusedBackend;
use sample::{Sample, Wrong};

/// The run that something is chosen for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run<'a> {
    /// Its frames.
    pub(crate) frames: &'a [Frame],
    /// What is traced in each.
    pub(crate) query: Query<'a>,
}

/// What is taken, with a reason for each part that was left open.
#[derive(Clone, Debug)]
pub(crate) struct Settled {
    /// How rays are traced.
    pub(crate) method: Method,
    /// How trees follow the motion.
    pub(crate) update: Update,
    /// Why this update policy.
    pub(crate) why_update: Option<String>,
    /// Why this intersector.
    pub(crate) why_intersector: Option<String>,
    /// Why this layout.
    pub(crate) why_layout: Option<String>,
}

/// Intersectors that may be wrong, the fastest first (docs/measured.md).
const FASTEST_FIRST: [Intersector; 3] = [
    Intersector::Watertight,
    Intersector::MollerTrumbore,
    Intersector::Woop,
];

/// Settles what `ask` leaves open.
///
/// # Errors
/// No intersector of the backend meets the tolerance.
pub(crate) fn settle(backend: &mut ReusedBackend<'_>, ask: &Ask<'_>) -> Result<Settled, Stop> {
    let (intersector, why_intersector) = intersector(backend, ask)?;
    let (layout, why_layout) = layout(backend, ask, intersector);
    let (update, why_update) = update(backend, ask)?;
    Ok(Settled {
        method: Method {
            intersector,
            layout,
        },
        update,
        why_update,
        why_intersector,
        why_layout,
    })
}

/// The policy asked for, or the one that [`RunFacts::choose`] takes.
fn update(backend: &ReusedBackend<'_>, ask: &Ask<'_>) -> Result<(Update, Option<String>), Stop> {
    let wanted = ask.update;
    match ask.run.filter(|_| wanted.is_open) {
        Some(run) => {
            let Choice { update, why } = facts(backend, &run)?.choose();
            Ok((update, Some(why)))
        }
        None => Ok((wanted.value, wanted.why.map(str::to_owned))),
    }
}

/// What is known of a run before its first frame.
fn facts(backend: &ReusedBackend<'_>, run: &Run<'_>) -> Result<RunFacts, Stop> {
    let animation = backend.animation();
    let times: Vec<f64> = run.frames.iter().map(|f| f.time).collect();
    let threads = backend.share(Update::Async(pipeline::Pace::Free));
    Ok(RunFacts {
        frames: times.len(),
        step: match *times {
            [first, .., last] => (last - first).abs() / (times.len() - 1) as f64,
            _ => 0.0,
        },
        moves: animation.moving_count() > 0,
        triangles: animation.live_count(),
        rays: run.query.rays.count(),
        decay: RefitDecay::sample(animation, &times).map_err(Stop::failed)?,
        device: backend.device.kind,
        device_builds: backend.device.kind == DeviceKind::Gpu && backend.makes_trees(),
        threads: threads.render,
        builder_threads: threads.build,
    })
}

/// `fast` on graphics processors and the host's cores; software drivers run `bvh2` faster.
fn layout(
    backend: &ReusedBackend<'_>,
    ask: &Ask<'_>,
    intersector: Intersector,
) -> (Layout, Option<String>) {
    let named = choose::layout(ask.method.layout);
    if ask.method.layout != LayoutName::Auto {
        return (named.value, None);
    }
    let fast = Method {
        intersector,
        layout: Layout::Fast,
    };
    let why = |text: &str| Some(text.to_owned());
    match backend.device.kind {
        DeviceKind::Software => (Layout::Bvh2, why("software drivers trace it faster")),
        _ if backend.supports(fast) => (Layout::Fast, why("it is traced faster")),
        _ => (named.value, named.why.map(str::to_owned)),
    }
}

/// The intersector asked for, or the fastest that meets the tolerance.
fn intersector(
    backend: &mut ReusedBackend<'_>,
    ask: &Ask<'_>,
) -> Result<(Intersector, Option<String>), Stop> {
    let usual = choose::intersector(ask.method.intersector);
    let is_open = ask.method.intersector == IntersectorName::Auto && ask.tolerance > 0.0;
    let Some(run) = ask.run.filter(|run| is_open && !run.frames.is_empty()) else {
        return Ok((usual.value, usual.why.map(str::to_owned)));
    };
    let layout = choose::layout(ask.method.layout).value;
    let method = |intersector| Method {
        intersector,
        layout,
    };
    let mut found = Vec::new();
    if let Some(rays) = sample::needed(ask.tolerance) {
        let sample = Sample::take(backend, &run, rays)?;
        for intersector in FASTEST_FIRST {
            if !backend.supports(method(intersector)) {
                continue;
            }
            let wrong = sample.wrong(backend, method(intersector))?;
            found.push(tell(intersector, wrong));
            if wrong.at_most() <= ask.tolerance {
                let why = format!("the fastest within the tolerance ({})", found.join(", "));
                return Ok((intersector, Some(why)));
            }
        }
    }
    if !backend.supports(method(Intersector::Exact)) {
        return Err(Stop::bad(format!(
            "no intersector of this backend stays within {} wrong rays a million; exact does, on others",
            ask.tolerance
        )));
    }
    let why = match found.as_slice() {
        [] => "to show so small a tolerance would take too many rays".to_owned(),
        found => format!("no other is within the tolerance ({})", found.join(", ")),
    };
    Ok((Intersector::Exact, Some(why)))
}

fn tell(intersector: Intersector, found: Wrong) -> String {
    let Wrong { wrong, rays } = found;
    let most = found.at_most();
    format!("{intersector} {wrong} of {rays} rays wrong, at most {most:.1} a million")
}

#[cfg(test)]
mod tests;
