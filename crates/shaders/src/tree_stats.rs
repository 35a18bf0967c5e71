//! What is known of records and boxes in use, from one submission's report to the next.

use crate::Counts;
use backend::{FrameReport, sah_cost};

/// Whose areas a refit added up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Extent {
    /// Those of what moves alone: the others had been added up before.
    Moving,
    /// All nodes'.
    Whole,
}

/// What preprocess and refit of one submission went over; `None` for a stage left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extents {
    /// Triangles of zero area that the last preprocess did not count, as it passed over them.
    pub uncounted: Option<u32>,
    /// Boxes, by any refit: the most that one of them went over.
    pub boxes: Option<Extent>,
    /// Whether a tree was evaluated beside the current one.
    pub candidate: bool,
}

/// What holds until a stage runs again.
#[derive(Clone, Copy, Debug, Default)]
pub struct TreeStats {
    inactive: u64,
    degenerate: u64,
    /// Half areas that change with the tree alone.
    still_areas: f64,
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
