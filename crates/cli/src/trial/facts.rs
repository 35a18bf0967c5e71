//! What a brief look at a scene says of its motion: a sample of its triangles at a few moments of the run.

use super::Run;
use crate::stop::Stop;
use bvh_build::{BinaryTree, Boxes, Builder, Cancel, sah_cost};
use geom::{Aabb, Animation, Point, Pose, is_active, is_degenerate};
use report::Summary;
use std::fmt;

/// Triangles looked at, evenly taken from all.
const TRIANGLES: usize = 1 << 14;
/// Moments of the run, both ends included.
const MOMENTS: usize = 5;
/// A tree is as good as a fresh one up to so many times its cost.
const GOOD: f64 = 1.05;

/// What the look found. Shares are of the sample, ways and places in diagonals of its bounds.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Facts {
    /// Share of all triangles that move.
    moving: f64,
    /// Mean way of a corner from a frame to the next.
    step: f64,
    /// Cost of the first frame's tree, refitted, over that of a fresh one, at each later moment.
    decay: Vec<f64>,
    /// The largest share of triangles that are inactive at a moment.
    inactive: f64,
    /// The largest share that are degenerate.
    degenerate: f64,
    /// The farthest coordinate from the origin.
    offset: f64,
}

impl Facts {
    /// Looks at a run of one frame at least.
    ///
    /// # Errors
    /// The builder's.
    pub(super) fn of(animation: &Animation, run: &Run<'_>) -> Result<Self, Stop> {
        let all = animation.triangle_count();
        let sample = (0..all as u32).step_by(all.div_ceil(TRIANGLES).max(1));
        let sample: Vec<u32> = sample.collect();
        let last = run.frames.len() - 1;
        let moments = (0..MOMENTS).map(|i| Moment {
            animation,
            sample: &sample,
            poses: [0, 1].map(|next| {
                let at = (i * last / (MOMENTS - 1) + next).min(last);
                animation.pose(run.frames[at].time)
            }),
        });
        let moments: Vec<Moment<'_>> = moments.collect();
        let seen: Vec<Seen> = moments.iter().map(Moment::look).collect();
        let bounds = (seen.iter().flat_map(|s| [s.bounds.min, s.bounds.max]))
            .filter(|p| p.iter().all(|x| x.is_finite()))
            .fold(Aabb::EMPTY, Aabb::with_point);
        let diagonal = distance(bounds.min, bounds.max);
        let most = |of: fn(&Seen) -> f64| seen.iter().map(of).fold(0.0, f64::max);
        Ok(Self {
            moving: animation.moving_count() as f64 / all.max(1) as f64,
            step: over(seen.iter().map(|s| s.step).sum(), MOMENTS as f64 * diagonal),
            decay: decay(&moments)?,
            inactive: most(|s| s.inactive),
            degenerate: most(|s| s.degenerate),
            offset: over(distance_max(&bounds), diagonal),
        })
    }

    /// How many times the cost of a fresh tree the first one comes to, refitted: the median over the run.
    pub(super) fn usual_decay(&self) -> f64 {
        Summary::of(self.decay.iter().copied()).map_or(1.0, |s| s.median)
    }

    /// The same at its worst.
    fn worst_decay(&self) -> f64 {
        self.decay.iter().copied().fold(1.0, f64::max)
    }

    /// Whether the first tree stays as good as a fresh one.
    pub(super) fn tree_lasts(&self) -> bool {
        self.worst_decay() <= GOOD
    }
}

impl fmt::Display for Facts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = |x: f64| match x {
            0.0 => "none".to_owned(),
            x => format!("{:.2}%", 100.0 * x),
        };
        write!(
            f,
            "motion: {:.1}% of the triangles, {:.3}% of the diagonal a frame; refit decay: the first tree comes to {:.2} times the cost of a \
             fresh one; degenerate {}, inactive {}; offset: coordinates up to {:.3} diagonals from the origin",
            100.0 * self.moving,
            100.0 * self.step,
            self.worst_decay(),
            share(self.degenerate),
            share(self.inactive),
            self.offset,
        )
    }
}

/// A sample of triangles at a frame, and where they are in the next one.
struct Moment<'a> {
    animation: &'a Animation,
    sample: &'a [u32],
    poses: [Pose; 2],
}

/// What is seen at a moment.
struct Seen {
    bounds: Aabb,
    step: f64,
    inactive: f64,
    degenerate: f64,
}

impl Moment<'_> {
    fn look(&self) -> Seen {
        let (mut bounds, mut way, mut corners) = (Aabb::EMPTY, 0.0, 0_usize);
        let (mut inactive, mut degenerate) = (0_usize, 0_usize);
        for &t in self.sample {
            let [now, next] = self.poses.map(|pose| self.animation.corners(pose, t));
            inactive += usize::from(!is_active(&now));
            degenerate += usize::from(is_active(&now) && is_degenerate(&now));
            if is_active(&now) && is_active(&next) {
                bounds = now.iter().fold(bounds, |b, &p| b.with_point(p));
                way += (0..3).map(|i| distance(now[i], next[i])).sum::<f64>();
                corners += 3;
            }
        }
        let share = |n: usize| over(n as f64, self.sample.len() as f64);
        Seen {
            bounds,
            step: over(way, corners as f64),
            inactive: share(inactive),
            degenerate: share(degenerate),
        }
    }
}

