//! How the first tree decays under refitting: the reason to rebuild.

use bvh_build::{BinaryTree, BuildError, Builder, Cancel, sah_cost};
use geom::{Animation, Point};
use serde::Serialize;

/// The first tree at another time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Decay {
    /// The time, in key frames.
    pub(crate) time: f64,
    /// Its refitted cost.
    pub(crate) refitted: f64,
    /// The cost of a tree built there.
    pub(crate) fresh: f64,
    /// One over the other; `None` where there is no cost.
    pub(crate) ratio: Option<f64>,
}

/// Compares the tree of time 0, refitted, with a fresh one at `samples` times over the motion.
pub(crate) fn measure(animation: &Animation, samples: usize) -> Result<Vec<Decay>, BuildError> {
    let mut builder = Builder::new();
    let cancel = Cancel::new();
    let mut first = BinaryTree::default();
    builder.build(&(animation, &animation.keys()[0][..]), &cancel, &mut first)?;
    let mut fresh = BinaryTree::default();
    let last = if animation.end() > 0.0 { samples } else { 1 };
    (0..last)
        .map(|i| {
            let time = animation.end() * i as f64 / (samples.max(2) - 1) as f64;
            let positions = positions(animation, time);
            let boxes = (animation, &positions[..]);
            builder.build(&boxes, &cancel, &mut fresh)?;
            let (refitted, fresh) = (sah_cost(&first, &boxes), sah_cost(&fresh, &boxes));
            Ok(Decay {
                time,
                refitted,
                fresh,
                ratio: (fresh > 0.0).then(|| refitted / fresh),
            })
        })
        .collect()
}

fn positions(animation: &Animation, time: f64) -> Vec<Point> {
    let pose = animation.pose(time);
    let vertices = 0..animation.vertex_count() as u32;
    vertices.map(|v| animation.vertex(pose, v)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_that_is_shuffled_makes_the_first_tree_worse() {
        let row = |place: fn(u32) -> u32| -> Vec<Point> {
            (0..64)
                .flat_map(|i| {
                    let x = place(i) as f32;
                    [[x, 0.0, 0.0], [x + 0.5, 0.0, 0.0], [x, 0.5, 0.5]]
                })
                .collect()
        };
        let triangles = (0..64).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let keys = vec![row(|i| i), row(|i| i * 37 % 64)];
        let animation = Animation::new(keys, triangles).unwrap();
        let decay = measure(&animation, 3).unwrap();
        let ratios: Vec<f64> = decay.iter().map(|d| d.ratio.unwrap()).collect();
        assert_eq!((decay.len(), ratios[0]), (3, 1.0));
        assert!(ratios[2] > 1.5, "{ratios:?}");
        assert_eq!(decay[2].time, 1.0);
    }
}
