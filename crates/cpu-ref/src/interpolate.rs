//! Key frames to positions.

use geom::{Animation, Point, Pose};
use rayon::prelude::*;

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
