//! Properties of all key frames of an animation: their bounds, their inactive triangles and their static parts.

use crate::key_frames::KeyFrames;
use crate::sizes::Sizes;
use crate::triangle::corners;
use crate::{Aabb, CoordinateRange, KeyFrameError, Point, in_parallel, is_active, is_degenerate};
use rayon::prelude::*;
use std::ops;

/// Properties of the whole animation.
#[derive(Clone, Debug, Default)]
pub(crate) struct Survey {
    /// Triangles that first become active after the first key frame, each with its box at that time. In a streamed
    /// animation, all triangles that are inactive at first, each with a single point. Sorted by triangle.
    pub(crate) fallback_boxes: Vec<(u32, Aabb)>,
    pub(crate) never_active: u32,
    pub(crate) static_parts: StaticParts,
    pub(crate) scale_exponent: i32,
    /// Range of each key frame.
    pub(crate) ranges: Vec<CoordinateRange>,
    /// Bounds of the finite vertices of each key frame.
    pub(crate) bounds: Vec<Aabb>,
}

/// Minimum number of vertices per parallel task.
const RUN: usize = 1 << 16;

impl Survey {
    /// Visits all key frames in order. Several key frames are read at a time.
    pub(crate) fn of(keys: &KeyFrames, triangles: &[[u32; 3]]) -> Result<Self, KeyFrameError> {
        let first = &keys.first()[..];
        let (mut sizes, mut bounds) = (vec![Sizes::of(first)], vec![finite_bounds(first)]);
        let mut is_static = vec![true; first.len()];
        let mut fallback_boxes = Vec::new();
        // Triangles that are inactive in all key frames so far.
        let mut inactive: Vec<u32> = Vec::new();
        if !in_parallel(|| first.par_iter().with_min_len(RUN).all(is_finite)) {
            let all = 0..triangles.len() as u32;
            let is_inactive = |&t: &u32| !is_active(&corners(first, triangles[t as usize]));
            inactive = in_parallel(|| all.into_par_iter().filter(is_inactive).collect());
        }
        let count = keys.count();
        for key in 1..count {
            keys.look_ahead(key..count);
            let frame = &keys.get(key)?[..];
            // `a` is the vertex in the first key frame, the same in every iteration. So its bits are checked only in
            // the first iteration.
            let is_first_comparison = sizes.len() == 1;
            let check = |(is_static, (a, b)): (&mut bool, (&Point, &Point))| {
                let may_be_static = !is_first_comparison || keeps_its_bits(a);
                *is_static = *is_static && may_be_static && bits(a) == bits(b);
            };
            in_parallel(|| {
                let pairs = first.par_iter().zip(frame);
                let each = is_static.par_iter_mut().with_min_len(RUN);
                each.zip(pairs).for_each(check);
            });
            sizes.push(Sizes::of(frame));
            bounds.push(finite_bounds(frame));
            inactive.retain(|&t| {
                let corners = corners(frame, triangles[t as usize]);
                let active = is_active(&corners);
                if active {
                    fallback_boxes.push((t, Aabb::of_triangle(&corners)));
                }
                !active
            });
        }
        fallback_boxes.sort_unstable_by_key(|&(t, _)| t);
        let (scale_exponent, ranges) = CoordinateRange::of_keys(&sizes);
        Ok(Self {
            fallback_boxes,
            never_active: inactive.len() as u32,
            static_parts: StaticParts::of(is_static, first, triangles),
            scale_exponent,
            ranges,
            bounds,
        })
    }

    /// Adapts the properties of the first key frame to future key frames, in which vertices that are not `fixed` may
    /// move anywhere.
    ///
    /// Any triangle may become active later, so the tree needs a leaf for each. The box of an inactive triangle is then
    /// a single point.
    pub(crate) fn adapt_to_streaming(
        &mut self,
        first: &[Point],
        triangles: &[[u32; 3]],
        fixed: &[bool],
    ) {
        let finite = first.iter().find(|p| is_finite(p));
        let point = Aabb::EMPTY.with_point(*finite.unwrap_or(&[0.0; 3]));
        // Exactly `never_active` triangles are inactive, usually 0. The search ends at the last one.
        let inactive = triangles.iter().zip(0..);
        let inactive = inactive.filter(|&(&t, _)| !is_active(&corners(first, t)));
        let inactive = inactive.take(self.never_active as usize);
        self.fallback_boxes = inactive.map(|(_, t)| (t, point)).collect();
        self.never_active = 0;
        let marks = first.iter().zip(fixed);
        let is_static = marks.map(|(p, &fixed)| fixed && keeps_its_bits(p));
        self.static_parts = StaticParts::of(is_static.collect(), first, triangles);
    }
}

/// Returns the smallest box that contains a key frame's finite vertices.
fn finite_bounds(frame: &[Point]) -> Aabb {
    in_parallel(|| {
        let finite = frame.par_iter().with_min_len(RUN).filter(|p| is_finite(p));
        let boxes = finite.fold(|| Aabb::EMPTY, |bounds, p| bounds.with_point(*p));
        boxes.reduce(|| Aabb::EMPTY, Aabb::union)
    })
}

