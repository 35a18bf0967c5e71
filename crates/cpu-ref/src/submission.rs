//! Carries out what was recorded, stage by stage, each with its own time.

use crate::recording::Command;
use crate::scene::SceneState;
use crate::snapshots::Snapshots;
use crate::trace::Counts;
use backend::{FrameReport, Hits, QueryKind, Rays, Ticket};
use geom::{Hit, Ray};
use std::time::Instant;

/// A ticket with what came of it; its memory is used again by a later one.
#[derive(Debug, Default)]
pub(crate) struct Submission {
    /// `None` before its first use.
    pub(crate) ticket: Option<Ticket>,
    /// Submissions with a trace, up to and including this one.
    pub(crate) traces: u64,
    pub(crate) report: FrameReport,
    pub(crate) hits: Hits,
}

impl Submission {
    /// Runs `commands` in the rayon pool that the caller installed, after those that ran under the same ticket. The device's
    /// clock began at `epoch`.
    pub(crate) fn run(
        &mut self,
        (ticket, epoch): (Ticket, Instant),
        (commands, rays): (&[Command], &[Ray]),
        scene: &mut SceneState,
        snapshots: &mut Snapshots,
    ) {
        let start = Instant::now();
        if self.ticket != Some(ticket) {
            self.begin(ticket, (start - epoch).as_secs_f64() * 1e3);
        }
        for &command in commands {
            let times = &mut self.report.times;
            match command {
                Command::Interpolate(pose) => {
                    timed(&mut times.interpolate_ms, || scene.interpolate(pose));
                }
                Command::Preprocess => timed(&mut times.preprocess_ms, || scene.preprocess()),
                Command::Refit => timed(&mut times.refit_ms, || scene.refit()),
                Command::Trace(Some(camera), kind) => {
                    self.trace(scene, Rays::Camera(&camera), kind)
                }
                Command::Trace(None, kind) => self.trace(scene, Rays::List(rays), kind),
                Command::CopyPositions => self.copy_positions(ticket, scene, snapshots),
            }
        }
        self.report.times.device_ms += ms_since(start);
        self.report.inactive = scene.unhittable.inactive;
        self.report.degenerate = scene.unhittable.degenerate;
        self.report.sah_cost = scene.sah_cost;
        self.report.settled += scene.take_settled();
    }

    fn begin(&mut self, ticket: Ticket, begun_ms: f64) {
        self.ticket = Some(ticket);
        self.report = FrameReport::default();
        self.report.times.begun_ms = Some(begun_ms);
        self.hits.closest.clear();
        self.hits.blocked.clear();
    }

    /// A ray's hit and its shadow are one task's, so there is one time for both.
    fn trace(&mut self, scene: &SceneState, rays: Rays<'_>, kind: QueryKind) {
        let Hits { closest, blocked } = &mut self.hits;
        let mut counts = Counts::default();
        timed(&mut self.report.times.trace_primary_ms, || {
            if kind != QueryKind::Any {
                closest.resize(rays.count(), Hit::MISS);
            }
            if kind != QueryKind::Closest {
                blocked.resize(rays.count(), 0);
            }
            counts = match kind {
                QueryKind::Any => scene.any(rays, blocked),
                QueryKind::Closest => scene.closest(rays, closest),
                QueryKind::ClosestAndShadow { light } => {
                    scene.closest_and_shadow(rays, light, (closest, blocked))
                }
            };
        });
        self.report.hits = counts.hits;
        self.report.blocked = counts.blocked;
    }

    fn copy_positions(&mut self, ticket: Ticket, scene: &SceneState, snapshots: &mut Snapshots) {
        let mut copy = snapshots.buffer();
        copy.resize(scene.positions().len(), [0.0; 3]);
        crate::interpolate::copy(scene.positions(), &mut copy);
        self.report.readback_bytes += size_of_val(copy.as_slice()) as u64;
        snapshots.push(ticket, copy);
    }
}

/// Adds the time that `stage` takes: a stage may be recorded twice.
fn timed(ms: &mut Option<f64>, stage: impl FnOnce()) {
    let start = Instant::now();
    stage();
    *ms = Some(ms.unwrap_or_default() + ms_since(start));
}

fn ms_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
