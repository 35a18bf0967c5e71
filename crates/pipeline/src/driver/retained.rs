//! The tree that the current one has replaced. It stays on the device until another tree is evaluated.
//!
//! A tree is adopted because it costs less at one moment. Where the motion is unknown, it may cost several times more a few
//! frames later, for example while vertices move to and fro. So the replaced tree is evaluated again whenever the current tree's
//! cost has risen, and returns if it costs less.

use super::trees::Tree;
use backend::{FrameReport, Ticket};

/// The replaced tree is evaluated once the current tree costs this many times its lowest cost since the last comparison.
const RISE: f64 = 1.05;

/// A replaced tree and its comparison with the current one.
pub(super) struct Retained {
    tree: Tree,
    state: State,
    /// The current tree's lowest cost since the last comparison.
    lowest: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    /// The current tree costs no more than before.
    Kept,
    /// The next frame evaluates it.
    Due,
    /// A frame evaluates it; `None` until the frame is submitted.
    Evaluating(Option<Ticket>),
    /// It costs less than the current tree and returns at the next frame boundary.
    Cheaper,
}

impl Retained {
    pub(super) fn new(tree: Tree) -> Self {
        Self {
            tree,
            state: State::Kept,
            lowest: f64::INFINITY,
        }
    }

    /// Takes in the report of a frame that was traced with the current tree.
    pub(super) fn observe(&mut self, ticket: Ticket, report: &FrameReport) {
        let Some(current) = report.sah_cost else {
            return;
        };
        match self.state {
            State::Kept if current > RISE * self.lowest => self.state = State::Due,
            State::Kept => self.lowest = self.lowest.min(current),
            State::Evaluating(Some(evaluated_by)) if evaluated_by == ticket => {
                let is_cheaper = report.candidate_cost.is_some_and(|cost| cost < current);
                self.lowest = current;
                self.state = if is_cheaper {
                    State::Cheaper
                } else {
                    State::Kept
                };
            }
            State::Due | State::Evaluating(_) | State::Cheaper => {}
        }
    }

    /// Returns whether the frame that is recorded is to evaluate it.
    pub(super) fn is_due(&self) -> bool {
        self.state == State::Due
    }

    /// Notes that the frame that is recorded evaluates it.
    pub(super) fn recorded(&mut self) {
        self.state = State::Evaluating(None);
    }

    /// Notes the ticket of the frame that evaluates it.
    pub(super) fn submitted(&mut self, ticket: Ticket) {
        if self.state == State::Evaluating(None) {
            self.state = State::Evaluating(Some(ticket));
        }
    }

    /// Has the evaluation be recorded again, because its frame was not submitted.
    pub(super) fn abandoned(&mut self) {
        if self.state == State::Evaluating(None) {
            self.state = State::Due;
        }
    }

    /// Returns whether it costs less than the current tree.
    pub(super) fn is_cheaper(&self) -> bool {
        self.state == State::Cheaper
    }

    pub(super) fn into_tree(self) -> Tree {
        self.tree
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use backend::Generation;
    use geom::Pose;

    fn retained() -> Retained {
        Retained::new(Tree {
            generation: Generation(1),
            frame: 0,
            pose: Pose { key: 0, alpha: 0.0 },
            middle: 0.0,
            cost: 1.0,
            returned: false,
        })
    }

    /// A report of the costs of the current tree and, in an evaluation, of the replaced one.
    fn report(current: f64, replaced: Option<f64>) -> FrameReport {
        FrameReport {
            sah_cost: Some(current),
            candidate_cost: replaced,
            ..FrameReport::default()
        }
    }

    #[test]
    fn it_is_evaluated_once_the_current_tree_costs_a_twentieth_more_than_at_its_lowest() {
        let mut tree = retained();
        for (ticket, current, is_due) in [
            (1, 2.0, false),
            (2, 1.0, false),
            (3, 1.04, false),
            (4, 1.06, true),
        ] {
            tree.observe(Ticket(ticket), &report(current, None));
            assert_eq!(tree.is_due(), is_due, "{current}");
        }
    }

    #[test]
    fn it_returns_if_it_costs_less_and_else_waits_for_a_further_rise() {
        for (replaced, is_cheaper) in [(Some(1.9), true), (Some(2.0), false), (None, false)] {
            let mut tree = retained();
            for current in [1.0, 2.0] {
                tree.observe(Ticket(1), &report(current, None));
            }
            tree.recorded();
            tree.abandoned();
            assert!(tree.is_due());
            tree.recorded();
            tree.submitted(Ticket(5));
            // Frames before the one that evaluates it have no second cost.
            tree.observe(Ticket(4), &report(3.0, None));
            tree.observe(Ticket(5), &report(2.0, replaced));
            assert_eq!(tree.is_cheaper(), is_cheaper, "{replaced:?}");
            tree.observe(Ticket(6), &report(2.05, None));
            assert!(!tree.is_due());
            tree.observe(Ticket(7), &report(2.15, None));
            assert_eq!(tree.is_due(), !is_cheaper);
        }
    }
}
