//! The requested tree and its states, from the request to the adoption or rejection.

use crate::builder_thread::BuildResult;
use crate::tree_builder::Built;
use backend::{FrameReport, Generation, Snapshot, Ticket};
use geom::Pose;
use std::time::Instant;

/// A tree that was requested and is neither adopted nor rejected yet.
pub(super) struct Candidate {
    pub(super) request: Request,
    pub(super) state: State,
    /// Distance in key frames to the middle of its use when it was last found to cost more than the current tree.
    pub(super) dearer_at: Option<f64>,
    /// Its cost divided by the current tree's, from the evaluation that accepted it.
    pub(super) share: Option<f64>,
}

/// Which tree was requested, when, and for what time of use.
pub(super) struct Request {
    pub(super) generation: Generation,
    /// Number of frames begun before the one that requested it.
    pub(super) frame: u64,
    /// Time of the requesting frame, in key frames.
    pub(super) time: f64,
    /// Time of the next frame that moves, if its positions are read back too.
    pub(super) moved_at: Option<f64>,
    /// Positions of the first of these frames, until those of the second arrive.
    pub(super) observed: Option<Snapshot>,
    /// Pose that the tree is built for.
    pub(super) pose: Pose,
    /// Middle of the expected time of use, in key frames.
    pub(super) middle: f64,
    /// Middles of both halves of the expected time of use, in key frames.
    pub(super) halves: [f64; 2],
    pub(super) requested: Instant,
    /// Number of frames that the build took, once it is finished.
    pub(super) latency: Option<u64>,
    /// When its vertices arrived on the host, and the number of bytes read back for them; `None` before.
    pub(super) vertices_arrived: Option<(Instant, u64)>,
}

/// State of a candidate.
///
/// ```text
/// Building -> Arrived -> Due -> Evaluating -> Accepted -> (adopted)
///                ^ |                |  |
///                | `----------------'  `----> Rejected -> (dropped)
///                `- costs more, but its time of use is still to come
/// ```
pub(super) enum State {
    /// It waits for vertices or is being built.
    Building,
    /// It is on the host, is being uploaded, or its time of use is too far ahead.
    Arrived(Built),
    /// The next frame evaluates it.
    Due(Built),
    /// A frame evaluates it.
    Evaluating(Built, Evaluation),
    /// It is adopted at the next frame boundary.
    Accepted(Built),
    /// It is dropped at the next frame boundary. Contains the pose at which it cost more than the current tree, if that
    /// is the reason.
    Rejected(Option<Pose>),
}

/// Evaluation of a candidate in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Evaluation {
    /// `None` until the frame is submitted.
    pub(super) ticket: Option<Ticket>,
    /// Number of frames begun before the one that evaluates it.
    pub(super) frame: u64,
    pub(super) pose: Pose,
    /// Distance in key frames to the middle of the candidate's use; `None` if time does not approach it.
    pub(super) approach: Option<f64>,
}

/// Result of an evaluation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    Accept,
    /// It costs more, but its time of use is still to come.
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
            share: None,
        }
    }

    pub(super) fn is_building(&self) -> bool {
        matches!(self.state, State::Building)
    }

    /// Returns whether it is adopted or dropped at the next frame boundary.
    pub(super) fn is_decided(&self) -> bool {
        matches!(self.state, State::Accepted(_) | State::Rejected(_))
    }

    /// Returns the tree if it waits for its upload or its evaluation.
    pub(super) fn arrived(&self) -> Option<&Built> {
        match &self.state {
            State::Arrived(built) => Some(built),
            _ => None,
        }
    }

    /// Removes the tree, which leaves the candidate rejected.
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

    /// Moves the tree, if it is built, to another state.
    pub(super) fn advance(&mut self, to: impl FnOnce(Built) -> State) {
        if let Some(built) = self.take() {
            self.state = to(built);
        }
    }

    /// Sets the ticket of the frame that evaluates it.
    pub(super) fn submitted(&mut self, ticket: Ticket) {
        if let State::Evaluating(_, evaluation) = &mut self.state {
            evaluation.ticket.get_or_insert(ticket);
        }
    }

    /// Schedules the evaluation again, because its frame was not submitted.
    pub(super) fn abandoned(&mut self) {
        if matches!(&self.state, State::Evaluating(_, evaluation) if evaluation.ticket.is_none()) {
            self.advance(State::Arrived);
        }
    }

    /// Returns the evaluation that the submission `ticket` contains.
    pub(super) fn evaluated_by(&self, ticket: Ticket) -> Option<Evaluation> {
        match &self.state {
            State::Evaluating(_, evaluation) if evaluation.ticket == Some(ticket) => {
                Some(*evaluation)
            }
            _ => None,
        }
    }
}

/// Stores the result of a build in its candidate. Returns `None` if the build failed.
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
