//! What is known of records and boxes in use, from one submission's report to the next.

use crate::Counts;
use backend::FrameReport;
use geom::Animation;

/// What a stage of a submission went over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// All of the tree.
    Whole,
    /// What moves alone: the rest had been done before.
    Moving,
}

/// What preprocess and refit of one submission went over; `None` for a stage left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extents {
    /// Leaves, by the last preprocess.
    pub leaves: Option<Extent>,
    /// Boxes, by any refit: whole if one of them was.
    pub boxes: Option<Extent>,
}

impl Extents {
    /// Another refit was recorded.
    pub fn refitted(&mut self, extent: Extent) {
        if self.boxes != Some(Extent::Whole) {
            self.boxes = Some(extent);
        }
    }
}

/// Triangles of a scene that no kernel counts in some frames, or in any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Uncounted {
    /// Inactive in every key frame, and so in no tree.
    pub never_active: u64,
    /// Of zero area, active and static: not counted where only what moves is preprocessed.
    pub static_degenerate: u64,
}

impl Uncounted {
    /// Of a scene.
    #[must_use]
    pub fn of(animation: &Animation) -> Self {
        Self {
            never_active: (animation.triangle_count() - animation.live_count()) as u64,
            static_degenerate: animation.static_parts().degenerate as u64,
        }
    }
}

/// What holds until a stage runs again.
#[derive(Clone, Copy, Debug, Default)]
pub struct Standing {
    inactive: u64,
    degenerate: u64,
    /// Half areas that change with the tree alone.
    still_areas: f64,
    sah_cost: Option<f64>,
}

impl Standing {
    /// Takes in what a submission counted and completes its report. Submissions come in order.
    pub fn complete(
        &mut self,
        report: &mut FrameReport,
        (counts, extents): (&Counts, Extents),
        beside: Uncounted,
    ) {
        if let Some(leaves) = extents.leaves {
            self.inactive = u64::from(counts.inactive) + beside.never_active;
            self.degenerate = u64::from(counts.degenerate);
            if leaves == Extent::Moving {
                self.degenerate += beside.static_degenerate;
            }
        }
        if let Some(boxes) = extents.boxes {
            if boxes == Extent::Whole {
                self.still_areas = f64::from(counts.areas);
            }
            let areas = self.still_areas + f64::from(counts.moving_areas);
            self.sah_cost = cost(areas, f64::from(counts.root_area));
        }
        report.inactive = self.inactive;
        report.degenerate = self.degenerate;
        report.sah_cost = self.sah_cost;
    }
}

/// A tree's cost by the surface area heuristic (traversal 1, intersection 1):
/// all nodes' areas over the root's. `None` if the root has no area.
fn cost(areas: f64, root: f64) -> Option<f64> {
    (root > 0.0).then(|| (areas + root) / root)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(degenerate: u32, [areas, moving_areas, root_area]: [f32; 3]) -> Counts {
        Counts {
            inactive: 1,
            degenerate,
            areas,
            moving_areas,
            root_area,
            ..Counts::default()
        }
    }

    #[test]
    fn what_lies_still_is_added_to_what_moves() {
        let beside = Uncounted {
            never_active: 10,
            static_degenerate: 5,
        };
        let mut standing = Standing::default();
        let mut told = |counts: &Counts, leaves, boxes| {
            let mut report = FrameReport::default();
            let extents = Extents { leaves, boxes };
            standing.complete(&mut report, (counts, extents), beside);
            (report.inactive, report.degenerate, report.sah_cost)
        };
        let (whole, moving) = (Some(Extent::Whole), Some(Extent::Moving));
        let first = counts(7, [6.0, 2.0, 2.0]);
        assert_eq!(told(&first, whole, whole), (11, 7, Some(5.0)));
        let later = counts(2, [0.0, 4.0, 2.0]);
        assert_eq!(told(&later, moving, moving), (11, 7, Some(6.0)));
        assert_eq!(told(&counts(0, [0.0; 3]), None, None), (11, 7, Some(6.0)));
        assert_eq!(told(&counts(1, [0.0; 3]), moving, None), (11, 6, Some(6.0)));
        let gone = counts(0, [0.0; 3]);
        assert_eq!(told(&gone, whole, whole), (11, 0, None));
    }

    #[test]
    fn a_cost_counts_the_root_and_needs_one() {
        assert_eq!(cost(6.0, 2.0), Some(4.0));
        assert_eq!(cost(0.0, 2.0), Some(1.0));
        assert_eq!(cost(0.0, 0.0), None);
    }

    #[test]
    fn a_submission_with_a_whole_refit_has_a_whole_one() {
        let mut extents = Extents::default();
        extents.refitted(Extent::Moving);
        assert_eq!(extents.boxes, Some(Extent::Moving));
        extents.refitted(Extent::Whole);
        extents.refitted(Extent::Moving);
        assert_eq!(extents.boxes, Some(Extent::Whole));
    }
}
