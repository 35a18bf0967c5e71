//! Key frames to positions.

use geom::{Animation, Point, Pose};
use rayon::prelude::*;
use std::ops::Range;

/// Vertices that one task handles.
const RUN: usize = 1 << 14;

/// Writes every vertex at `pose`: the same bits as [`Animation::vertex`].
pub(crate) fn interpolate(animation: &Animation, pose: Pose, positions: &mut [Point]) {
    let keys = animation.keys();
    let earlier = &keys[pose.key as usize];
    if pose.alpha == 0.0 {
        copy(earlier, positions);
        return;
    }
    let later = &keys[pose.key as usize + 1];
    positions
        .par_chunks_mut(RUN)
        .zip(earlier.par_chunks(RUN).zip(later.par_chunks(RUN)))
        .for_each(|(to, (a, b))| {
            for ((to, &a), &b) in to.iter_mut().zip(a).zip(b) {
                *to = pose.blend(a, b);
            }
        });
}

/// The same for runs of vertices, in order, that hold all that move: the others must stand already.
pub(crate) fn interpolate_moving(
    animation: &Animation,
    pose: Pose,
    (runs, positions): (&[Range<usize>], &mut [Point]),
) {
    let keys = animation.keys();
    let earlier = &keys[pose.key as usize];
    // At a key frame the later one is not read.
    let later = keys.get(pose.key as usize + 1).unwrap_or(earlier);
    let tasks = cut(runs, positions);
    tasks.into_par_iter().for_each(|(first, to)| {
        let end = first + to.len();
        let pairs = earlier[first..end].iter().zip(&later[first..end]);
        for (to, (&a, &b)) in to.iter_mut().zip(pairs) {
            *to = pose.blend(a, b);
        }
    });
}

/// The runs, none longer than a task, each with its first vertex.
fn cut<'a>(runs: &[Range<usize>], mut rest: &'a mut [Point]) -> Vec<(usize, &'a mut [Point])> {
    let mut tasks = Vec::with_capacity(runs.len());
    let mut begun = 0;
    for run in runs {
        let (_, from) = rest.split_at_mut(run.start - begun);
        let (to, after) = from.split_at_mut(run.len());
        let firsts = run.clone().step_by(RUN);
        tasks.extend(firsts.zip(to.chunks_mut(RUN)));
        (rest, begun) = (after, run.end);
    }
    tasks
}

/// Copies positions, in parallel.
pub(crate) fn copy(from: &[Point], to: &mut [Point]) {
    to.par_chunks_mut(RUN)
        .zip(from.par_chunks(RUN))
        .for_each(|(to, from)| to.copy_from_slice(from));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_alone_are_written_and_with_the_same_bits() {
        let key = |k: usize| -> Vec<Point> {
            let at = |v: usize| (v * (1 + k * usize::from(v % 7 > 4))) as f32 * 0.37;
            (0..60_000).map(|v| [at(v), -1.0, 3.0 + at(v)]).collect()
        };
        let animation = Animation::new(vec![key(0), key(1), key(2)], vec![]).unwrap();
        for gap in [1, 3, 9] {
            let runs = animation.static_parts().moving_runs(gap);
            for time in [0.0, 0.7, 2.0] {
                let pose = animation.pose(time);
                let mut positions = animation.keys()[0].clone();
                interpolate_moving(&animation, pose, (&runs, &mut positions));
                let all = (0..60_000).map(|v| animation.vertex(pose, v));
                assert!(all.eq(positions.iter().copied()), "{gap} {time}");
            }
        }
        let mut untouched = vec![[7.0; 3]; 60_000];
        let runs = [3..5, 50_000..50_001];
        interpolate_moving(&animation, animation.pose(0.5), (&runs, &mut untouched));
        assert_eq!(untouched.iter().filter(|p| **p != [7.0; 3]).count(), 3);
    }

    #[test]
    fn every_vertex_has_the_bits_of_the_one_formula() {
        let key = |seed: u32| -> Vec<Point> {
            let number =
                |i: u32| f32::from_bits(0x3f00_0000 ^ i.wrapping_mul(seed).rotate_left(9) >> 6);
            (0..40_000)
                .map(|i| [number(i), -number(i + 7), number(3 * i)])
                .collect()
        };
        let mut keys = vec![key(2_654_435_761), key(40_503), key(69_621)];
        keys[1][5] = [f32::NAN, f32::INFINITY, 1.0];
        let animation = Animation::new(keys, vec![]).unwrap();
        let mut positions = vec![[0.0; 3]; animation.vertex_count()];
        for time in [0.0, 0.3, 1.0, 1.999, 2.0] {
            let pose = animation.pose(time);
            interpolate(&animation, pose, &mut positions);
            for (i, p) in positions.iter().enumerate() {
                let expected = animation.vertex(pose, i as u32);
                assert_eq!(
                    p.map(f32::to_bits),
                    expected.map(f32::to_bits),
                    "{time} {i}"
                );
            }
        }
    }
}
