//! How fast a tree that is only refitted loses to a fresh one, from a sample of a scene's triangles.

use bvh_build::{BinaryTree, Boxes, BuildError, Builder, Cancel, sah_cost};
use geom::{Aabb, Animation, Pose};

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
        let at = |i: usize| Sample {
            animation,
            triangles: &sample,
            pose: animation.pose(first + (last - first) * i as f64 / (MOMENTS - 1) as f64),
        };
        let (mut builder, cancel) = (Builder::new(), Cancel::new());
        let [mut kept, mut fresh] = [BinaryTree::default(), BinaryTree::default()];
        builder.build(&at(0), &cancel, &mut kept)?;
        let mut ratios = [1.0; MOMENTS];
        for (i, ratio) in ratios.iter_mut().enumerate().skip(1) {
            let moment = at(i);
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
    animation: &'a Animation,
    triangles: &'a [u32],
    pose: Pose,
}

impl Boxes for Sample<'_> {
    fn len(&self) -> usize {
        self.triangles.len()
    }

    fn get(&self, i: u32) -> Aabb {
        self.animation
            .build_box_at(self.pose, self.triangles[i as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geom::Point;

    /// Triangles in a row, which in the second key frame stand elsewhere.
    fn row(place: fn(u32) -> u32) -> Animation {
        let key = |place: fn(u32) -> u32| -> Vec<Point> {
            let corners = |x: f32| [[x, 0.0, 0.0], [x + 0.5, 0.0, 0.0], [x, 0.5, 0.5]];
            (0..64).flat_map(|i| corners(place(i) as f32)).collect()
        };
        let triangles = (0..64).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Animation::new(vec![key(|i| i), key(place)], triangles).unwrap()
    }

    fn sample(animation: &Animation) -> RefitDecay {
        RefitDecay::sample(animation, &[0.0, 0.5, 1.0]).unwrap()
    }

    #[test]
    fn a_row_that_is_shuffled_makes_the_first_tree_worse() {
        let shuffled = sample(&row(|i| i * 37 % 64));
        assert!(shuffled.worst > 1.5 && shuffled.mean > 1.2, "{shuffled:?}");
        assert!(shuffled.mean < shuffled.worst, "{shuffled:?}");
    }

    #[test]
    fn a_row_that_moves_as_a_whole_keeps_its_tree() {
        let moved = sample(&row(|i| i + 5));
        assert!(moved.worst < 1.01, "{moved:?}");
        assert_eq!(sample(&row(|i| i)), RefitDecay::NONE);
    }

    #[test]
    fn nothing_decays_in_one_frame_or_without_triangles() {
        let empty = Animation::new(vec![vec![[1.0; 3]]; 2], vec![]).unwrap();
        assert_eq!(sample(&empty), RefitDecay::NONE);
        let one = RefitDecay::sample(&row(|i| i * 37 % 64), &[1.0]).unwrap();
        assert_eq!(one, RefitDecay::NONE);
    }
}
