//! One tree for the whole of an animation.

use super::{BuildStrategy, Built, TreeBuilder};
use crate::sampling::Sample;
use bvh_build::{
    BinaryTree, BuildError, Cancel, Moment, TemporalBuilder, order_toward, sah_cost, temporal_cost,
};
use geom::{Animation, Pose};
use std::time::Instant;

impl TreeBuilder {
    /// Builds and converts one tree for all of `samples`, with `first` for its own cost.
    ///
    /// # Errors
    /// [`BuildError::Cancelled`].
    pub(crate) fn build_for_all(
        &mut self,
        animation: &Animation,
        samples: &[Sample],
        first: Pose,
        cancel: &Cancel,
    ) -> Result<Built, BuildError> {
        let begun = Instant::now();
        let boxes = (animation, first);
        self.builder.build(&boxes, cancel, &mut self.tree)?;
        let cost = sah_cost(&self.tree, &boxes);
        let moments: Vec<_> = samples
            .iter()
            .map(|s| Moment {
                boxes: (animation, s.pose),
                weight: s.weight,
            })
            .collect();
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
}
