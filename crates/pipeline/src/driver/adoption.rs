//! The rule by which finished trees are adopted or rejected. It is the same for all sources of vertices. The section
//! *Adoption* of `docs/design/trees.md` states it.

use super::DriverOptions;
use super::next_tree::{CandidateTree, Evaluation, Event, Verdict};
use crate::latency::LatencyPredictor;
use backend::FrameReport;

impl DriverOptions {
    /// Decides about a tree that is on the device. `current` is the target time of the current tree, or NaN if there is
    /// none. Returns `None` if the tree keeps waiting.
    pub(super) fn review(
        &self,
        tree: &CandidateTree,
        current: f64,
        predictor: &LatencyPredictor,
    ) -> Option<Event> {
        let target = tree.request.target_time;
        if !self.update.adopts_by_cost() {
            return Some(Event::Admitted);
        }
        if self.builds_ahead() && !predictor.is_new_target_nearer(current, target) {
            return predictor
                .newer_tree_arrives_first(current, target)
                .then_some(Event::Superseded);
        }
        let is_due = predictor.should_evaluate(target, tree.costlier_distance);
        is_due.then_some(Event::BecameDue)
    }
}

impl Verdict {
    /// Compares the costs that the evaluation's frame reports.
    pub(super) fn of(report: &FrameReport, evaluation: &Evaluation) -> Self {
        let costs = report.candidate_cost.zip(report.sah_cost);
        match costs {
            Some((candidate, current)) if candidate >= current => match evaluation.approach {
                Some(_) => Self::Wait,
                None => Self::Reject,
            },
            _ => Self::Accept {
                cost_ratio: costs.map(|(candidate, current)| candidate / current),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geom::Pose;

    #[test]
    fn accepts_lower_costs_and_waits_for_targets() {
        let verdict = |candidate_cost, sah_cost, approach| {
            let report = FrameReport {
                candidate_cost,
                sah_cost,
                ..FrameReport::default()
            };
            let evaluation = Evaluation {
                ticket: None,
                frame: 0,
                pose: Pose::default(),
                approach,
            };
            Verdict::of(&report, &evaluation)
        };
        let accept = |cost_ratio| Verdict::Accept { cost_ratio };
        for approach in [None, Some(2.0)] {
            for [candidate, current] in [[None, Some(2.0)], [Some(2.0), None], [None; 2]] {
                assert_eq!(verdict(candidate, current, approach), accept(None));
            }
            let cheaper = verdict(Some(1.5), Some(2.0), approach);
            assert_eq!(cheaper, accept(Some(0.75)));
        }
        for costlier in [2.0, 2.1] {
            assert_eq!(verdict(Some(costlier), Some(2.0), None), Verdict::Reject);
            assert_eq!(verdict(Some(costlier), Some(2.0), Some(1.0)), Verdict::Wait);
        }
    }
}
