//! What is left to `auto`: policy and layout by rule; the intersector, where wrong rays are tolerated, by a sample.
//!
//! Neither policy nor layout changes a hit. The intersector can; it is therefore left to `auto` only by name.
//! A tolerance of 0 is not measured but proven: by definition (`docs/design/hits.md`) `exact` alone is free of wrong
//! answers. A tolerance above 0 is shown by a sample of the run's own rays, at 95 % confidence.

use crate::args::{BackendName, IntersectorName, LayoutName, MethodArgs, UpdateName, word};
use crate::session::{self, trace_lists};
use crate::stop::Stop;
use backend::{Backend, DeviceKind, Hits, Intersector, Layout, Method, Query, Rays};
use fastrand::Rng;
use geom::{Animation, Ray};
use output::Taken;
use output::plot::Rate;
use pipeline::{ExpectedMemory, Frame, Pace, RefitDecay, RunFacts, Threads, Update};
use std::sync::Arc;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Ask<'a> {
    pub(crate) backend: BackendName,
    pub(crate) adapter: Option<&'a str>,
    pub(crate) threads: Option<usize>,
    pub(crate) builder_threads: Option<usize>,
    pub(crate) method: MethodArgs,
    pub(crate) update: UpdateName,
    pub(crate) lockstep: Option<u32>,
    /// Wrong rays a million that an intersector left to `auto` may have.
    pub(crate) tolerance: f64,
    /// What will be done, by which `auto` chooses.
    pub(crate) run: Option<Run<'a>>,
    /// Rays of a frame, where no run is known.
    pub(crate) rays: usize,
    /// Whether trees are built for what comes.
    pub(crate) predict: bool,
}

impl<'a> Ask<'a> {
    /// Leaves all else as it usually is.
    pub(crate) fn of(backend: BackendName, method: MethodArgs, update: UpdateName) -> Self {
        Self {
            backend,
            adapter: None,
            threads: None,
            builder_threads: None,
            method,
            update,
            lockstep: None,
            tolerance: 0.0,
            run: None,
            rays: 0,
            predict: true,
        }
    }

    /// Likewise, for a run that is known.
    pub(crate) fn over(self, frames: &'a [Frame], query: Query<'a>) -> Self {
        let run = Some(Run { frames, query });
        Self { run, ..self }
    }

    /// How trees follow the motion. What [`Self::is_open`], [`pipeline::RunFacts`] settle where a run is known.
    pub(crate) fn update(&self) -> Choice<Update> {
        let at_pace = Update::Async(self.lockstep.map_or(Pace::Free, Pace::Lockstep));
        let (update, why) = match self.update {
            UpdateName::Auto if self.is_open() => (at_pace, "it suits most scenes that deform"),
            UpdateName::Auto => (at_pace, "--lockstep asks for it"),
            UpdateName::Async => return (at_pace, None),
            UpdateName::Rebuild => return (Update::Rebuild, None),
            UpdateName::Refit => return (Update::Refit, None),
            UpdateName::TSah => return (Update::TSah, None),
            UpdateName::DeviceRebuild => return (Update::DeviceRebuild, None),
        };
        (update, Some(why.to_owned()))
    }

    /// Whether the policy is left to `auto`, which knows more once the backend is open.
    fn is_open(&self) -> bool {
        self.update == UpdateName::Auto && self.lockstep.is_none()
    }

    /// How cores are shared on such a device under a policy.
    pub(crate) fn share(&self, device: DeviceKind, update: Update) -> Threads {
        let asked = [self.threads, self.builder_threads];
        Threads::share(host::cores(), device, update, asked)
    }

    pub(crate) fn rays(&self) -> usize {
        self.run.map_or(self.rays, |run| run.query.rays.count())
    }

    /// The first and the last time of all frames, in key frames; the whole motion where no run is known.
    pub(crate) fn time_range(&self) -> [f64; 2] {
        let Some(run) = self.run else {
            return [0.0, f64::INFINITY];
        };
        let times = || run.frames.iter().map(|f| f.time);
        let last = times().fold(0.0, f64::max);
        [times().fold(last, f64::min), last]
    }
}

/// The run that something is chosen for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run<'a> {
    frames: &'a [Frame],
    query: Query<'a>,
}

