//! Statistics of triangles and boxes that stay valid from one submission to the next.

use crate::Counts;
use backend::{FrameReport, sah_cost};

/// The stages that ran in one submission.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extents {
    /// Number of zero-area triangles that the last preprocess skipped and did not count; `None` if no preprocess ran.
    pub uncounted: Option<u32>,
    /// Whether a refit or a build summed the areas of boxes.
    pub boxes: bool,
    /// Whether a candidate tree was evaluated next to the current one.
    pub candidate: bool,
}

/// Statistics that stay valid until a stage runs again.
#[derive(Clone, Copy, Debug, Default)]
pub struct TreeStats {
    inactive: u64,
    degenerate: u64,
    sah_cost: Option<f64>,
}

impl TreeStats {
    /// Updates the statistics from the counts of a submission and completes its report. Submissions come in order.
    /// `never_active` is the number of triangles that are inactive in every key frame and therefore in no tree.
    pub fn complete(
        &mut self,
        report: &mut FrameReport,
        (counts, extents): (&Counts, Extents),
        never_active: u64,
    ) {
        if let Some(uncounted) = extents.uncounted {
            self.inactive = u64::from(counts.inactive) + never_active;
            self.degenerate = u64::from(counts.degenerate) + u64::from(uncounted);
        }
        // The root's area is not among the others.
        let root = f64::from(counts.root_area);
        let cost = |areas: f32| sah_cost(f64::from(areas) + root, root);
        if extents.boxes {
            self.sah_cost = cost(counts.areas);
        }
        if extents.candidate {
            report.candidate_cost = cost(counts.candidate_areas);
        }
        report.inactive = self.inactive;
        report.degenerate = self.degenerate;
        report.sah_cost = self.sah_cost;
    }
}
