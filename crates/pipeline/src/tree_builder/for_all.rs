//! Trees out of turn: one for the whole of an animation, and those that only find memory for others.

use super::{BuildStrategy, Built, TreeBuilder, Vertices};
use crate::sampling::Sample;
use bvh_build::{
    BinaryTree, BuildError, Cancel, Moment, TemporalBuilder, order_toward, sah_cost, temporal_cost,
};
use geom::{Animation, Pose};
use std::time::Instant;

/// How often a warm-up makes the next tree: once to find memory, once more to write to what conversion gives back.
const ROUNDS: usize = 2;

impl TreeBuilder {
    /// Builds and converts one tree for all of `samples`, with `first` for its own cost.
    pub(crate) fn build_for_all(
        &mut self,
        animation: &Animation,
        samples: &[Sample],
        first: Pose,
        cancel: &Cancel,
    ) -> Result<Built, BuildError> {
        let begun = Instant::now();
        let boxes = animation.moment(first)?;
        self.builder.build(&boxes, cancel, &mut self.tree)?;
        let cost = sah_cost(&self.tree, &boxes);
        let moment = |s: &Sample| {
            Ok(Moment {
                boxes: animation.moment(s.pose)?,
                weight: s.weight,
            })
        };
        let moments = samples.iter().map(moment);
        let moments = moments.collect::<Result<Vec<_>, BuildError>>()?;
        if moments.len() > 1 {
            let mut for_all = BinaryTree::default();
            TemporalBuilder::new().build(&moments, cancel, &mut for_all)?;
            if temporal_cost(&for_all, &moments) < temporal_cost(&self.tree, &moments) {
                self.tree = for_all;
                if let Some(point) = self.builder.toward {
                    order_toward(&mut self.tree, &boxes, point);
                }
            }
        }
        let built = Instant::now();
        Ok(self.send(animation, [begun, built], cost, BuildStrategy::Scratch))
    }

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
            self.rebuild_subtrees_at(animation, Vertices::KeyFrames(pose), cancel)?;
            let record = self.convert(animation);
            self.reuse(record.into_spare());
        }
        Ok(())
    }
}
