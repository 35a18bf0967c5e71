//! Trees out of turn: one for the whole of an animation, and those that only find memory for others.
//!
//! The moments that stand for all of an animation lie closer where more moves: at equal shares of a measure that is
//! half the time and half the way that vertices go. Each stands for the time nearer to it than to another, so the mean
//! over them is a mean over time.

use super::{BuildStrategy, Built, Moments, TreeBuilder, Vertices};
use crate::motion::distance;
use bvh_build::{
    BinaryTree, BuildError, Cancel, MAX_MOMENTS, TemporalBuilder, order_toward, sah_cost,
    temporal_cost,
};
use geom::{Animation, KeyFrameError, Moment, Pose};
use std::time::Instant;

/// How often a warm-up makes the next tree: once to find memory, once more to write to what conversion gives back.
const ROUNDS: usize = 2;

impl TreeBuilder {
    /// Builds and converts one tree for all of `moments`, with `first` for its own cost.
    pub(crate) fn build_for_all(
        &mut self,
        animation: &Animation,
        moments: &[Sample<'_>],
        first: Pose,
        cancel: &Cancel,
    ) -> Result<Built, BuildError> {
        let begun = Instant::now();
        let boxes = animation.moment(first)?;
        self.builder.build(&boxes, cancel, &mut self.tree)?;
        let cost = sah_cost(&self.tree, &boxes);
        if moments.len() > 1 {
            let mut for_all = BinaryTree::default();
            TemporalBuilder::default().build(moments, cancel, &mut for_all)?;
            if temporal_cost(&for_all, moments) < temporal_cost(&self.tree, moments) {
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
            let vertices = Vertices::KeyFrames(pose);
            self.rebuild_subtrees_at(&Moments::of(animation), &vertices, cancel)?;
            let record = self.convert(animation);
            self.reuse(record.into_spare());
        }
        Ok(())
    }
}

/// A moment, and the time it stands for in key frames.
pub(crate) type Sample<'a> = bvh_build::Moment<Moment<'a>>;

/// Steps in which the way is measured: two a key frame, within these bounds.
const STEPS: [usize; 2] = [64, 512];
/// Vertices whose way is measured, evenly taken from all.
const VERTICES: usize = 1024;

/// Moments that stand for `range`, in key frames; one if nothing moves.
pub(crate) fn samples(
    animation: &Animation,
    range: [f64; 2],
) -> Result<Vec<Sample<'_>>, KeyFrameError> {
    let [first, last] = range.map(|t| t.clamp(0.0, animation.end()));
    let steps = (2.0 * (last - first)) as usize;
    let steps = steps.clamp(STEPS[0], STEPS[1]);
    let at = |i: usize| first + (last - first) * i as f64 / steps as f64;
    let way: Vec<f64> = (0..steps)
        .map(|i| [at(i), at(i + 1)].map(|t| animation.pose(t)))
        .map(|[a, b]| way(animation, a, b))
        .collect::<Result<_, _>>()?;
    let whole: f64 = way.iter().sum();
    if whole <= 0.0 {
        let (boxes, weight) = (animation.at(first)?, 1.0);
        return Ok(vec![Sample { boxes, weight }]);
    }
    let measure = |i: usize| 0.5 * way[i] / whole + 0.5 / steps as f64;
    let mut times = vec![first];
    let mut passed = 0.0;
    for i in 0..steps {
        let share = measure(i);
        while times.len() + 1 < MAX_MOMENTS {
            let due = times.len() as f64 / (MAX_MOMENTS - 1) as f64 - passed;
            if due >= share {
                break;
            }
            times.push(at(i) + (at(i + 1) - at(i)) * due / share);
        }
        passed += share;
    }
    times.push(last);
    weighed(animation, &times)
}

/// Each time with half the stretches before and after it.
fn weighed<'a>(animation: &'a Animation, times: &[f64]) -> Result<Vec<Sample<'a>>, KeyFrameError> {
    let last = times.len() - 1;
    let weight = |i: usize| 0.5 * (times[(i + 1).min(last)] - times[i.saturating_sub(1)]);
    let sample = |(i, &time): (usize, &f64)| {
        let (boxes, weight) = (animation.at(time)?, weight(i));
        Ok(Sample { boxes, weight })
    };
    times.iter().enumerate().map(sample).collect()
}

/// How far some vertices go from one pose to another, together. What is not finite does not count.
fn way(animation: &Animation, a: Pose, b: Pose) -> Result<f64, KeyFrameError> {
    let (from, to) = (animation.moment(a)?, animation.moment(b)?);
    let n = animation.vertex_count();
    let some = (0..n as u32).step_by(n.div_ceil(VERTICES).max(1));
    let ways = some.map(|v| distance(&from.vertex(v), &to.vertex(v)));
    Ok(ways.filter(|d| d.is_finite()).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One triangle whose third corner stands at these heights.
    fn bobbing(heights: &[f32]) -> Animation {
        let key = |&y: &f32| vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, y, 0.0]];
        Animation::new(heights.iter().map(key).collect(), vec![[0, 1, 2]]).unwrap()
    }

    fn times(samples: &[Sample<'_>]) -> Vec<f64> {
        let poses = samples.iter().map(|s| s.boxes.pose());
        poses
            .map(|p| f64::from(p.key) + f64::from(p.alpha))
            .collect()
    }

    #[test]
    fn what_stands_still_needs_one_moment() {
        let at_rest = bobbing(&[1.0; 5]);
        let still = samples(&at_rest, [1.0, 3.0]).unwrap();
        assert_eq!((still.len(), times(&still)), (1, vec![1.0]));
        assert_eq!(samples(&bobbing(&[1.0, 2.0]), [0.5; 2]).unwrap().len(), 1);
    }

    #[test]
    fn steady_motion_is_sampled_evenly_and_the_weights_make_up_the_time() {
        let rising = bobbing(&[0.0, 1.0, 2.0, 3.0]);
        let s = samples(&rising, [0.5, 2.5]).unwrap();
        let expected = (0..MAX_MOMENTS).map(|i| 0.5 + 2.0 * i as f64 / (MAX_MOMENTS - 1) as f64);
        for (found, expected) in times(&s).iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{s:?}");
        }
        let sum: f64 = s.iter().map(|s| s.weight).sum();
        assert!((sum - 2.0).abs() < 1e-9 && s.len() == MAX_MOMENTS);
    }

    #[test]
    fn more_moments_lie_where_more_moves_and_stand_for_less() {
        let leaping = bobbing(&[0.0, 0.0, 0.0, 0.0, 9.0]);
        let s = samples(&leaping, [0.0, 4.0]).unwrap();
        let late = times(&s).iter().filter(|&&t| t > 3.0).count();
        assert!(late >= MAX_MOMENTS / 2, "{s:?}");
        assert!(s[MAX_MOMENTS - 1].weight < s[1].weight);
        assert!(times(&s).is_sorted() && times(&s)[MAX_MOMENTS - 1] == 4.0);
    }
}
