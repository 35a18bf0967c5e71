//! Measures how a scene moves, which triangles cannot be hit, and how much refits degrade the first tree.

use bvh_build::{BinaryTree, BuildError, Cancel, SahBuilder, sah_cost};
use geom::{Aabb, Animation, KeyFrameError, Moment, Point, Pose, is_active, is_degenerate};
use rayon::prelude::*;
use serde::Serialize;

/// Motion of a scene's vertices.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MotionStats {
    /// Share of the vertices whose position in some key frame differs from that in the first.
    pub moving: f64,
    /// Mean distance that a vertex moves per key frame, divided by the diagonal of the bounds.
    pub mean_step: f64,
    /// Largest distance that a vertex moves from one key frame to the next, divided by the diagonal of the bounds.
    pub max_step: f64,
}

/// Minimum and maximum over all key frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct CountRange {
    /// Minimum.
    pub min: usize,
    /// Maximum.
    pub max: usize,
}

/// Costs of the first tree and of a fresh tree at one time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RefitCosts {
    /// Time in key frames.
    pub time: f64,
    /// Cost of the first tree, refitted.
    pub refitted: f64,
    /// Cost of a tree built for this time.
    pub fresh: f64,
    /// `refitted` divided by `fresh`; `None` if `fresh` is 0.
    pub ratio: Option<f64>,
}

/// Measures the motion. Ignores steps from or to positions that are not finite.
///
/// # Errors
/// A key frame cannot be read.
pub fn motion(animation: &Animation) -> Result<MotionStats, KeyFrameError> {
    let bits = |p: &Point| p.map(f32::to_bits);
    let mut moves = vec![false; animation.vertex_count()];
    let (mut sum, mut max, mut count) = (0.0, 0.0, 0_usize);
    let mut last = animation.key(0)?;
    for key in 1..animation.key_count() {
        animation.look_ahead((key..animation.key_count()).map(|key| key as f64));
        let next = animation.key(key)?;
        let pairs = animation.first().par_iter().zip(&next[..]);
        let each = moves.par_iter_mut().zip(pairs);
        each.for_each(|(moves, (a, b))| *moves |= bits(a) != bits(b));
        let distances = last.iter().zip(&next[..]).map(|(a, b)| distance(a, b));
        let mut steps = 0.0;
        for distance in distances.filter(|distance| distance.is_finite()) {
            steps += distance;
            max = f64::max(max, distance);
            count += 1;
        }
        sum += steps;
        last = next;
    }
    let moving = moves.iter().filter(|&&moves| moves).count();
    let diagonal = animation.bounds().diagonal();
    Ok(MotionStats {
        moving: share(moving as f64, animation.vertex_count() as f64),
        mean_step: share(sum, count as f64 * diagonal),
        max_step: share(max, diagonal),
    })
}

/// Returns the numbers of inactive and of degenerate triangles: minimum and maximum over all key frames.
///
/// # Errors
/// A key frame cannot be read.
pub fn inactive_and_degenerate(animation: &Animation) -> Result<[CountRange; 2], KeyFrameError> {
    let count = |key: usize| -> Result<_, KeyFrameError> {
        let pose = Pose {
            key: key as u32,
            alpha: 0.0,
        };
        Ok(inactive_and_degenerate_at(&animation.moment(pose)?))
    };
    let counts = (0..animation.key_count()).map(count);
    let counts = counts.collect::<Result<Vec<[usize; 2]>, _>>()?;
    Ok([0, 1].map(|i| CountRange {
        min: counts.iter().map(|c| c[i]).min().unwrap_or(0),
        max: counts.iter().map(|c| c[i]).max().unwrap_or(0),
    }))
}

/// Returns the numbers of inactive and of degenerate triangles at a moment.
pub fn inactive_and_degenerate_at(moment: &Moment<'_>) -> [usize; 2] {
    let triangles = (0..moment.animation().triangle_count() as u32).into_par_iter();
    let each = triangles.map(|t| {
        let corners = moment.corners(t);
        let active = is_active(&corners);
        let degenerate = active && is_degenerate(&corners);
        [!active, degenerate].map(usize::from)
    });
    each.reduce(|| [0, 0], |a, b| [a[0] + b[0], a[1] + b[1]])
}

/// Compares the tree of time 0, refitted, with a fresh tree at `samples` times of the animation. If the animation has a
/// single key frame, compares them once.
///
/// # Errors
/// Those of the builder.
pub fn refit_costs(animation: &Animation, samples: usize) -> Result<Vec<RefitCosts>, BuildError> {
    let last = if animation.end() > 0.0 { samples } else { 1 };
    let time = |i| animation.end() * i as f64 / (samples.max(2) - 1) as f64;
    refit_costs_at(animation, (0..last).map(time), 1)
}

/// Compares the first time's tree, refitted, with a fresh tree at each time. Uses every `step`-th triangle.
fn refit_costs_at(
    animation: &Animation,
    times: impl Iterator<Item = f64>,
    step: usize,
) -> Result<Vec<RefitCosts>, BuildError> {
    let (mut builder, cancel) = (SahBuilder::default(), Cancel::new());
    let (mut first, mut tree) = (None, BinaryTree::default());
    let triangles = (0..animation.triangle_count())
        .into_par_iter()
        .step_by(step);
    let mut compare = |time| {
        let moment = animation.at(time)?;
        let boxes = triangles.clone().map(|t| moment.build_box(t as u32));
        let boxes: Vec<Aabb> = boxes.collect();
        builder.build(&boxes[..], &cancel, &mut tree)?;
        let first = first.get_or_insert_with(|| tree.clone());
        let [refitted, fresh] = [&*first, &tree].map(|tree| sah_cost(tree, &boxes[..]));
        Ok(RefitCosts {
            time,
            refitted,
            fresh,
            ratio: (fresh > 0.0).then(|| refitted / fresh),
        })
    };
    times.map(&mut compare).collect()
}

