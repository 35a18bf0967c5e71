//! Statistics of triangles and boxes that stay valid from one submission to the next.

use crate::Counts;
use backend::{FrameReport, sah_cost};

/// The nodes whose areas a refit summed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Extent {
    /// Moving nodes only. The areas of the others were summed before.
    Moving,
    /// All nodes.
    Whole,
}

/// The extents of preprocess and refit in one submission. `None` for a stage that did not run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extents {
    /// Number of zero-area triangles that the last preprocess skipped and did not count.
    pub uncounted: Option<u32>,
    /// The largest extent among the refits.
    pub boxes: Option<Extent>,
    /// Whether a candidate tree was evaluated next to the current one.
    pub candidate: bool,
}

/// Statistics that stay valid until a stage runs again.
#[derive(Clone, Copy, Debug, Default)]
pub struct TreeStats {
    inactive: u64,
    degenerate: u64,
    /// Half areas that only change with the tree.
    still_areas: f64,
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
        if let Some(boxes) = extents.boxes {
            if boxes == Extent::Whole {
                self.still_areas = f64::from(counts.areas);
            }
            let areas = self.still_areas + f64::from(counts.moving_areas);
            // The root's area is not among the others.
            let root = f64::from(counts.root_area);
            self.sah_cost = sah_cost(areas + root, root);
        }
        if extents.candidate {
            let root = f64::from(counts.root_area);
            let areas = [counts.candidate_areas, counts.candidate_moving_areas];
            let areas: f64 = areas.into_iter().map(f64::from).sum();
            report.candidate_cost = sah_cost(areas + root, root);
        }
        report.inactive = self.inactive;
        report.degenerate = self.degenerate;
        report.sah_cost = self.sah_cost;
    }
}
