//! Interpolates key frames to positions.

use geom::{Moment, Point};
use rayon::prelude::*;
use std::ops::Range;

/// Vertices that one task interpolates.
const RUN: usize = 1 << 14;

/// Writes the positions of all vertices in `runs`, with the same bits as [`Moment::vertex`]. `runs` is in ascending
/// order. Other vertices keep their positions.
pub(crate) fn interpolate(moment: &Moment<'_>, runs: &[Range<usize>], positions: &mut [Point]) {
    let (pose, [earlier, later]) = (moment.pose(), moment.key_frames());
    let tasks = cut(runs, positions);
    tasks
        .into_par_iter()
        .for_each(|InterpolateTask { first, to }| {
            let end = first + to.len();
            let (earlier, later) = (&earlier[first..end], &later[first..end]);
            if pose.alpha == 0.0 {
                return to.copy_from_slice(earlier);
            }
            for (to, (&a, &b)) in to.iter_mut().zip(earlier.iter().zip(later)) {
                *to = pose.blend(a, b);
            }
        });
}

/// The vertices of one task.
struct InterpolateTask<'a> {
    first: usize,
    to: &'a mut [Point],
}

/// Splits the runs into tasks of at most `RUN` vertices.
fn cut<'a>(runs: &[Range<usize>], mut rest: &'a mut [Point]) -> Vec<InterpolateTask<'a>> {
    let mut tasks = Vec::with_capacity(runs.len());
    let mut rest_start = 0;
    for run in runs {
        let (_, from) = rest.split_at_mut(run.start - rest_start);
        let (to, after) = from.split_at_mut(run.len());
        let firsts = run.clone().step_by(RUN);
        let parts = firsts.zip(to.chunks_mut(RUN));
        tasks.extend(parts.map(|(first, to)| InterpolateTask { first, to }));
        (rest, rest_start) = (after, run.end);
    }
    tasks
}

#[cfg(test)]
mod tests {
    use super::*;
    use geom::Animation;

    #[test]
    fn interpolation_writes_only_given_runs() {
        let key = |k: usize| -> Vec<Point> {
            let at = |v: usize| (v * (1 + k * usize::from(v % 7 > 4))) as f32 * 0.37;
            (0..60_000).map(|v| [at(v), -1.0, 3.0 + at(v)]).collect()
        };
        let mut keys = vec![key(0), key(1), key(2)];
        keys[1][5] = [f32::NAN, f32::INFINITY, 1.0];
        let animation = Animation::new(keys, vec![]).unwrap();
        let parts = animation.static_parts();
        let everything = std::iter::once(0..60_000).collect();
        let runs = [1, 3, 9].map(|gap| parts.moving_runs(gap));
        let bits = |p: Point| p.map(f32::to_bits);
        for runs in runs.into_iter().chain([everything]) {
            for time in [0.0, 0.7, 1.0, 1.999, 2.0] {
                let moment = animation.at(time).unwrap();
                let mut positions = animation.first().to_vec();
                interpolate(&moment, &runs, &mut positions);
                let all = (0..60_000).map(|v| bits(moment.vertex(v)));
                assert!(all.eq(positions.into_iter().map(bits)), "{time}");
            }
        }
        let mut untouched = vec![[7.0; 3]; 60_000];
        let runs = [3..5, 50_000..50_001];
        interpolate(&animation.at(0.5).unwrap(), &runs, &mut untouched);
        assert_eq!(untouched.iter().filter(|p| **p != [7.0; 3]).count(), 3);
    }
}
