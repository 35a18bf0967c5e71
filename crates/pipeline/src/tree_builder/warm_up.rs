//! Warms the builder up: makes trees that nobody uses, so that later ones find their memory.

use super::{BuildStrategy, Moments, TreeBuilder, Vertices};
use bvh_build::{BuildError, Cancel};
use geom::{Animation, Pose};

/// How often a warm-up makes the next tree: once to find memory, once more to write to what conversion gives back.
const ROUNDS: usize = 2;

impl TreeBuilder {
    /// Makes the next tree, if it will be one of groups, to no end but to find memory for it: in demo:shatter (1.6M
    /// triangles) the first such tree took 120 ms, the second 43, later ones 20. Nothing is handed over.
    pub(crate) fn warm_up(
        &mut self,
        animation: &Animation,
        pose: Pose,
        cancel: &Cancel,
    ) -> Result<(), BuildError> {
        let groups = self.degradation.strategy() == BuildStrategy::Subtrees && !self.forms.blocks;
        if !groups || !self.holds_all_of(animation) {
            return Ok(());
        }
        for _ in 0..ROUNDS {
            let vertices = Vertices::KeyFrames(pose);
            self.rebuild_subtrees_at(&Moments::of(animation), &vertices, cancel)?;
            let record = self.convert(animation);
            self.reuse(record.into_spare());
        }
        Ok(())
    }
}