/// Something taken, and why; `None` if it was asked for by name.
type Choice<T> = (T, Option<String>);

/// What `auto` took where nothing was asked for by name.
pub(crate) fn taken(what: &str, takes: &str, why: Option<String>) -> Option<Taken> {
    Some(Taken {
        what: what.to_owned(),
        takes: takes.to_owned(),
        why: why?,
    })
}

pub(crate) fn intersector(name: IntersectorName) -> Choice<Intersector> {
    let why = || "it alone is free of wrong answers by definition".to_owned();
    let named = word(&name).parse();
    named.map_or_else(|_| (Intersector::Exact, Some(why())), |named| (named, None))
}

/// How the tree lies in memory; `None` if it is left to `auto`.
fn layout(name: LayoutName) -> Option<Layout> {
    let mut all = Layout::ALL.into_iter();
    all.find(|l| l.name() == word(&name))
}

/// Facts about a backend and its device that choices depend on.
#[derive(Clone, Debug)]
pub(crate) struct Capabilities {
    /// The kind of the device.
    device: DeviceKind,
    /// Whether trees can be built on the device.
    makes_trees: bool,
}

impl Capabilities {
    fn of(backend: &dyn Backend) -> Self {
        Self {
            device: backend.device().kind,
            makes_trees: backend.check_rebuild().is_ok(),
        }
    }

    /// Returns the layout of that name. `auto` is the fastest layout that the backend supports.
    fn layout(&self, name: LayoutName) -> Choice<Layout> {
        if let Some(named) = layout(name) {
            return (named, None);
        }
        let (fastest, why) = match self.device {
            DeviceKind::Software => (Layout::Bvh2, "software drivers trace it faster"),
            DeviceKind::Gpu | DeviceKind::Cpu => (Layout::Fast, "it is traced faster"),
        };
        (fastest, Some(why.to_owned()))
    }
}

/// What is taken, and why this update policy, this intersector, this layout, where it was left open.
pub(crate) type Settled = (Method, Update, [Option<String>; 3]);

/// Intersectors that may be wrong, the fastest first (docs/measured.md).
const FASTEST_FIRST: [Intersector; 3] = [
    Intersector::Watertight,
    Intersector::MollerTrumbore,
    Intersector::Woop,
];

/// Settles what `ask` leaves open by what `backend` is and how it traces. It comes back, or another of its kind.
pub(crate) fn settle(
    backend: Box<dyn Backend>,
    animation: &Arc<Animation>,
    ask: &Ask<'_>,
) -> Result<(Box<dyn Backend>, Settled), Stop> {
    let (backend, (intersector, why_intersector)) = settle_intersector(backend, animation, ask)?;
    let capabilities = Capabilities::of(backend.as_ref());
    let (layout, why_layout) = capabilities.layout(ask.method.layout);
    let method = Method {
        intersector,
        layout,
    };
    let (update, why_update) = match ask.run.filter(|_| ask.is_open()) {
        Some(run) => {
            let (update, why) = facts(&capabilities, animation, ask, &run, method)?.choose();
            (update, Some(why))
        }
        None => ask.update(),
    };
    let why = [why_update, why_intersector, why_layout];
    Ok((backend, (method, update, why)))
}

fn facts(
    capabilities: &Capabilities,
    animation: &Animation,
    ask: &Ask<'_>,
    run: &Run<'_>,
    method: Method,
) -> Result<RunFacts, Stop> {
    let device = capabilities.device;
    let times: Vec<f64> = run.frames.iter().map(|f| f.time).collect();
    let rays = run.query.rays.count();
    let threads = ask.share(device, Update::Async(Pace::Free));
    let memory = ExpectedMemory::of(animation, device, (method, Update::DeviceRebuild), rays);
    Ok(RunFacts {
        frames: times.len(),
        step: match *times {
            [first, .., last] => (last - first).abs() / (times.len() - 1) as f64,
            _ => 0.0,
        },
        moves: animation.moving_count() > 0,
        triangles: animation.live_count(),
        rays,
        decay: RefitDecay::sample(animation, &times).map_err(Stop::failed)?,
        device,
        rebuild_bytes: memory
            .device_bytes
            .filter(|_| device == DeviceKind::Gpu && capabilities.makes_trees),
        threads: threads.render,
        builder_threads: threads.build,
    })
}

