//! Settles by rule the policy that is left to `auto`. It changes no hit.

use crate::args::{BackendChoice, UpdateName};
use crate::stop::Stop;
use backend::{Backend, DeviceKind, Intersector, Policy, Query};
use geom::Animation;
use output::Taken;
use pipeline::{ExpectedMemory, Frame, RefitDecay, RunFacts, Threads};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Ask<'a> {
    pub(crate) backend: BackendChoice,
    pub(crate) adapter: Option<&'a str>,
    pub(crate) threads: Option<usize>,
    pub(crate) builder_threads: Option<usize>,
    pub(crate) intersector: Intersector,
    pub(crate) update: UpdateName,
    pub(crate) lockstep: Option<u32>,
    /// What will be done, by which `auto` chooses.
    pub(crate) run: Option<Run<'a>>,
    /// Number of rays of a frame, if no run is known.
    pub(crate) rays: usize,
    /// Whether trees are built for predicted positions.
    pub(crate) predict: bool,
}

impl<'a> Ask<'a> {
    /// Creates a request with defaults for all other fields.
    pub(crate) fn of(backend: BackendChoice, intersector: Intersector, update: UpdateName) -> Self {
        Self {
            backend,
            adapter: None,
            threads: None,
            builder_threads: None,
            intersector,
            update,
            lockstep: None,
            run: None,
            rays: 0,
            predict: true,
        }
    }

    /// Sets the run that `auto` chooses for.
    pub(crate) fn over(self, frames: &'a [Frame], query: Query<'a>) -> Self {
        let run = Some(Run { frames, query });
        Self { run, ..self }
    }

    /// How trees follow the motion. What [`Self::is_open`], [`pipeline::RunFacts`] settle where a run is known.
    pub(crate) fn update(&self) -> Choice<Policy> {
        let at_pace = self.lockstep.map_or(Policy::Async, Policy::Lockstep);
        let (update, why) = match self.update {
            Some(named) if named.builds_beside_frames() => return (at_pace, None),
            Some(named) => return (named, None),
            None if self.is_open() => (at_pace, "it suits most scenes that deform"),
            None => (at_pace, "--lockstep asks for it"),
        };
        (update, Some(why.to_owned()))
    }

    /// Returns whether `auto` chooses the policy, which it can do better once the backend is open.
    fn is_open(&self) -> bool {
        self.update.is_none() && self.lockstep.is_none()
    }

    /// How cores are shared on such a device under a policy.
    pub(crate) fn share(&self, device: DeviceKind, update: Policy) -> Threads {
        let asked = [self.threads, self.builder_threads];
        Threads::share(host::cores(), device, update, asked)
    }

    pub(crate) fn rays(&self) -> usize {
        self.run.map_or(self.rays, |run| run.query.rays.count())
    }

    /// Returns the first and the last time of all frames, in key frames. Returns the whole motion if no run is known.
    pub(crate) fn time_range(&self) -> [f64; 2] {
        let Some(run) = self.run else {
            return [0.0, f64::INFINITY];
        };
        let times = || run.frames.iter().map(|f| f.time);
        let last = times().fold(0.0, f64::max);
        [times().fold(last, f64::min), last]
    }
}

/// The run that `auto` chooses for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run<'a> {
    frames: &'a [Frame],
    query: Query<'a>,
}

/// A choice and its reason; `None` if the user named it.
pub(crate) type Choice<T> = (T, Option<String>);

/// Returns a choice of `auto` with its reason. Returns `None` if the user named it.
pub(crate) fn taken(what: &str, takes: &str, why: Option<String>) -> Option<Taken> {
    Some(Taken {
        what: what.to_owned(),
        takes: takes.to_owned(),
        why: why?,
    })
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
}

/// Settles the update policy of a run by facts about `backend` and the run, if it is left to `auto`.
pub(crate) fn settle(
    backend: &dyn Backend,
    animation: &Animation,
    ask: &Ask<'_>,
) -> Result<Choice<Policy>, Stop> {
    let Some(run) = ask.run.filter(|_| ask.is_open()) else {
        return Ok(ask.update());
    };
    let facts = facts(&Capabilities::of(backend), animation, ask, &run)?;
    let (update, why) = facts.choose();
    Ok((update, Some(why)))
}

fn facts(
    capabilities: &Capabilities,
    animation: &Animation,
    ask: &Ask<'_>,
    run: &Run<'_>,
) -> Result<RunFacts, Stop> {
    let device = capabilities.device;
    let times: Vec<f64> = run.frames.iter().map(|f| f.time).collect();
    let rays = run.query.rays.count();
    let threads = ask.share(device, Policy::Async);
    let memory = ExpectedMemory::of(
        animation,
        device,
        (ask.intersector, Policy::DeviceRebuild),
        rays,
    );
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

#[cfg(test)]
mod tests;
