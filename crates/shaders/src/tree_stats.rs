//! What is known of records and boxes in use, from one submission's report to the next.

use crate::Counts;
use backend::{FrameReport, sah_cost};

/// Which of preprocess and refit one submission had.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extents {
    /// Triangles of zero area that the last preprocess did not count, as it passed over them; `None` if there was none.
    pub uncounted: Option<u32>,
    /// Whether there was a refit.
    pub boxes: bool,
}

/// What holds until a stage runs again.
#[derive(Clone, Copy, Debug, Default)]
pub struct TreeStats {
    inactive: u64,
    degenerate: u64,
    sah_cost: Option<f64>,
}

impl TreeStats {
    /// Takes in what a submission counted and completes its report. Submissions come in order.
    /// `never_active` triangles of the scene are in no tree, as they are inactive in every key frame.
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
        if extents.boxes {
            // The root's area is not among the others.
            let root = f64::from(counts.root_area);
            self.sah_cost = sah_cost(f64::from(counts.areas) + root, root);
        }
        report.inactive = self.inactive;
        report.degenerate = self.degenerate;
        report.sah_cost = self.sah_cost;
    }
}
