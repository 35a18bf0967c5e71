//! A frame between its submission and its end.

use crate::frame::{Adopted, Frame, FrameMoments, FrameRecord, Submission, add_fetched};
use backend::{FrameReport, Generation, Ticket};
use std::time::{Duration, Instant};

/// What happens to trees while a frame begins.
#[derive(Debug, Default)]
pub(super) struct Beginning {
    /// The tree asked for.
    pub(super) asked: Option<Generation>,
    /// The tree swapped to.
    pub(super) adopted: Option<Adopted>,
    /// The finished tree that was no better than the one in use.
    pub(super) rejected: Option<Generation>,
    /// Whether the backend makes a tree within the frame.
    pub(super) made: bool,
    /// What the submission that fetched vertices for the frame's own tree did.
    pub(super) fetched: Option<(Submission, FrameReport)>,
    /// How long the driver was blocked until a tree was built.
    pub(super) build_wait: Duration,
}

/// A frame submitted and not finished.
#[derive(Debug)]
pub(super) struct Pending {
    pub(super) ticket: Ticket,
    pub(super) frame: Frame,
    pub(super) begun: Instant,
    pub(super) handed_in: Instant,
    pub(super) submitted: Instant,
    pub(super) tree_generation: Generation,
    pub(super) tree_age_frames: u64,
    /// What the refitted cost is to be divided by; `None` if the tree is fresh.
    pub(super) cost_before: Option<f64>,
    pub(super) beginning: Beginning,
}

impl Pending {
    /// The frame's record, after the driver waited, saw its end and read its hits.
    pub(super) fn done(
        self,
        mut report: FrameReport,
        [waited, seen, read]: [Instant; 3],
    ) -> FrameRecord {
        let traced = Submission {
            handed_in: self.handed_in,
            seen,
            times: report.times,
        };
        let (fetched, by_fetch) = self.beginning.fetched.unzip();
        if let Some(by_fetch) = &by_fetch {
            add_fetched(&mut report, by_fetch);
        }
        let sah_ratio = report.sah_cost.map(|now| {
            let before = self.cost_before.filter(|&c| c > 0.0);
            before.map_or(1.0, |before| now / before)
        });
        FrameRecord {
            frame: self.frame,
            report,
            wall_ms: ms((self.submitted - self.begun) + (seen - waited)),
            build_wait_ms: ms(self.beginning.build_wait),
            tree_generation: self.tree_generation,
            tree_age_frames: self.tree_age_frames,
            asked: self.beginning.asked,
            adopted: self.beginning.adopted,
            made: self.beginning.made,
            rejected: self.beginning.rejected,
            sah_ratio,
            device_bytes: None,
            moments: FrameMoments {
                begun: self.begun,
                submitted: self.submitted,
                waited,
                seen,
                read,
            },
            fetched,
            traced,
        }
    }
}

fn ms(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}
