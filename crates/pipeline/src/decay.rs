//! How fast a tree that is only refitted loses to a fresh one, from a sample of a scene's triangles.

use bvh_build::{BinaryTree, Boxes, BuildError, Builder, Cancel, sah_cost};
use geom::{Aabb, Animation, Moment};

/// Triangles looked at, evenly taken from all.
const TRIANGLES: usize = 1 << 13;
/// Moments of the run, both ends included.
const MOMENTS: usize = 5;

/// SAH cost of the first frame's tree, refitted, over that of a fresh tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefitDecay {
    /// The mean over the run.
    pub mean: f64,
    /// The largest.
    pub worst: f64,
}

impl RefitDecay {
    /// Of a tree that stays as good as a fresh one.
    pub const NONE: Self = Self {
        mean: 1.0,
        worst: 1.0,
    };

    /// Samples a run of frames at `times`, in key frames. Runs in the rayon pool that the caller installed.
    ///
    /// # Errors
    /// The builder's.
    pub fn sample(animation: &Animation, times: &[f64]) -> Result<Self, BuildError> {
        let [first, .., last] = *times else {
            return Ok(Self::NONE);
        };
        let all = animation.triangle_count();
        let sample: Vec<u32> = (0..all as u32)
            .step_by(all.div_ceil(TRIANGLES).max(1))
            .collect();
        let at = |i: usize| -> Result<_, BuildError> {
            Ok(Sample {
                moment: animation.at(first + (last - first) * i as f64 / (MOMENTS - 1) as f64)?,
                triangles: &sample,
            })
        };
        let (mut builder, cancel) = (Builder::new(), Cancel::new());
        let [mut kept, mut fresh] = [BinaryTree::default(), BinaryTree::default()];
        builder.build(&at(0)?, &cancel, &mut kept)?;
        let mut ratios = [1.0; MOMENTS];
        for (i, ratio) in ratios.iter_mut().enumerate().skip(1) {
            let moment = at(i)?;
            builder.build(&moment, &cancel, &mut fresh)?;
            let [kept, fresh] = [&kept, &fresh].map(|tree| sah_cost(tree, &moment));
            if fresh > 0.0 && (kept / fresh).is_finite() {
                *ratio = kept / fresh;
            }
        }
        Ok(Self {
            mean: ratios.iter().sum::<f64>() / MOMENTS as f64,
            worst: ratios.into_iter().fold(1.0, f64::max),
        })
    }
}

/// Some triangles at a pose.
struct Sample<'a> {
    moment: Moment<'a>,
    triangles: &'a [u32],
}

impl Boxes for Sample<'_> {
    fn len(&self) -> usize {
        self.triangles.len()
    }

    fn get(&self, i: u32) -> Aabb {
        self.moment.build_box(self.triangles[i as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree_builder::tests::row;

    /// Of a row of 64 that later stands in other places.
    fn sample(places: fn(u32) -> u32, times: &[f64]) -> RefitDecay {
        let animation = row(64, &[&|i| i as f32, &|i| places(i) as f32]);
        RefitDecay::sample(&animation, times).unwrap()
    }

    #[test]
    fn a_row_that_is_shuffled_makes_the_first_tree_worse() {
        let shuffled = sample(|i| i * 37 % 64, &[0.0, 0.5, 1.0]);
        assert!(shuffled.worst > 1.5 && shuffled.mean > 1.2, "{shuffled:?}");
        assert!(shuffled.mean < shuffled.worst, "{shuffled:?}");
    }

    #[test]
    fn nothing_decays_that_moves_as_a_whole_or_in_one_frame_or_without_triangles() {
        let times = [0.0, 0.5, 1.0];
        let moved = sample(|i| i + 5, &times);
        assert!(moved.worst < 1.01, "{moved:?}");
        assert_eq!(sample(|i| i, &times), RefitDecay::NONE);
        assert_eq!(sample(|i| i * 37 % 64, &[1.0]), RefitDecay::NONE);
        let empty = Animation::new(vec![vec![[1.0; 3]]; 2], vec![]).unwrap();
        assert_eq!(RefitDecay::sample(&empty, &times), Ok(RefitDecay::NONE));
    }
}
