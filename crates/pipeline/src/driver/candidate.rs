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
    /// The result of the first evaluation, if the candidate cost less.
    pub(super) cheaper: Option<RelativeCost>,
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
///                ^                  |  |
///                `------------------'  `----> Rejected -> (dropped)
/// ```
///
/// An evaluated candidate returns to `Arrived` to be evaluated again: after the first evaluation, if it costs less than the
/// current tree, and while it costs more, but its moment is still to come.
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

/// The cost of a candidate relative to the current tree's at the same positions, less one. Negative if it costs less.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RelativeCost {
    /// Frames begun before the one that evaluated the candidate.
    pub(super) frame: u64,
    pub(super) value: f64,
}

impl RelativeCost {
    /// Returns the relative cost that a report contains, if the backend measures costs.
    pub(super) fn of(report: &FrameReport, frame: u64) -> Option<Self> {
        let (candidate, current) = report.candidate_cost.zip(report.sah_cost)?;
        let value = candidate / current - 1.0;
        Some(Self { frame, value })
    }

    /// Returns the mean over the next `frames` frames if the relative cost goes on changing as it did since `earlier`.
    fn mean_ahead(self, earlier: Self, frames: f64) -> f64 {
        let elapsed = (self.frame - earlier.frame).max(1) as f64;
        self.value + (self.value - earlier.value) / elapsed * 0.5 * frames
    }
}

/// What follows from an evaluation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    Accept,
    /// It costs less for the first time. A second evaluation shows whether it will continue to.
    EvaluateAgain(RelativeCost),
    /// It costs more, but its moment is yet to come.
    Wait,
    Reject,
}

/// Decides about a candidate that costs `now`, relative to the current tree. It would be used for `frames` frames.
///
/// Costs at one moment do not suffice where the motion is unknown: while vertices move to and fro, a tree that was built for one
/// pose costs less there and several times more a few frames later. So a candidate must cost less twice, and in the mean over
/// the time of its use, which is extrapolated from both evaluations. A tree from known key frames was built for that time.
pub(super) fn judge(
    now: RelativeCost,
    earlier: Option<RelativeCost>,
    frames: f64,
    is_approaching: bool,
) -> Verdict {
    match earlier {
        _ if now.value >= 0.0 && is_approaching => Verdict::Wait,
        _ if now.value.is_nan() || now.value >= 0.0 => Verdict::Reject,
        None => Verdict::EvaluateAgain(now),
        Some(earlier) if now.mean_ahead(earlier, frames) < 0.0 => Verdict::Accept,
        Some(_) => Verdict::Reject,
    }
}

impl Candidate {
    pub(super) fn new(request: Request) -> Self {
        Self {
            request,
            state: State::Building,
            dearer_at: None,
            cheaper: None,
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

    fn cost(frame: u64, value: f64) -> RelativeCost {
        RelativeCost { frame, value }
    }

    #[test]
    fn a_candidate_that_costs_more_is_rejected_unless_its_moment_is_to_come() {
        for earlier in [None, Some(cost(10, -0.1))] {
            for value in [0.0, 0.1] {
                let verdict =
                    |is_approaching| judge(cost(14, value), earlier, 32.0, is_approaching);
                assert_eq!(verdict(false), Verdict::Reject);
                assert_eq!(verdict(true), Verdict::Wait);
            }
            assert_eq!(
                judge(cost(14, f64::NAN), earlier, 32.0, false),
                Verdict::Reject
            );
        }
    }

    #[test]
    fn a_candidate_is_accepted_if_it_costs_less_in_the_mean_over_its_use() {
        let first = cost(10, -0.2);
        assert_eq!(
            judge(first, None, 32.0, true),
            Verdict::EvaluateAgain(first)
        );
        // Over four frames the cost rises by 0.1: by 0.4 until the middle of 32 frames.
        for (value, frames, expected) in [
            (-0.2, 32.0, Verdict::Accept),
            (-0.3, 1e6, Verdict::Accept),
            (-0.1, 7.0, Verdict::Accept),
            (-0.1, 9.0, Verdict::Reject),
            (-0.1, 32.0, Verdict::Reject),
        ] {
            let verdict = judge(cost(14, value), Some(first), frames, false);
            assert_eq!(verdict, expected, "{value} over {frames} frames");
        }
        // Two evaluations in one frame cannot happen; they would not divide by zero.
        assert_eq!(judge(first, Some(first), 32.0, false), Verdict::Accept);
    }

    #[test]
    fn costs_are_relative_and_unknown_if_one_is() {
        let of = |candidate_cost, sah_cost| {
            let report = FrameReport {
                candidate_cost,
                sah_cost,
                ..FrameReport::default()
            };
            RelativeCost::of(&report, 3)
        };
        assert_eq!(of(Some(1.5), Some(2.0)), Some(cost(3, -0.25)));
        for unknown in [[None, Some(2.0)], [Some(2.0), None], [None; 2]] {
            let [candidate, current] = unknown;
            assert_eq!(of(candidate, current), None);
        }
    }
}
