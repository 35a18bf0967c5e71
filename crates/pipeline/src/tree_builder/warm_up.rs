//! Warms the builder up: builds trees that are dropped, so that later builds find their memory allocated.

use super::{BuildStrategy, PoseSource, TreeBuilder, Vertices};
use backend::TreeFormat;
use bvh_build::{BuildError, Cancel};
use geom::{Animation, Pose};

/// Number of builds in a warm-up. One is not enough: the second also takes longer than later ones. See
/// [`TreeBuilder::warm_up`].
const ROUNDS: usize = 2;

impl TreeBuilder {
    /// If the next tree will be built from subtrees, and the format is not [`TreeFormat::WideBlocks`], builds and drops
    /// such trees, to allocate memory. In demo:shatter (1.6M triangles) the first such tree took 120 ms, the second 43,
    /// later ones 20.
    pub(crate) fn warm_up(
        &mut self,
        animation: &Animation,
        pose: Pose,
        cancel: &Cancel,
    ) -> Result<(), BuildError> {
        let uses_subtrees = self.degradation.strategy() == BuildStrategy::Subtrees
            && self.format != TreeFormat::WideBlocks;
        if !uses_subtrees || !self.has_all_triangles_of(animation) {
            return Ok(());
        }
        let vertices = Vertices::AtPose(pose);
        let source = PoseSource {
            animation,
            frames: None,
        };
        for _ in 0..ROUNDS {
            self.rebuild_subtrees_at(&source, &vertices, cancel)?;
            let topology = self.convert(animation);
            self.reuse(topology.into_spare());
        }
        Ok(())
    }
}
