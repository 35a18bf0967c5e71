//! The tree to come: its states from the request to the adoption or rejection.

use crate::builder_thread::BuildResult;
use crate::tree_builder::Built;
use backend::{FrameReport, Generation, Snapshot, Ticket};
use geom::Pose;
use std::time::Instant;

/// A tree that was requested and is neither adopted nor rejected yet.
pub(super) struct Candidate {
    pub(super) request: Request,
    pub(super) state: State,
    /// How far its moment was away, in key frames, when it was last found to cost more than the current tree.
    pub(super) dearer_at: Option<f64>,
}

/// Which tree was requested, when, and what for.
pub(super) struct Request {
    pub(super) generation: Generation,
    /// Frames begun before the one that requested it.
    pub(super) frame: u64,
    /// The time of that frame.
    pub(super) time: f64,
    /// The time of the next frame that moves, if its positions are read back, too.
    pub(super) moved_at: Option<f64>,
    /// The positions of the first of these frames, until those of the second arrive.
    pub(super) observed: Option<Snapshot>,
    /// The pose that it is built for.
    pub(super) pose: Pose,
    /// The moment that it is best used at.
    pub(super) middle: f64,
    /// Moments early and late in its use.
    pub(super) halves: [f64; 2],
    pub(super) requested: Instant,
    /// How many frames the build took, once it is finished.
    pub(super) latency: Option<u64>,
    /// When its vertices were there on the host, and how many bytes were read back for them; `None` before.
    pub(super) vertices_arrived: Option<(Instant, u64)>,
}

/// How far a candidate is.
///
/// ```text
/// Building -> Arrived -> Due -> Evaluating -> Accepted -> (adopted)
///                ^ |                |  |
///                | `----------------'  `----> Rejected -> (dropped)
///                `- still dearer, but its moment is yet to come
/// ```
pub(super) enum State {
    /// It waits for vertices, or the builder works on it.
    Building,
    /// It is on the host, on its way to the device, or its moment is too far off.
    Arrived(Built),
    /// The next frame evaluates it.
    Due(Built),
    /// A frame evaluates it.
    Evaluating(Built, Evaluation),
    /// It is adopted at the next frame boundary.
    Accepted(Built),
    /// It is dropped at the next frame boundary. The pose says where it cost more than the current tree, if that is why.
    Rejected(Option<Pose>),
}

/// The frame that evaluates a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Evaluation {
    /// `None` until the frame is submitted.
    pub(super) ticket: Option<Ticket>,
    /// Frames begun before it.
    pub(super) frame: u64,
    pub(super) pose: Pose,
    /// How far the candidate's moment was away, in key frames; `None` if it came no nearer.
    pub(super) approach: Option<f64>,
}

/// What follows from an evaluation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    Accept,
    /// It costs more, but its moment is yet to come.
    Wait,
    Reject,
}

impl Verdict {
    /// Compares costs at the same positions. A candidate whose cost is unknown is accepted.
    pub(super) fn of(report: &FrameReport, is_approaching: bool) -> Self {
        match report.candidate_cost.zip(report.sah_cost) {
            Some((candidate, current)) if candidate >= current => match is_approaching {
                true => Self::Wait,
                false => Self::Reject,
            },
            _ => Self::Accept,
        }
    }
}

impl Candidate {
    pub(super) fn new(request: Request) -> Self {
        Self {
            request,
            state: State::Building,
            dearer_at: None,
        }
    }

    pub(super) fn is_building(&self) -> bool {
        matches!(self.state, State::Building)
    }

    /// Whether a frame boundary adopts or drops it.
    pub(super) fn is_decided(&self) -> bool {
        matches!(self.state, State::Accepted(_) | State::Rejected(_))
    }

    /// Returns the tree that is to be brought to the device.
    pub(super) fn arrived(&self) -> Option<&Built> {
        match &self.state {
            State::Arrived(built) => Some(built),
            _ => None,
        }
    }

    /// Takes the tree out, which leaves the candidate rejected.
    pub(super) fn take(&mut self) -> Option<Built> {
        match std::mem::replace(&mut self.state, State::Rejected(None)) {
            State::Arrived(built)
            | State::Due(built)
            | State::Evaluating(built, _)
            | State::Accepted(built) => Some(built),
            state @ (State::Building | State::Rejected(_)) => {
                self.state = state;
                None
            }
        }
    }

    /// Has the tree go on in another state, if there is one.
    pub(super) fn advance(&mut self, to: impl FnOnce(Built) -> State) {
        if let Some(built) = self.take() {
            self.state = to(built);
        }
    }

    /// Notes the ticket of the frame that evaluates it.
    pub(super) fn submitted(&mut self, ticket: Ticket) {
        if let State::Evaluating(_, evaluation) = &mut self.state {
            evaluation.ticket.get_or_insert(ticket);
        }
    }

    /// Has the evaluation be recorded again, because its frame was not submitted.
    pub(super) fn abandoned(&mut self) {
        if matches!(&self.state, State::Evaluating(_, evaluation) if evaluation.ticket.is_none()) {
            self.advance(State::Arrived);
        }
    }

    /// Returns the evaluation that a frame was submitted with.
    pub(super) fn evaluated_by(&self, ticket: Ticket) -> Option<Evaluation> {
        match &self.state {
            State::Evaluating(_, evaluation) if evaluation.ticket == Some(ticket) => {
                Some(*evaluation)
            }
            _ => None,
        }
    }
}

/// Files what a builder made: `None` if it failed.
pub(super) fn file(candidate: Option<Candidate>, result: BuildResult<Built>) -> Option<Candidate> {
    let (mut candidate, built) = (candidate?, result.ok()?);
    if built.gave_up_extrapolation {
        let seen_at = candidate.request.moved_at;
        candidate.request.middle = seen_at.unwrap_or(candidate.request.time);
    }
    candidate.state = State::Arrived(built);
    Some(candidate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_lower_cost_is_accepted_and_a_moment_to_come_is_waited_for() {
        let verdict = |candidate_cost, sah_cost, is_approaching| {
            let report = FrameReport {
                candidate_cost,
                sah_cost,
                ..FrameReport::default()
            };
            Verdict::of(&report, is_approaching)
        };
        for is_approaching in [false, true] {
            for unknown in [[None, Some(2.0)], [Some(2.0), None], [None; 2]] {
                let [candidate, current] = unknown;
                assert_eq!(verdict(candidate, current, is_approaching), Verdict::Accept);
            }
            assert_eq!(
                verdict(Some(1.9), Some(2.0), is_approaching),
                Verdict::Accept
            );
        }
        for dearer in [2.0, 2.1] {
            assert_eq!(verdict(Some(dearer), Some(2.0), false), Verdict::Reject);
            assert_eq!(verdict(Some(dearer), Some(2.0), true), Verdict::Wait);
        }
    }
}