/// The intersector asked for, or the fastest that meets the tolerance; and why.
fn settle_intersector(
    backend: Box<dyn Backend>,
    animation: &Arc<Animation>,
    ask: &Ask<'_>,
) -> Result<(Box<dyn Backend>, Choice<Intersector>), Stop> {
    let usual = intersector(ask.method.intersector);
    let is_open = ask.method.intersector == IntersectorName::Auto && ask.tolerance > 0.0;
    let Some(run) = ask.run.filter(|run| is_open && !run.frames.is_empty()) else {
        return Ok((backend, usual));
    };
    let Some(rays) = needed(ask.tolerance) else {
        let why = "to show so small a tolerance would take too many rays".to_owned();
        return Ok((backend, (Intersector::Exact, Some(why))));
    };
    let sample = sample(&run, rays);
    let rays = sample.iter().map(|(_, rays)| rays.len() as u64).sum();
    let answers = |backend, intersector: Intersector| -> Result<_, Stop> {
        let how = (Method::from(intersector), Update::Refit);
        let taking = session::take(backend, animation, ask, how)?;
        let mut driver = session::driver(animation, taking)?;
        let lists = sample.iter().map(|(time, rays)| (*time, &rays[..]));
        let answers = trace_lists(&mut driver, run.query.kind, lists)?;
        Ok((driver.into_backend(), answers))
    };
    let (mut backend, exact) = answers(backend, Intersector::Exact)?;
    let mut found = Vec::new();
    for intersector in FASTEST_FIRST {
        let hits;
        (backend, hits) = answers(backend, intersector)?;
        let pairs = exact.iter().zip(&hits);
        let wrong = pairs.map(|(exact, found)| differing(exact, found)).sum();
        // With 95 % confidence.
        let most = Rate::of(wrong, rays).map_or(1e6, |rate| rate.high);
        found.push(format!(
            "{intersector} {wrong} of {rays} rays wrong, at most {most:.1} a million"
        ));
        if most <= ask.tolerance {
            let why = format!("the fastest within the tolerance ({})", found.join(", "));
            return Ok((backend, (intersector, Some(why))));
        }
    }
    let why = format!("no other is within the tolerance ({})", found.join(", "));
    Ok((backend, (Intersector::Exact, Some(why))))
}

/// Frames of the run whose rays are asked.
const MOMENTS: usize = 3;
/// The most rays of a sample.
const MOST: f64 = (1 << 20) as f64;

/// Rays that it takes to show that at most `tolerance` a million are wrong, if none is seen to be (the rule of three);
/// with half as many again for a few that are. `None` if they are too many.
fn needed(tolerance: f64) -> Option<usize> {
    let rays = 1.5 * 3.0 * 1e6 / tolerance;
    (rays <= MOST).then_some(rays.ceil() as usize)
}

/// About `count` rays of a run, at some of its times.
fn sample(run: &Run<'_>, count: usize) -> Vec<(f64, Vec<Ray>)> {
    let mut rng = Rng::with_seed(0);
    let len = run.frames.len();
    let at = |i: usize| {
        let time = run.frames[(2 * i + 1) * len / (2 * MOMENTS)].time;
        let rays = (0..count.div_ceil(MOMENTS)).filter_map(|_| draw(run.query.rays, &mut rng));
        (time, rays.collect())
    };
    (0..MOMENTS).map(at).collect()
}

fn draw(rays: Rays<'_>, rng: &mut Rng) -> Option<Ray> {
    match rays {
        Rays::Camera(camera) => Some(camera.ray(rng.u32(..camera.width), rng.u32(..camera.height))),
        Rays::List(rays) => rng.choice(rays).copied(),
        Rays::OnDevice(_) => None,
    }
}

/// Rays of which two traces name another triangle, or another shadow.
fn differing(a: &Hits, b: &Hits) -> u64 {
    let at = |of: &Hits, i: usize| {
        let triangle = of.closest.get(i).map(|hit| hit.triangle);
        (triangle, of.blocked.get(i).copied())
    };
    let rays = a.closest.len().max(a.blocked.len());
    (0..rays).filter(|&i| at(a, i) != at(b, i)).count() as u64
}

#[cfg(test)]
mod tests;