/// Maximum number of triangles that [`RefitDegradation`] samples.
const TRIANGLES: usize = 1 << 13;
/// Number of points in time that [`RefitDegradation`] samples, including both ends of the run.
const MOMENTS: usize = 5;

/// SAH cost of the tree for the earliest frame time, refitted, divided by that of a fresh tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefitDegradation {
    /// Mean over the run.
    pub mean: f64,
    /// Maximum over the run.
    pub worst: f64,
}

impl RefitDegradation {
    /// The first tree stays as good as a fresh one.
    pub const NONE: Self = Self {
        mean: 1.0,
        worst: 1.0,
    };

    /// Samples the time range of frames at `times` (in key frames, in any order). Runs in the rayon
    /// pool that the caller installed.
    ///
    /// # Errors
    /// Those of the builder.
    pub fn sample(animation: &Animation, times: &[f64]) -> Result<Self, BuildError> {
        if times.len() < 2 {
            return Ok(Self::NONE);
        }
        let first = times.iter().copied().fold(f64::INFINITY, f64::min);
        let last = times.iter().copied().fold(first, f64::max);
        let step = animation.triangle_count().div_ceil(TRIANGLES).max(1);
        let time = |i| first + (last - first) * i as f64 / (MOMENTS - 1) as f64;
        let costs = refit_costs_at(animation, (0..MOMENTS).map(time), step)?;
        let ratio = |d: &RefitCosts| d.ratio.filter(|r| r.is_finite()).unwrap_or(1.0);
        let ratios = costs.iter().map(ratio);
        Ok(Self {
            mean: ratios.clone().sum::<f64>() / MOMENTS as f64,
            worst: ratios.fold(1.0, f64::max),
        })
    }
}

/// Returns the distance between two points.
pub(crate) fn distance(a: &Point, b: &Point) -> f64 {
    let squares = (0..3).map(|i| (f64::from(a[i]) - f64::from(b[i])).powi(2));
    squares.sum::<f64>().sqrt()
}

fn share(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree_builder::tests::row;

    #[test]
    fn motion_is_relative_to_the_diagonal() {
        let rest = [[0.0; 3], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [f32::NAN; 3]];
        let mut moved = rest;
        moved[0] = [0.0, 1.0, 0.0];
        let keys = vec![rest.to_vec(), moved.to_vec(), moved.to_vec()];
        let a = Animation::new(keys, vec![[0, 1, 2], [0, 1, 3], [1, 1, 2]]).unwrap();
        let m = motion(&a).unwrap();
        assert_eq!((m.moving, m.max_step), (0.25, 0.2));
        assert!((m.mean_step - 1.0 / 6.0 / 5.0).abs() < 1e-12);
        assert_eq!(
            inactive_and_degenerate(&a).unwrap(),
            [CountRange { min: 1, max: 1 }; 2]
        );
    }

    #[test]
    fn single_point_scene_does_not_move() {
        let a = Animation::new(vec![vec![[1.0; 3]]], vec![]).unwrap();
        assert_eq!(motion(&a).unwrap().max_step, 0.0);
    }

    /// Returns a row of triangles that move to other places.
    fn moved(places: fn(u32) -> u32) -> Animation {
        row(64, 2, |key, i| [i, places(i)][key] as f32)
    }

    fn sample(places: fn(u32) -> u32, times: &[f64]) -> RefitDegradation {
        RefitDegradation::sample(&moved(places), times).unwrap()
    }

    #[test]
    fn shuffling_triangles_degrades_the_first_tree() {
        let shuffled = sample(|i| i * 37 % 64, &[0.0, 0.5, 1.0]);
        assert!(shuffled.worst > 1.5 && shuffled.mean > 1.2, "{shuffled:?}");
        assert!(shuffled.mean < shuffled.worst, "{shuffled:?}");
        let unsorted = sample(|i| i * 37 % 64, &[1.0, 0.0, 1.0]);
        assert_eq!(unsorted, shuffled);
        let costs = refit_costs(&moved(|i| i * 37 % 64), 3).unwrap();
        let ratios: Vec<f64> = costs.iter().map(|d| d.ratio.unwrap()).collect();
        assert_eq!((costs.len(), ratios[0], costs[2].time), (3, 1.0, 1.0));
        assert!(ratios[2] > 1.5, "{ratios:?}");
    }

    #[test]
    fn rigid_motion_does_not_degrade_trees() {
        let times = [0.0, 0.5, 1.0];
        let moved = sample(|i| i + 5, &times);
        assert!(moved.worst < 1.01, "{moved:?}");
        assert_eq!(sample(|i| i, &times), RefitDegradation::NONE);
        assert_eq!(sample(|i| i * 37 % 64, &[1.0]), RefitDegradation::NONE);
        let empty = Animation::new(vec![vec![[1.0; 3]]; 2], vec![]).unwrap();
        assert_eq!(
            RefitDegradation::sample(&empty, &times),
            Ok(RefitDegradation::NONE)
        );
    }
}
