//! The next tree: its states from the request to the adoption or rejection, and the transitions between them.

use crate::tree_builder::Built;
use backend::{Generation, Snapshot, Ticket};
use geom::Pose;

/// Request of a tree.
#[derive(Clone, Debug)]
pub(super) struct Request {
    pub(super) generation: Generation,
    /// Number of frames begun before the one that requested it.
    pub(super) frame: u64,
    /// Time of the requesting frame, in key frames.
    pub(super) time: f64,
    /// Time of the second observed frame if there is one, else `time`. It becomes the target time if earlier
    /// extrapolation failed, because the build then uses the last observed positions.
    pub(super) last_time: f64,
    /// Pose at `last_time`.
    pub(super) last_pose: Pose,
    /// Pose that the tree is requested for. If extrapolation failed, `last_pose`.
    pub(super) pose: Pose,
    /// Middle of the expected time of use, in key frames.
    pub(super) target_time: f64,
    /// Times at one quarter and at three quarters of the expected time of use, in key frames. With `async` and
    /// prediction, and if trees degrade fast, the tree is built over boxes that contain each triangle at both times.
    pub(super) swept_times: [f64; 2],
}

/// Positions that a build from two observed frames waits for.
#[derive(Default)]
pub(super) struct Observation {
    /// Positions of the requesting frame, until those of the second frame arrive.
    pub(super) first: Option<Snapshot>,
    /// Number of frames begun before the second frame; `None` before it begins.
    pub(super) second: Option<u64>,
}

/// A finished tree that is neither adopted nor dropped yet.
#[derive(Debug)]
pub(super) struct CandidateTree {
    pub(super) request: Request,
    pub(super) built: Built,
    /// Whether the upload is finished, so that the latency is known.
    pub(super) has_arrived: bool,
    /// Distance in key frames to the target time at the last evaluation that found the tree no cheaper than the current
    /// one.
    pub(super) costlier_distance: Option<f64>,
    /// Its cost divided by the current tree's, from the evaluation that accepted it.
    pub(super) cost_ratio: Option<f64>,
}

impl CandidateTree {
    pub(super) fn new(request: Request, built: Built) -> Self {
        Self {
            request,
            built,
            has_arrived: false,
            costlier_distance: None,
            cost_ratio: None,
        }
    }
}

/// Evaluation of a tree in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Evaluation {
    /// `None` until the frame is submitted.
    pub(super) ticket: Option<Ticket>,
    /// Number of frames begun before the one that evaluates it.
    pub(super) frame: u64,
    pub(super) pose: Pose,
    /// Distance in key frames to the tree's target time. `None` if time does not approach it, or if trees are not
    /// built for a future time.
    pub(super) approach: Option<f64>,
}

/// Result of an evaluation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// The tree costs less, or a cost is unknown.
    Accept {
        /// Its cost divided by the current tree's, if known.
        cost_ratio: Option<f64>,
    },
    /// It costs as much or more, but time still approaches its target.
    Wait,
    /// It costs as much or more.
    Reject,
}

/// State of the next tree. [`NextTreeState::after`] is the table of transitions.
#[derive(Default)]
pub(super) enum NextTreeState {
    /// No tree is requested.
    #[default]
    Idle,
    /// The tree waits for its vertices.
    Requested(Request, Observation),
    /// The builder thread builds the tree.
    Building(Request),
    /// The tree is finished. It is being uploaded, or waits until its target time is near enough.
    Waiting(CandidateTree),
    /// The next call of `record_evaluation` evaluates the tree.
    Due(CandidateTree),
    /// A frame evaluates the tree.
    Evaluating(CandidateTree, Evaluation),
    /// `update_trees` will adopt the tree. In lockstep, it waits for a fixed frame.
    Accepted(CandidateTree),
    /// `update_trees` will drop the tree. In lockstep, it waits for a fixed frame. Contains the pose of the
    /// evaluation that rejected it, or of its request if the upload failed. `None` if it was superseded.
    Rejected(CandidateTree, Option<Pose>),
}

/// An event in the life of the next tree.
pub(super) enum Event {
    /// A frame requests a tree.
    Requested(Request),
    /// The builder thread receives the vertices, or the pose for which it blends them.
    BuildStarted,
    BuildFinished(Built),
    BuildFailed,
    /// The tree is adopted without an evaluation.
    Admitted,
    /// The target time is near enough for an evaluation.
    BecameDue,
    /// A newer tree would arrive before this one is due.
    Superseded,
    /// The tree exceeds the memory or a limit of the device.
    UploadFailed,
    EvaluationRecorded(Evaluation),
    Evaluated(Verdict),
    /// The frame that was being recorded failed.
    FrameFailed,
    /// Results of submitted frames do not arrive: positions that are read back, and boxes.
    ResultsLost,
}