impl Boxes for Moment<'_> {
    fn len(&self) -> usize {
        self.sample.len()
    }

    fn get(&self, triangle: u32) -> Aabb {
        let triangle = self.sample[triangle as usize];
        self.animation.build_box_at(self.poses[0], triangle)
    }
}

/// What became of the first moment's tree at each later one.
fn decay(moments: &[Moment<'_>]) -> Result<Vec<f64>, Stop> {
    let (mut builder, cancel) = (Builder::new(), Cancel::new());
    let [mut first, mut fresh] = [BinaryTree::default(), BinaryTree::default()];
    let [start, later @ ..] = moments else {
        return Ok(Vec::new());
    };
    let failed = Stop::failed;
    builder.build(start, &cancel, &mut first).map_err(failed)?;
    let ratio = |moment: &Moment<'_>| {
        builder.build(moment, &cancel, &mut fresh).map_err(failed)?;
        let [refitted, fresh] = [&first, &fresh].map(|tree| sah_cost(tree, moment));
        Ok(if fresh > 0.0 { refitted / fresh } else { 1.0 })
    };
    later.iter().map(ratio).collect()
}

fn distance(a: Point, b: Point) -> f64 {
    let square = |i: usize| (f64::from(a[i]) - f64::from(b[i])).powi(2);
    (square(0) + square(1) + square(2)).sqrt()
}

/// The largest absolute coordinate of a box; 0 if it is empty.
fn distance_max(bounds: &Aabb) -> f64 {
    let all = bounds.min.into_iter().chain(bounds.max);
    let finite = all.filter(|x| x.is_finite()).map(|x| f64::from(x.abs()));
    finite.fold(0.0, f64::max)
}

fn over(part: f64, whole: f64) -> f64 {
    if whole > 0.0 && whole.is_finite() {
        part / whole
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::tests::{frames, with_run};

    fn facts(animation: &Animation, count: u64) -> Facts {
        let frames = frames(count);
        with_run(animation, &frames, |run| Facts::of(animation, run)).unwrap()
    }

    impl Facts {
        /// Of a scene whose first tree comes to so many times the cost of a fresh one.
        pub(in crate::trial) fn decayed(to: f64) -> Self {
            Self {
                decay: vec![to],
                ..facts(&row(0.0, |i| i), 2)
            }
        }
    }

    /// Triangles in a row, which in the second key frame stand elsewhere.
    fn row(offset: f32, place: fn(u32) -> u32) -> Animation {
        let key = |place: fn(u32) -> u32| -> Vec<Point> {
            let at = |i| offset + place(i) as f32;
            let corners = |x| [[x, 0.0, 0.0], [x + 0.5, 0.0, 0.0], [x, 0.5, 0.5]];
            (0..64).flat_map(|i| corners(at(i))).collect()
        };
        let mut keys = vec![key(|i| i), key(place)];
        // One is never active, one has no area.
        keys.iter_mut().for_each(|key| {
            key[0] = [f32::NAN; 3];
            key[3] = key[4];
        });
        let triangles = (0..64).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Animation::new(keys, triangles).unwrap()
    }

    #[test]
    fn a_row_that_is_shuffled_makes_the_first_tree_worse() {
        let shuffled = facts(&row(0.0, |i| i * 37 % 64), 9);
        assert!(
            shuffled.worst_decay() > 1.5 && !shuffled.tree_lasts(),
            "{shuffled}"
        );
        assert!(shuffled.step > 0.01 && shuffled.moving > 0.9, "{shuffled}");
        let moved = facts(&row(0.0, |i| i + 5), 9);
        assert!(moved.tree_lasts() && moved.step > 0.0, "{moved}");
        let still = facts(&row(0.0, |i| i), 9);
        assert_eq!(
            (still.moving, still.step, still.worst_decay()),
            (0.0, 0.0, 1.0)
        );
    }

    #[test]
    fn what_cannot_be_hit_is_counted_and_the_way_to_the_origin_measured() {
        let near = facts(&row(0.0, |i| i), 3);
        assert_eq!((near.inactive, near.degenerate), (1.0 / 64.0, 1.0 / 64.0));
        assert!(near.offset < 1.1, "{near}");
        let far = facts(&row(640_000.0, |i| i), 3);
        assert!(far.offset > 9_000.0, "{far}");
        let text = far.to_string();
        for word in [
            "motion",
            "refit decay",
            "degenerate 1.56%",
            "inactive 1.56%",
            "offset",
        ] {
            assert!(text.contains(word), "{text}");
        }
    }

    #[test]
    fn a_scene_without_triangles_has_facts_too() {
        let empty = Animation::new(vec![vec![[1.0; 3]]; 2], vec![]).unwrap();
        let facts = facts(&empty, 2);
        assert_eq!(
            (facts.usual_decay(), facts.offset, facts.step),
            (1.0, 0.0, 0.0)
        );
    }
}
