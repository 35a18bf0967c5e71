//! Which parts of an animation never move.

use crate::{Point, is_active, is_degenerate};
use rayon::prelude::*;
use std::ops::Range;

/// Two classes of motion: what stands at the same bits at every pose, and the rest.
///
/// A vertex is *static* if it has the same bits in all key frames and blending
/// gives those bits back. Where there are several key frames, that leaves out
/// vertices with a coordinate of `-0` (between key frames it is `+0`) and those
/// that are not finite (an infinity becomes a NaN). What is not static *moves*.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StaticParts {
    /// For each vertex, whether it is static.
    pub vertices: Vec<bool>,
    /// For each triangle, whether all three of its vertices are static. Its box, its area and what rays find of it are, too.
    pub triangles: Vec<bool>,
    /// Static triangles that are active and of zero area, in order.
    pub degenerate: Vec<u32>,
}

impl StaticParts {
    /// What follows from static `vertices`, which stand where they do in the `first` key frame.
    pub(crate) fn of(vertices: Vec<bool>, first: &[Point], triangles: &[[u32; 3]]) -> Self {
        let is_static = |t: &[u32; 3]| t.iter().all(|&v| vertices[v as usize]);
        let triangles_are: Vec<bool> = triangles.par_iter().map(is_static).collect();
        let all = triangles_are.par_iter().enumerate();
        let degenerate = all
            .filter(|&(t, is_static)| {
                let corners = triangles[t].map(|v| first[v as usize]);
                *is_static && is_active(&corners) && is_degenerate(&corners)
            })
            .map(|(t, _)| t as u32)
            .collect();
        Self {
            vertices,
            triangles: triangles_are,
            degenerate,
        }
    }

    /// How many vertices are static.
    pub fn vertex_count(&self) -> usize {
        count(&self.vertices)
    }

    /// How many triangles are static.
    pub fn triangle_count(&self) -> usize {
        count(&self.triangles)
    }

    /// Runs of vertices that hold all that move, in order. Static vertices
    /// between two runs are at least `gap`; where they are fewer, one run holds both.
    pub fn moving_runs(&self, gap: usize) -> Vec<Range<usize>> {
        let mut runs: Vec<Range<usize>> = Vec::new();
        let moving = self.vertices.iter().enumerate().filter(|(_, s)| !**s);
        for (v, _) in moving {
            match runs.last_mut() {
                Some(last) if v - last.end < gap.max(1) => last.end = v + 1,
                _ => runs.push(v..v + 1),
            }
        }
        runs
    }

    /// Whether it is worth while to list what moves and to pass over the rest.
    ///
    /// An entry of a list is four bytes more to carry and a read that others
    /// wait for; so up to one half of all things may be listed, which never
    /// costs more than it saves.
    #[must_use]
    pub fn pays(moving: usize, all: usize) -> bool {
        moving <= all / 2
    }
}

pub(crate) fn bits(p: &Point) -> [u32; 3] {
    p.map(f32::to_bits)
}

/// Whether a vertex that stands still has its own bits between key frames: see [`crate::Pose::blend`].
pub(crate) fn keeps_its_bits(p: &Point) -> bool {
    p.iter()
        .all(|x| x.is_finite() && x.to_bits() != (-0.0_f32).to_bits())
}

fn count(of: &[bool]) -> usize {
    of.iter().filter(|&&is_static| is_static).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Animation;

    fn parts(keys: Vec<Vec<Point>>, triangles: Vec<[u32; 3]>) -> StaticParts {
        let animation = Animation::new(keys, triangles).unwrap();
        animation.static_parts().clone()
    }

    #[test]
    fn a_triangle_is_static_if_all_its_vertices_are() {
        let rest = vec![[0.5; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [3.0; 3]];
        for axis in 0..3 {
            for key in 0..3 {
                let mut keys = vec![rest.clone(); 3];
                keys[key][1][axis] += 1e-7;
                let found = parts(keys, vec![[0, 2, 3], [0, 1, 2], [1, 0, 0], [0, 0, 2]]);
                assert_eq!(found.vertices, [true, false, true, true]);
                assert_eq!(found.triangles, [true, false, false, true]);
                assert_eq!((found.vertex_count(), found.triangle_count()), (3, 2));
                assert_eq!(found.degenerate, [3]);
            }
        }
        assert_eq!(parts(vec![rest], vec![[0, 1, 2]]).triangle_count(), 1);
    }

    #[test]
    fn what_goes_and_comes_back_moves_and_so_does_the_sign_of_zero() {
        let at = |x: f32| vec![[x, 0.0, 0.0], [0.0, x, 0.0]];
        let found = parts(vec![at(0.0), at(1.0), at(0.0)], vec![]);
        assert_eq!(found.vertex_count(), 0);
        assert_eq!(parts(vec![at(0.0), at(-0.0)], vec![]).vertex_count(), 0);
    }

    #[test]
    fn what_blending_would_change_moves_unless_it_is_never_blended() {
        let odd = vec![
            [-0.0, 1.0, 2.0],
            [f32::NAN; 3],
            [1.0, 2.0, f32::INFINITY],
            [0.0, 1e-45, f32::MAX],
        ];
        let found = parts(vec![odd.clone(); 3], vec![[0, 0, 0], [3, 3, 3], [1, 2, 3]]);
        assert_eq!(found.vertices, [false, false, false, true]);
        assert_eq!((found.triangle_count(), found.degenerate), (1, vec![1]));
        let alone = parts(vec![odd], vec![[0, 0, 0], [3, 3, 3], [1, 2, 3]]);
        assert_eq!((alone.vertex_count(), alone.degenerate.len()), (4, 2));
    }

    #[test]
    fn runs_hold_all_that_moves_and_few_others() {
        let parts = StaticParts {
            vertices: [1, 0, 0, 1, 0, 1, 1, 1, 0].map(|s| s == 1).to_vec(),
            ..StaticParts::default()
        };
        for gap in [0, 1] {
            assert_eq!(parts.moving_runs(gap), [1..3, 4..5, 8..9]);
        }
        for gap in [2, 3] {
            assert_eq!(parts.moving_runs(gap), [1..5, 8..9]);
        }
        assert_eq!(parts.moving_runs(4), std::slice::from_ref(&(1..9)));
        assert_eq!(StaticParts::default().moving_runs(9), []);
    }
}
