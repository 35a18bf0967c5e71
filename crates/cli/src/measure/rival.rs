//! Opens rivals by name, measures their frames, and compares their hits with those of backend `cpu`.

use super::timing::{TimedFrames, TimingPlan, trace_frame};
use crate::devices::DeviceSettings;
use crate::error::CliError;
use crate::setup::{self, Setup, Started};
use crate::tracer_settings::{TracerSettings, Workload};
use backend::{
    BackendError, BackendName, DeviceBytes, FrameReport, Generation, Hits, Intersector, Policy,
    Query,
};
use geom::Animation;
use pipeline::{Frame, FrameRecord, FrameTreeStats, WarmUp, inactive_and_degenerate_at};
use rivals::{Rival, RivalName, TreeUpdate};
use std::sync::Arc;
use std::time::Instant;

/// Name for a rival's intersector in tables and files. Rivals use their own intersectors.
pub(crate) const RIVAL_INTERSECTOR: &str = "own";

/// A rival, its device, and the policy by which it updates its tree.
#[derive(Clone, Debug)]
pub(crate) struct RivalSettings {
    pub(crate) rival: RivalName,
    pub(crate) tree_update: TreeUpdate,
    /// Only its adapter and its number of rendering threads apply to rivals.
    pub(crate) device: DeviceSettings,
}

/// A rival with a scene.
pub(crate) struct RunningRival {
    rival: Box<dyn Rival>,
    animation: Arc<Animation>,
    tree_update: TreeUpdate,
}

impl RunningRival {
    /// Opens a rival and loads a scene.
    pub(crate) fn start(
        settings: &RivalSettings,
        animation: &Arc<Animation>,
    ) -> Result<Self, CliError> {
        let RivalSettings {
            rival,
            tree_update,
            device,
        } = settings;
        let name = rival.name();
        let absent = |e: BackendError| CliError::invalid(format!("rival {name} cannot run: {e}"));
        let index = match &device.adapter {
            None => None,
            Some(part) => {
                let list = rival.adapters().map_err(absent)?;
                let found = abvh::backends::find_adapter(name, &list, part);
                Some(found.map_err(CliError::invalid)?.index)
            }
        };
        let threads = device.threads.unwrap_or_else(host::cores);
        let mut rival = rival.open(index, threads).map_err(absent)?;
        rival.load(Arc::clone(animation), *tree_update)?;
        Ok(Self {
            rival,
            animation: Arc::clone(animation),
            tree_update: *tree_update,
        })
    }

    /// Times the frames of a plan, with a warm-up after the first frame.
    pub(super) fn time(&mut self, plan: TimingPlan<'_>) -> Result<TimedFrames, CliError> {
        let TimingPlan { frames, query, .. } = plan;
        let mut timed = TimedFrames::default();
        for (number, &frame) in frames.iter().enumerate() {
            let begun = Instant::now();
            let report = self.frame(frame.time, query)?;
            let wall_ms = begun.elapsed().as_secs_f64() * 1e3;
            let device_memory = self.rival.device_bytes();
            timed.add(FrameRecord {
                frame,
                report,
                tree: self.tree_stats(number),
                wall_ms,
                device_bytes: device_memory.map(DeviceBytes::total),
                device_memory,
                ..FrameRecord::default()
            });
            let warms_up = number == 0 && frames.len() > 1;
            let kind = self.rival.device().kind;
            if warms_up && let Some(mut warm_up) = WarmUp::begin(plan.warm_up, kind) {
                while warm_up.goes_on(self.frame(frame.time, query)?.times.device_ms) {}
                timed.warm_up = Some(warm_up.end());
            }
        }
        for frame in &mut timed.stats {
            let moment = self
                .animation
                .at(frame.frame.time)
                .map_err(CliError::invalid)?;
            // Rivals do not count inactive and degenerate triangles.
            let report = &mut frame.report;
            [report.inactive, report.degenerate] =
                inactive_and_degenerate_at(&moment).map(|count| count as u64);
        }
        Ok(timed)
    }

    fn frame(&mut self, time: f64, query: Query<'_>) -> Result<FrameReport, CliError> {
        let (pose, light) = (self.animation.pose(time), query.kind.light());
        Ok(self.rival.frame(pose, query.rays, light)?)
    }

    /// Returns the facts about the tree of frame `number`.
    fn tree_stats(&self, number: usize) -> FrameTreeStats {
        let is_new = number == 0 || self.tree_update == TreeUpdate::Rebuild;
        let age = if is_new { 0 } else { number as u64 };
        FrameTreeStats {
            generation: Generation(number as u64 + 1 - age),
            age_frames: age,
            adopted: is_new,
            ..FrameTreeStats::default()
        }
    }

    pub(super) fn setup(&self) -> Setup {
        let device = self.rival.device().clone();
        Setup {
            backend: device.backend,
            adapter: device.adapter,
            driver: Some(device.driver).filter(|driver| !driver.is_empty()),
            threads: device.threads,
            update: self.tree_update.name(),
            intersector: RIVAL_INTERSECTOR,
            ..Setup::default()
        }
    }

    /// Traces one frame and returns its hits.
    pub(super) fn hits(&mut self, time: f64, query: Query<'_>) -> Result<Hits, CliError> {
        self.frame(time, query)?;
        Ok(self.rival.hits()?.clone())
    }

    /// Returns the share of rays whose triangle or shadow differs from that of backend `cpu`, over the first, a middle
    /// and the last frame. Backend `cpu` uses `watertight` and a new tree in each frame.
    pub(super) fn differing(
        &mut self,
        frames: &[Frame],
        query: Query<'_>,
    ) -> Result<f64, CliError> {
        let tracer = TracerSettings::of(
            Some(BackendName::Cpu),
            Intersector::Watertight,
            Some(Policy::Rebuild),
        );
        let workload = Workload {
            frames,
            rays: query.rays.count(),
        };
        let Started {
            tracer: mut driver, ..
        } = setup::start_driver(&self.animation, &tracer, workload)?;
        let places = [0, frames.len() / 2, frames.len().saturating_sub(1)];
        let mut compared: Vec<Frame> = places
            .iter()
            .filter_map(|&i| frames.get(i).copied())
            .collect();
        compared.dedup_by_key(|frame| frame.index);
        let (mut differ, mut rays) = (0, 0);
        for frame in compared {
            let ours = trace_frame(&mut driver, frame, query)?;
            differ += count_differing(&ours, &self.hits(frame.time, query)?);
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