impl NextTreeState {
    /// Returns the state that follows. An event that does not concern the state leaves it unchanged.
    fn after(self, event: Event) -> Self {
        match (self, event) {
            (Self::Idle, Event::Requested(request)) => {
                Self::Requested(request, Observation::default())
            }
            (Self::Requested(request, _), Event::BuildStarted) => Self::Building(request),
            (Self::Building(mut request), Event::BuildFinished(built)) => {
                if built.gave_up_extrapolation {
                    request.target_time = request.last_time;
                    request.pose = request.last_pose;
                }
                Self::Waiting(CandidateTree::new(request, built))
            }
            (Self::Requested(..), Event::ResultsLost) | (Self::Building(_), Event::BuildFailed) => {
                Self::Idle
            }
            (Self::Waiting(tree), Event::BecameDue) => Self::Due(tree),
            (Self::Waiting(tree), Event::Superseded) => Self::Rejected(tree, None),
            (Self::Waiting(tree), Event::UploadFailed) => {
                let pose = tree.request.pose;
                Self::Rejected(tree, Some(pose))
            }
            (Self::Waiting(tree) | Self::Due(tree), Event::Admitted) => Self::Accepted(tree),
            (Self::Due(tree), Event::EvaluationRecorded(evaluation)) => {
                Self::Evaluating(tree, evaluation)
            }
            (Self::Evaluating(tree, evaluation), Event::Evaluated(verdict)) => match verdict {
                Verdict::Accept { cost_ratio } => {
                    Self::Accepted(CandidateTree { cost_ratio, ..tree })
                }
                Verdict::Wait => Self::Waiting(CandidateTree {
                    costlier_distance: evaluation.approach,
                    ..tree
                }),
                Verdict::Reject => Self::Rejected(tree, Some(evaluation.pose)),
            },
            (Self::Evaluating(tree, evaluation), Event::FrameFailed)
                if evaluation.ticket.is_none() =>
            {
                Self::Waiting(tree)
            }
            (
                Self::Due(tree) | Self::Evaluating(tree, _) | Self::Accepted(tree),
                Event::ResultsLost,
            ) => Self::Waiting(tree),
            (state, _) => state,
        }
    }

    /// Moves to the state that follows.
    pub(super) fn advance(&mut self, event: Event) {
        *self = std::mem::take(self).after(event);
    }

    pub(super) fn is_idle(&self) -> bool {
        matches!(self, Self::Idle)
    }

    /// Returns whether the tree is accepted or rejected.
    pub(super) fn is_decided(&self) -> bool {
        matches!(self, Self::Accepted(_) | Self::Rejected(..))
    }

    /// Returns the request; `None` in the state `Idle`.
    pub(super) fn request(&self) -> Option<&Request> {
        match self {
            Self::Idle => None,
            Self::Requested(request, _) | Self::Building(request) => Some(request),
            Self::Waiting(tree)
            | Self::Due(tree)
            | Self::Evaluating(tree, _)
            | Self::Accepted(tree)
            | Self::Rejected(tree, _) => Some(&tree.request),
        }
    }

    /// Sets the ticket of the frame that evaluates the tree, once it is submitted.
    pub(super) fn submitted(&mut self, ticket: Ticket) {
        if let Self::Evaluating(_, evaluation) = self {
            evaluation.ticket.get_or_insert(ticket);
        }
    }

