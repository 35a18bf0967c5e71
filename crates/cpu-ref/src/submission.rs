//! Submissions: recorded commands and their results.

use crate::output::TraceOutput;
use crate::scene::SceneState;
use backend::{FrameReport, Hits, Query, QueryKind, Rays, Result, Snapshot, Spares, Ticket};
use geom::{Camera, Hit, Point, Pose, Ray, copy_in_parallel};
use rayon::prelude::*;
use std::collections::VecDeque;
use std::time::Instant;

/// One recorded stage.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Command {
    Interpolate(Pose),
    Preprocess,
    Refit,
    /// Refits the candidate tree, not the current one.
    Evaluate,
    /// Traces a camera's rays, or the list passed when the command is executed.
    Trace(Option<Camera>, QueryKind),
    CopyPositions,
}

/// Copies of positions that were requested but not taken yet, and returned buffers for reuse.
#[derive(Default)]
pub(crate) struct Copies {
    pub(crate) ready: VecDeque<(Ticket, Snapshot)>,
    spares: Spares<Vec<Point>>,
}

/// A ticket with its results. Its memory is reused by later submissions.
#[derive(Debug, Default)]
pub(crate) struct Submission {
    /// `None` until `submit`, or an earlier trace of a list of rays, executes the commands.
    pub(crate) ticket: Option<Ticket>,
    /// Set if it has a trace that is not released.
    pub(crate) is_traced: bool,
    /// Set while [`backend::Backend::retain_traces`] retains it.
    pub(crate) is_retained: bool,
    /// Set if its traces were retained and then released by [`backend::Backend::retain_traces`].
    pub(crate) is_released: bool,
    pub(crate) report: FrameReport,
    pub(crate) hits: Hits,
}

impl Submission {
    pub(crate) fn begin(&mut self, ticket: Ticket) {
        self.ticket = Some(ticket);
        self.report = FrameReport::default();
    }

    /// Executes one command in the current rayon pool. `rays` is the list of a trace without a camera.
    pub(crate) fn execute(
        &mut self,
        command: Command,
        rays: &[Ray],
        scene: &mut SceneState,
        copies: &mut Copies,
    ) -> Result<()> {
        let start = Instant::now();
        let FrameReport {
            times,
            candidate_cost,
            ..
        } = &mut self.report;
        let stage = match command {
            Command::Interpolate(pose) => {
                scene.interpolate(pose)?;
                &mut times.interpolate_ms
            }
            Command::Preprocess => {
                scene.preprocess();
                &mut times.preprocess_ms
            }
            Command::Refit => {
                scene.refit();
                &mut times.refit_ms
            }
            Command::Evaluate => {
                *candidate_cost = scene.evaluate();
                &mut times.preprocess_ms
            }
            Command::Trace(camera, kind) => {
                let rays = camera.as_ref().map_or(Rays::List(rays), Rays::Camera);
                self.trace(scene, Query { rays, kind });
                // One task traces a ray and its shadow ray, so this is the time of both.
                &mut self.report.times.trace_primary_ms
            }
            Command::CopyPositions => {
                let mut positions = copies.spares.pop().unwrap_or_default();
                positions.resize(scene.positions.len(), [0.0; 3]);
                copy_in_parallel(&mut positions, &scene.positions);
                self.report.readback_bytes += size_of_val(&positions[..]) as u64;
                let ticket = self.ticket.expect("an executed submission has a ticket");
                let copy = (ticket, copies.spares.lend(positions));
                copies.ready.push_back(copy);
                return Ok(());
            }
        };
        // A stage may be recorded more than once.
        *stage = Some(stage.unwrap_or_default() + ms_since(start));
        Ok(())
    }

    fn trace(&mut self, scene: &SceneState, query: Query<'_>) {
        let Hits { closest, blocked } = &mut self.hits;
        let count = query.rays.count();
        let wants = |is_wanted: bool| if is_wanted { count } else { 0 };
        fill(closest, wants(query.kind != QueryKind::Any), Hit::MISS);
        fill(blocked, wants(query.kind != QueryKind::Closest), 0);
        let counts = scene.trace(query, TraceOutput::new(closest, blocked));
        (self.report.hits, self.report.blocked) = match query.kind {
            QueryKind::Any => (counts.blocked, 0),
            QueryKind::Closest | QueryKind::ClosestAndShadow { .. } => {
                (counts.hits, counts.blocked)
            }
        };
    }
}

/// Resizes `memory` to `count` entries with unspecified values. Growth is parallel, because the system allocates each
/// page when it is first written.
fn fill<T: Clone + Send + Sync>(memory: &mut Vec<T>, count: usize, with: T) {
    memory.truncate(count);
    if memory.len() != count {
        rayon::iter::repeat_n(with, count).collect_into_vec(memory);
    }
}

pub(crate) fn ms_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
