//! Statistics of triangles and boxes that stay valid from one submission to the next.

use crate::Counts;
use backend::FrameReport;

/// The stages that ran in one submission.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TreeStages {
    /// Number of zero-area triangles that the last preprocess skipped and did not count; `None` if no preprocess ran.
    pub skipped_degenerate: Option<u32>,
    /// Whether a refit or a build summed the areas of boxes.
    pub summed_areas: bool,
    /// Whether a candidate tree was evaluated next to the current one.
    pub evaluated_candidate: bool,
}

/// Statistics that stay valid until a stage runs again.
#[derive(Clone, Copy, Debug, Default)]
pub struct TreeCounts {
    inactive: u64,
    degenerate: u64,
    sah_cost: Option<f64>,
}

impl TreeCounts {
    /// Updates the statistics from the counts of a submission. Must be called in the order of submissions. `never_active`
    /// is the number of triangles that are inactive in every key frame and therefore in no tree.
    pub fn update(&mut self, counts: &Counts, tree_stages: TreeStages, never_active: u64) {
        if let Some(skipped_degenerate) = tree_stages.skipped_degenerate {
            self.inactive = u64::from(counts.inactive) + never_active;
            self.degenerate = u64::from(counts.degenerate) + u64::from(skipped_degenerate);
        }
        if tree_stages.summed_areas {
            self.sah_cost = counts.cost(counts.areas);
        }
    }

    /// Completes the report of the last submission.
    pub fn complete(&self, report: &mut FrameReport) {
        report.inactive = self.inactive;
        report.degenerate = self.degenerate;
        report.sah_cost = self.sah_cost;
    }
}
