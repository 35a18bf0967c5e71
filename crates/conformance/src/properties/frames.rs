//! Frames after any commands. Backends skip work whose inputs have not changed, and static geometry.

use super::Check;
use crate::compare::{same_cost, same_counts, same_lists, same_point, same_results};
use crate::generate::commands::{BackendCommand, without_treelets};
use crate::stage::{fetch, next_positions, preprocess_and_refit, start, tree_at, vertices};
use anyhow::{Context, Result, bail, ensure};
use backend::{Generation, QueryKind, Ticket};
use bvh_layout::Topology;
use std::mem::take;

/// Tests that boxes, counts, costs and hits of frames equal the reference's, and positions those of `geom`'s formula,
/// whatever was recorded before.
///
/// Copies of positions must be those of the moment at which they were requested, and arrive in order.
pub(super) fn after_commands(c: &mut Check<'_>) -> Result<()> {
    let case = c.case;
    let mut state = RecordingState {
        tree: tree_at(&case.animation, case.times[0]),
        generation: 1,
        time: case.times[0],
        is_stale: true,
        is_recording: true,
        requested: None,
        copies: Vec::new(),
    };
    c.open(state.time)?;
    c.interpolate(state.time)?;
    for (i, &command) in case
        .commands
        .iter()
        .chain([&BackendCommand::Frame])
        .enumerate()
    {
        let recorded = state.record(c, command);
        recorded.with_context(|| format!("{command:?} after {:?}", &case.commands[..i]))?;
    }
    match c.subject.take_positions()? {
        None => Ok(()),
        Some((ticket, _)) => bail!("positions of {ticket:?} came without a request"),
    }
}

/// The state in which the commands so far leave a backend.
struct RecordingState {
    tree: Topology,
    generation: u64,
    /// Time of the positions.
    time: f64,
    /// Whether boxes must be computed before rays are traced.
    is_stale: bool,
    /// Whether commands were recorded after the last submission.
    is_recording: bool,
    /// Time of the positions that the next submission copies, if any.
    requested: Option<f64>,
    /// Copies that were not taken yet.
    copies: Vec<RequestedCopy>,
}

/// A copy of positions that a submission contains.
struct RequestedCopy {
    ticket: Ticket,
    time: f64,
}

impl RecordingState {
    fn record(&mut self, c: &mut Check<'_>, command: BackendCommand) -> Result<()> {
        let (animation, times) = (&c.case.animation, &c.case.times);
        match command {
            BackendCommand::Frame => return self.frame(c),
            BackendCommand::Submit => return self.submit(c),
            BackendCommand::Adopt(next) => {
                // Trees are adopted between submissions.
                self.submit(c)?;
                self.tree = next.tree(animation, |time| tree_at(animation, times[time]));
                self.generation += 1;
                self.is_stale = true;
                c.subject.adopt(&self.tree, Generation(self.generation))?;
                return Ok(());
            }
            BackendCommand::Interpolate(time) => {
                self.time = times[time];
                self.is_stale = true;
                c.interpolate(self.time)?;
            }
            BackendCommand::Preprocess => {
                self.is_stale = true;
                c.subject.preprocess()?;
            }
            BackendCommand::Boxes => {
                self.is_stale = false;
                preprocess_and_refit(c.subject)?;
            }
            // A submission copies at most once.
            BackendCommand::Request if self.requested.is_some() => {}
            BackendCommand::Request => {
                self.requested = Some(self.time);
                c.subject.request_positions()?;
            }
        }
        self.is_recording = true;
        Ok(())
    }

    fn submit(&mut self, c: &mut Check<'_>) -> Result<()> {
        if self.is_recording {
            let ticket = c.subject.submit()?;
            self.submitted(ticket);
        }
        Ok(())
    }

    fn submitted(&mut self, ticket: Ticket) {
        self.is_recording = false;
        let time = self.requested.take();
        self.copies
            .extend(time.map(|time| RequestedCopy { ticket, time }));
    }

    /// Traces a frame and compares all its results, and all copies of positions requested so far.
    fn frame(&mut self, c: &mut Check<'_>) -> Result<()> {
        let case = c.case;
        if take(&mut self.is_stale) {
            preprocess_and_refit(c.subject)?;
        }
        let rays = c.rays();
        let ticket = start(c.subject, rays, QueryKind::Closest)?;
        self.submitted(ticket);
        let found = fetch(c.subject, ticket)?;
        let positions = c.subject.positions()?;
        let formula = vertices(&case.animation, self.time);
        same_lists("position of vertex", &positions, &formula, same_point)?;
        let plain = without_treelets(&self.tree);
        let expected = c
            .reference
            .by_tree(case, c.intersector, &plain, self.time)?;
        let boxes = c.subject.boxes()?;
        same_lists("box of node", &boxes, &expected.boxes, PartialEq::eq)?;
        same_counts(&found.report, &expected.traced.report)?;
        // Areas may overflow or underflow in single precision if the scene is scaled. A backend may report no cost.
        let cost = found.report.sah_cost;
        if case.animation.scale_exponent() == 0 && cost.is_some() {
            same_cost(cost, expected.traced.report.sah_cost)?;
        }
        same_results(
            case,
            self.time,
            c.rays(),
            &found.hits,
            &expected.traced.hits,
        )?;
        for copy in take(&mut self.copies) {
            let (ticket, points) = next_positions(c.subject)?;
            let same = ticket == copy.ticket;
            ensure!(
                same,
                "a copy of positions belongs to {ticket:?}, expected {:?}",
                copy.ticket
            );
            let formula = vertices(&case.animation, copy.time);
            same_lists("copied vertex", &points, &formula, same_point)?;
        }
        Ok(())
    }
}
