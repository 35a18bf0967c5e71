//! How a scene moves and what in it cannot be hit.

use geom::{Animation, Point, Pose, is_active, is_degenerate};
use rayon::prelude::*;
use serde::Serialize;

/// How vertices move.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Motion {
    /// Share of the vertices that are elsewhere in some key frame.
    pub(crate) moving: f64,
    /// Mean way of a vertex from one key frame to the next, over the diagonal of the bounds.
    pub(crate) mean_step: f64,
    /// The longest such way.
    pub(crate) max_step: f64,
}

/// The least and the most over all key frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Spread {
    /// The least.
    pub(crate) min: usize,
    /// The most.
    pub(crate) max: usize,
}

/// What never moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Still {
    /// Vertices that never move: see [`geom::StaticParts`].
    pub(crate) vertices: usize,
    /// Triangles all of whose vertices are such.
    pub(crate) triangles: usize,
    /// Bytes of positions in all key frames.
    pub(crate) bytes: usize,
    /// Of those, what static vertices take in key frames after the first.
    pub(crate) repeated_bytes: usize,
}

/// Counts what never moves.
pub(crate) fn still(animation: &Animation) -> Still {
    let parts = animation.static_parts();
    let (keys, vertices) = (animation.keys().len(), parts.vertex_count());
    Still {
        vertices,
        triangles: parts.triangle_count(),
        bytes: keys * animation.vertex_count() * size_of::<Point>(),
        repeated_bytes: (keys - 1) * vertices * size_of::<Point>(),
    }
}

/// Measures the motion; steps to or from where a vertex is not finite count for nothing.
pub(crate) fn measure(animation: &Animation) -> Motion {
    let keys = animation.keys();
    let diagonal = length(animation.bounds().extent());
    let moving = (0..animation.vertex_count())
        .into_par_iter()
        .filter(|&v| {
            keys.iter()
                .any(|k| k[v].map(f32::to_bits) != keys[0][v].map(f32::to_bits))
        })
        .count();
    let steps: Vec<(f64, f64, usize)> = keys
        .par_windows(2)
        .map(|pair| {
            let ways = pair[0].iter().zip(&pair[1]).map(|(a, b)| distance(a, b));
            ways.filter(|w| w.is_finite())
                .fold((0.0, 0.0, 0), |(sum, max, n), w| {
                    (sum + w, f64::max(max, w), n + 1)
                })
        })
        .collect();
    let sum: f64 = steps.iter().map(|s| s.0).sum();
    let count: usize = steps.iter().map(|s| s.2).sum();
    let max = steps.iter().fold(0.0, |m, s| f64::max(m, s.1));
    Motion {
        moving: share(moving as f64, animation.vertex_count() as f64),
        mean_step: share(sum, count as f64 * diagonal),
        max_step: share(max, diagonal),
    }
}

/// Inactive and degenerate triangles of each key frame: their spread.
pub(crate) fn unhittable(animation: &Animation) -> (Spread, Spread) {
    let counts: Vec<(usize, usize)> = (0..animation.keys().len())
        .into_par_iter()
        .map(|key| {
            let (key, alpha) = (key as u32, 0.0);
            let pose = Pose { key, alpha };
            (0..animation.triangle_count() as u32)
                .into_par_iter()
                .map(|t| {
                    let corners = animation.corners(pose, t);
                    let active = is_active(&corners);
                    let degenerate = active && is_degenerate(&corners);
                    (usize::from(!active), usize::from(degenerate))
                })
                .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1))
        })
        .collect();
    let spread = |of: fn(&(usize, usize)) -> usize| Spread {
        min: counts.iter().map(of).min().unwrap_or(0),
        max: counts.iter().map(of).max().unwrap_or(0),
    };
    (spread(|c| c.0), spread(|c| c.1))
}

fn distance(a: &Point, b: &Point) -> f64 {
    let [a, b] = [a, b].map(|p| p.map(f64::from));
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b) * (a - b))
        .sum::<f64>()
        .sqrt()
}

fn length(v: Point) -> f64 {
    distance(&v, &[0.0; 3])
}

fn share(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_is_measured_against_the_diagonal() {
        let rest = [[0.0; 3], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [f32::NAN; 3]];
        let mut moved = rest;
        moved[0] = [0.0, 1.0, 0.0];
        let keys = vec![rest.to_vec(), moved.to_vec(), moved.to_vec()];
        let a = Animation::new(keys, vec![[0, 1, 2], [0, 1, 3], [1, 1, 2]]).unwrap();
        let m = measure(&a);
        assert_eq!((m.moving, m.max_step), (0.25, 0.2));
        assert!((m.mean_step - 1.0 / 6.0 / 5.0).abs() < 1e-12);
        let both = |n| Spread { min: n, max: n };
        assert_eq!(unhittable(&a), (both(1), both(1)));
        let expected = Still {
            vertices: 2,
            triangles: 1,
            bytes: 3 * 4 * 12,
            repeated_bytes: 2 * 2 * 12,
        };
        assert_eq!(still(&a), expected);
    }

    #[test]
    fn a_scene_without_size_does_not_move() {
        let a = Animation::new(vec![vec![[1.0; 3]]], vec![]).unwrap();
        assert_eq!(measure(&a).max_step, 0.0);
    }
}
