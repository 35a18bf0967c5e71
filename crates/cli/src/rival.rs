//! Opens rivals by name, measures their frames, and compares their hits with ours.

use crate::args::{UpdateName, update_name};
use crate::choose::Ask;
use crate::session::{self, Setup};
use crate::stop::Stop;
use backend::{
    BackendError, BackendName, DeviceBytes, FrameReport, Hits, Intersector, Policy, Query,
    QueryKind, Rays,
};
use geom::{Animation, Ray};
use output::FrameStats;
use pipeline::{Answers, Frame, Wanted, WarmUp, Warmed, unhittable_at};
use rivals::{Known, Rival, Upkeep};
use std::fmt;
use std::sync::Arc;
use std::time::Instant;

/// Name of a rival's intersector in tables and files, because rivals use their own.
pub(crate) const OWN: &str = "own";

/// A rival and the policy by which it updates its tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Contest {
    pub(crate) rival: &'static Known,
    pub(crate) upkeep: Upkeep,
}

impl fmt::Display for Contest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.rival.name, self.upkeep)
    }
}

/// Returns every rival with each policy that it supports, and remarks on the policies that it does not support.
pub(crate) fn contests(
    rivals: &[&'static Known],
    updates: &[UpdateName],
) -> (Vec<Contest>, Vec<String>) {
    let (mut known, mut skipped) = (Vec::new(), Vec::new());
    for &rival in rivals {
        for policy in updates.iter().copied().map(update_name) {
            match Upkeep::ALL.into_iter().find(|u| u.name() == policy) {
                Some(upkeep) => known.push(Contest { rival, upkeep }),
                None => {
                    let name = rival.name;
                    let why = "is left out: it keeps its own tree, which it rebuilds or refits in each frame";
                    skipped.push(format!("{name} with {policy} {why}"));
                }
            }
        }
    }
    (known, skipped)
}

/// A rival with a scene.
pub(crate) struct Running {
    rival: Box<dyn Rival>,
    animation: Arc<Animation>,
    upkeep: Upkeep,
}

/// Frames of a rival.
pub(crate) struct Frames {
    pub(crate) setup: Setup,
    pub(crate) warm_up: Option<Warmed>,
    pub(crate) stats: Vec<FrameStats>,
    pub(crate) held: Option<DeviceBytes>,
}

impl Running {
    /// Opens a rival on an adapter and loads a scene. A rival on the host uses `threads` threads, or all cores.
    pub(crate) fn start(
        contest: Contest,
        (adapter, threads): (Option<&str>, Option<usize>),
        animation: &Arc<Animation>,
    ) -> Result<Self, Stop> {
        let name = contest.rival.name;
        let absent = |e: BackendError| Stop::bad(format!("rival {name} cannot run: {e}"));
        let index = match adapter {
            None => None,
            Some(part) => {
                let list = contest.rival.adapters().map_err(absent)?;
                let found = backends::find_adapter(name, &list, part);
                Some(found.map_err(Stop::bad)?.index)
            }
        };
        let threads = threads.unwrap_or_else(host::cores);
        let mut rival = contest.rival.open(index, threads).map_err(absent)?;
        rival.load(Arc::clone(animation), contest.upkeep)?;
        Ok(Self {
            rival,
            animation: Arc::clone(animation),
            upkeep: contest.upkeep,
        })
    }

    /// Times frames. After the first frame, the device is warmed up for `warm_up` seconds, or for a default time.
    pub(crate) fn time(
        &mut self,
        frames: &[Frame],
        query: Query<'_>,
        warm_up: Option<f64>,
    ) -> Result<Frames, Stop> {
        let (mut stats, mut held, mut warmed) = (Vec::new(), None::<DeviceBytes>, None);
        for (number, &frame) in frames.iter().enumerate() {
            let begun = Instant::now();
            let report = self.frame(frame.time, query)?;
            let wall_ms = begun.elapsed().as_secs_f64() * 1e3;
            let bytes = self.rival.device_bytes();
            held = held.into_iter().chain(bytes).max_by_key(|b| b.total());
            stats.push(self.stats(
                frame,
                number,
                FrameStats::of_report(frame, &report, wall_ms),
            ));
            if number == 0 && frames.len() > 1 {
                let kind = self.rival.device().kind;
                warmed = WarmUp::begin(warm_up, kind)
                    .map(|warm_up| self.warm_up(warm_up, frame.time, query))
                    .transpose()?;
            }
        }
        for frame in &mut stats {
            let moment = self.animation.at(frame.time).map_err(Stop::bad)?;
            // Rivals do not count these.
            [frame.inactive, frame.degenerate] = unhittable_at(&moment).map(|count| count as u64);
        }
        Ok(Frames {
            setup: self.setup(),
            warm_up: warmed,
            stats,
            held,
        })
    }

    fn frame(&mut self, time: f64, query: Query<'_>) -> Result<FrameReport, Stop> {
        Ok(self.rival.frame(self.animation.pose(time), query)?)
    }

    fn warm_up(
        &mut self,
        mut warm_up: WarmUp,
        time: f64,
        query: Query<'_>,
    ) -> Result<Warmed, Stop> {
        while warm_up.goes_on(self.frame(time, query)?.times.device_ms) {}
        Ok(warm_up.end())
    }

    /// Adds the facts about the tree to the statistics of frame `number`.
    fn stats(&self, frame: Frame, number: usize, stats: FrameStats) -> FrameStats {
        let is_new = number == 0 || self.upkeep == Upkeep::Rebuild;
        let age = if is_new { 0 } else { number as u64 };
        FrameStats {
            time: frame.time,
            tree_generation: number as u64 + 1 - age,
            tree_age_frames: age,
            adopted: is_new,
            device_bytes: self.rival.device_bytes().map(DeviceBytes::total),
            ..stats
        }
    }

    fn setup(&self) -> Setup {
        let device = self.rival.device().clone();
        let (backend, update) = (device.backend, self.upkeep.name());
        Setup {
            caption: format!("{backend} ({}), {update}", device.adapter),
            backend,
            adapter: device.adapter,
            driver: Some(device.driver).filter(|driver| !driver.is_empty()),
            threads: device.threads,
            builder_threads: 0,
            update,
            lockstep: None,
            predict: None,
            intersector: OWN,
            auto: Vec::new(),
            memory: None,
        }
    }

    /// Traces lists of rays one after the other, each at its time.
    pub(crate) fn trace_lists<'a>(
        &mut self,
        kind: QueryKind,
        lists: impl IntoIterator<Item = (f64, &'a [Ray])>,
    ) -> Result<Vec<Hits>, Stop> {
        let trace = |(time, rays)| {
            let rays = Rays::List(rays);
            self.hits(time, Query { rays, kind })
        };
        lists.into_iter().map(trace).collect()
    }

    fn hits(&mut self, time: f64, query: Query<'_>) -> Result<Hits, Stop> {
        self.frame(time, query)?;
        Ok(self.rival.hits()?.clone())
    }

    /// Returns the share of rays whose triangle or shadow differs from ours, over the first, a middle and the last frame.
    /// Ours are those of `watertight` on the host, with a fresh tree in each frame.
    pub(crate) fn differing(&mut self, frames: &[Frame], query: Query<'_>) -> Result<f64, Stop> {
        let (host, intersector) = (Some(BackendName::Cpu), Intersector::Watertight);
        let ask = Ask::of(host, intersector, Some(Policy::Rebuild)).over(frames, query);
        let (mut driver, _) = session::start_driver(&self.animation, &ask)?;
        let places = [0, frames.len() / 2, frames.len().saturating_sub(1)];
        let mut compared: Vec<Frame> = places
            .iter()
            .filter_map(|&i| frames.get(i).copied())
            .collect();
        compared.dedup_by_key(|frame| frame.index);
        let (mut differ, mut rays) = (0, 0);
        for frame in compared {
            let mut ours = Answers::default();
            driver.begin(frame, &[query])?;
            driver.finish(Wanted::HITS, &mut ours)?;
            differ += count_differing(&ours.hits, &self.hits(frame.time, query)?);
            rays += query.rays.count();
        }
        Ok(differ as f64 / rays.max(1) as f64)
    }
}

/// Counts rays for which two traces return different triangles or shadows.
fn count_differing(a: &Hits, b: &Hits) -> usize {
    let at = |of: &Hits, i: usize| {
        let triangle = of.closest.get(i).map(|hit| hit.triangle);
        (triangle, of.blocked.get(i).copied())
    };
    let rays = a.closest.len().max(a.blocked.len());
    (0..rays).filter(|&i| at(a, i) != at(b, i)).count()
}