/// Checks that every triangle names existing vertices, and that there are at most `limit` triangles.
pub(crate) fn check_triangles(
    triangles: &[[u32; 3]],
    vertices: usize,
    limit: usize,
) -> Result<(), KeyFrameError> {
    let count = triangles.len();
    if count > limit {
        let cause = format!("{count} triangles are more than the limit of {limit}");
        return Err(KeyFrameError(cause));
    }
    let missing = |own: &[u32; 3]| own.iter().find(|&&v| v as usize >= vertices).copied();
    let invalid = in_parallel(|| {
        let numbered = triangles.par_iter().enumerate();
        numbered.find_map_first(|(triangle, own)| Some((triangle, missing(own)?)))
    });
    match invalid {
        None => Ok(()),
        Some((triangle, vertex)) => Err(KeyFrameError(format!(
            "triangle {triangle} has vertex index {vertex}, but the vertex count is {vertices}"
        ))),
    }
}

/// Partition of vertices and triangles into static ones and moving ones.
///
/// A vertex is *static* if it has the same bits in all key frames and blending returns those bits. All other vertices
/// *move*. If there are several key frames, a vertex with a coordinate of `-0` or a non-finite coordinate always moves:
/// between key frames, blending turns `-0` into `+0` and infinity into NaN.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StaticParts {
    /// For each vertex, true if it is static.
    pub vertices: Vec<bool>,
    /// For each triangle, true if all three vertices are static. Then its box, its area and its hits are static too.
    pub triangles: Vec<bool>,
    /// Static triangles that are active and have zero area, in ascending order.
    pub degenerate: Vec<u32>,
}

impl StaticParts {
    /// Derives the static triangles from the static `vertices`, which are at their positions in the `first` key frame.
    pub(crate) fn of(vertices: Vec<bool>, first: &[Point], triangles: &[[u32; 3]]) -> Self {
        let is_static = |t: &[u32; 3]| t.iter().all(|&v| vertices[v as usize]);
        let static_triangles: Vec<bool> =
            in_parallel(|| triangles.par_iter().map(is_static).collect());
        let is_flat = |&t: &u32| {
            let corners = corners(first, triangles[t as usize]);
            static_triangles[t as usize] && is_active(&corners) && is_degenerate(&corners)
        };
        let all = 0..triangles.len() as u32;
        let degenerate = in_parallel(|| all.into_par_iter().filter(is_flat).collect());
        Self {
            vertices,
            triangles: static_triangles,
            degenerate,
        }
    }

    /// Returns the number of static vertices.
    pub fn vertex_count(&self) -> usize {
        self.vertices.iter().filter(|&&s| s).count()
    }

    /// Returns the number of static triangles.
    pub fn triangle_count(&self) -> usize {
        self.triangles.iter().filter(|&&s| s).count()
    }

    /// Returns runs of vertices that contain all moving vertices, in ascending order.
    ///
    /// Runs separated by fewer than `gap` static vertices are merged.
    pub fn moving_runs(&self, gap: usize) -> Vec<ops::Range<usize>> {
        let mut runs: Vec<ops::Range<usize>> = Vec::new();
        let moving = self.vertices.iter().enumerate().filter(|(_, s)| !**s);
        for (v, _) in moving {
            match runs.last_mut() {
                Some(last) if v - last.end < gap.max(1) => last.end = v + 1,
                _ => runs.push(v..v + 1),
            }
        }
        runs
    }

    /// Returns whether listing the moving elements is cheaper than processing all.
    ///
    /// Each list entry adds four bytes to transfer and a dependent read. If at most half of the elements are listed,
    /// the list saves more than it costs.
    #[must_use]
    pub fn pays(moving: usize, all: usize) -> bool {
        moving <= all / 2
    }
}

fn is_finite(p: &Point) -> bool {
    p.iter().all(|x| x.is_finite())
}

fn bits(p: &Point) -> [u32; 3] {
    p.map(f32::to_bits)
}

/// Returns whether blending a vertex with itself returns its bits: see [`crate::Pose::blend`].
fn keeps_its_bits(p: &Point) -> bool {
    p.iter()
        .all(|x| x.is_finite() && x.to_bits() != (-0.0_f32).to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Animation, Pose};

    fn parts(keys: Vec<Vec<Point>>, triangles: Vec<[u32; 3]>) -> StaticParts {
        let animation = Animation::new(keys, triangles).unwrap();
        animation.static_parts().clone()
    }

    #[test]
    fn triangle_with_static_vertices_is_static() {
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
    fn returning_vertices_count_as_moving() {
        let at = |x: f32| vec![[x, 0.0, 0.0], [0.0, x, 0.0]];
        let found = parts(vec![at(0.0), at(1.0), at(0.0)], vec![]);
        assert_eq!(found.vertex_count(), 0);
        assert_eq!(parts(vec![at(0.0), at(-0.0)], vec![]).vertex_count(), 0);
    }

    #[test]
    fn vertices_changed_by_blending_are_moving() {
        let odd = vec![
            [-0.0, 1.0, 2.0],
            [f32::NAN; 3],
            [1.0, 2.0, f32::INFINITY],
            [0.0, 1e-45, f32::MAX],
        ];
        let found = parts(vec![odd.clone(); 3], vec![[0, 0, 0], [3, 3, 3], [1, 2, 3]]);
        assert_eq!(found.vertices, [false, false, false, true]);
        assert_eq!((found.triangle_count(), found.degenerate), (1, vec![1]));
        let blended = Pose::at(0.3, 2).blend(odd[3], odd[3]);
        assert_eq!(bits(&blended), bits(&odd[3]));
        let alone = parts(vec![odd], vec![[0, 0, 0], [3, 3, 3], [1, 2, 3]]);
        assert_eq!((alone.vertex_count(), alone.degenerate.len()), (4, 2));
    }

    #[test]
    fn moving_runs_merge_small_gaps() {
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