    /// Returns the evaluation that the submission `ticket` contains.
    pub(super) fn evaluation_in(&self, ticket: Ticket) -> Option<Evaluation> {
        match self {
            Self::Evaluating(_, evaluation) if evaluation.ticket == Some(ticket) => {
                Some(*evaluation)
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree_builder::tests::{at_key, row};

    /// Target time of the request, and time of the last observed positions.
    const TARGET: f64 = 5.0;
    const OBSERVED: f64 = 2.0;

    fn request() -> Request {
        Request {
            generation: Generation(7),
            frame: 3,
            time: 1.0,
            last_time: OBSERVED,
            last_pose: Pose { key: 2, alpha: 0.0 },
            pose: Pose { key: 5, alpha: 0.0 },
            target_time: TARGET,
            swept_times: [4.0, 6.0],
        }
    }

    fn built() -> Built {
        at_key(&row(2, 1, |_, i| i as f32), 0)
    }

    fn evaluation(ticket: Option<Ticket>) -> Evaluation {
        Evaluation {
            ticket,
            frame: 9,
            pose: Pose { key: 4, alpha: 0.5 },
            approach: Some(0.5),
        }
    }

    fn state(letter: char) -> NextTreeState {
        let tree = || CandidateTree::new(request(), built());
        match letter {
            'i' => NextTreeState::Idle,
            'r' => NextTreeState::Requested(request(), Observation::default()),
            'b' => NextTreeState::Building(request()),
            'w' => NextTreeState::Waiting(tree()),
            'd' => NextTreeState::Due(tree()),
            // Its frame is being recorded.
            'e' => NextTreeState::Evaluating(tree(), evaluation(None)),
            // Its frame is submitted.
            's' => NextTreeState::Evaluating(tree(), evaluation(Some(Ticket(1)))),
            'a' => NextTreeState::Accepted(tree()),
            _ => NextTreeState::Rejected(tree(), None),
        }
    }

    fn letter(state: &NextTreeState) -> char {
        match state {
            NextTreeState::Idle => 'i',
            NextTreeState::Requested(..) => 'r',
            NextTreeState::Building(_) => 'b',
            NextTreeState::Waiting(_) => 'w',
            NextTreeState::Due(_) => 'd',
            NextTreeState::Evaluating(_, evaluation) if evaluation.ticket.is_none() => 'e',
            NextTreeState::Evaluating(..) => 's',
            NextTreeState::Accepted(_) => 'a',
            NextTreeState::Rejected(..) => 'x',
        }
    }

    /// An event's name, the event, and the state that follows each of the states `irbwdesax`.
    type Row = (&'static str, fn() -> Event, &'static str);

    const STATES: &str = "irbwdesax";
    const TABLE: [Row; 14] = [
        ("requested", || Event::Requested(request()), "rrbwdesax"),
        ("started", || Event::BuildStarted, "ibbwdesax"),
        ("finished", || Event::BuildFinished(built()), "irwwdesax"),
        ("failed", || Event::BuildFailed, "iriwdesax"),
        ("admitted", || Event::Admitted, "irbaaesax"),
        ("due", || Event::BecameDue, "irbddesax"),
        ("superseded", || Event::Superseded, "irbxdesax"),
        ("upload failed", || Event::UploadFailed, "irbxdesax"),
        (
            "recorded",
            || Event::EvaluationRecorded(evaluation(None)),
            "irbweesax",
        ),
        (
            "cheaper",
            || {
                let cost_ratio = Some(0.5);
                Event::Evaluated(Verdict::Accept { cost_ratio })
            },
            "irbwdaaax",
        ),
        ("wait", || Event::Evaluated(Verdict::Wait), "irbwdwwax"),
        (
            "costlier",
            || Event::Evaluated(Verdict::Reject),
            "irbwdxxax",
        ),
        ("frame failed", || Event::FrameFailed, "irbwdwsax"),
        ("results lost", || Event::ResultsLost, "iibwwwwwx"),
    ];

    #[test]
    fn every_event_leads_from_every_state_to_the_one_in_the_table() {
        for (name, event, expected) in TABLE {
            let found: String = STATES
                .chars()
                .map(|from| letter(&state(from).after(event())))
                .collect();
            assert_eq!(found, expected, "{name}");
        }
    }

    #[test]
    fn a_verdict_is_kept_with_the_tree() {
        let after = |verdict| state('s').after(Event::Evaluated(verdict));
        let accepted = after(Verdict::Accept {
            cost_ratio: Some(0.5),
        });
        assert!(matches!(accepted, NextTreeState::Accepted(tree) if tree.cost_ratio == Some(0.5)));
        let waiting = after(Verdict::Wait);
        assert!(
            matches!(waiting, NextTreeState::Waiting(tree) if tree.costlier_distance == Some(0.5))
        );
        let pose = Some(evaluation(None).pose);
        assert!(matches!(after(Verdict::Reject), NextTreeState::Rejected(_, at) if at == pose));
    }

    #[test]
    fn failed_extrapolation_targets_last_observed_pose() {
        for (gave_up_extrapolation, target, key) in [(false, TARGET, 5), (true, OBSERVED, 2)] {
            let built = Built {
                gave_up_extrapolation,
                ..built()
            };
            let next = state('b').after(Event::BuildFinished(built));
            let request = next.request().unwrap();
            assert_eq!((request.target_time, request.pose.key), (target, key));
        }
    }
}
