//! Where a ray begins and what it is aimed at.

use super::batches::Moved;
use fastrand::Rng;
use geom::{Point, Ray};
use std::fmt;

/// What a ray is aimed at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aim {
    /// A point on an edge, as near as its coordinates can be.
    Edge,
    /// A vertex.
    Vertex,
    /// Nothing in particular.
    Random,
}

impl fmt::Display for Aim {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Edge => "an edge",
            Self::Vertex => "a vertex",
            Self::Random => "random",
        })
    }
}

/// Aims times sides. Rays of a batch take turns.
pub(super) const SORTS: usize = 6;

/// What the `i`-th ray of a batch is aimed at, and whether it begins inside.
pub(super) fn sort_of(i: usize) -> (Aim, bool) {
    let aim = [Aim::Edge, Aim::Vertex, Aim::Random][i % 3];
    (aim, i % SORTS < 3)
}

/// The `i`-th ray at a body.
pub(super) fn ray(body: &Moved<'_>, i: usize, rng: &mut Rng) -> Ray {
    let (aim, inside) = sort_of(i);
    let radius = body.shape.radius;
    let origin = if inside {
        body.place((body.shape.inner)(rng))
    } else {
        let far = radius * (1.5 + 2.0 * rng.f64());
        body.place(sphere(rng).map(|x| x * far))
    };
    let vertex = |i: u32| body.points[i as usize];
    let corners = body.triangles[rng.usize(..body.triangles.len())];
    let k = rng.usize(..3);
    let at: Point = match aim {
        Aim::Vertex => vertex(corners[k]),
        Aim::Edge => {
            let (a, b, s) = (vertex(corners[k]), vertex(corners[(k + 1) % 3]), rng.f32());
            std::array::from_fn(|i| a[i] + s * (b[i] - a[i]))
        }
        Aim::Random if inside => {
            let far = sphere(rng);
            std::array::from_fn(|i| origin[i] + (far[i] * radius) as f32)
        }
        Aim::Random => {
            let reach = radius * rng.f64();
            body.place(sphere(rng).map(|x| x * reach))
        }
    };
    Ray::new(origin, std::array::from_fn(|i| at[i] - origin[i]))
}

/// A direction of length 1, all alike.
fn sphere(rng: &mut Rng) -> [f64; 3] {
    let z = 2.0 * rng.f64() - 1.0;
    let (sin, cos) = (std::f64::consts::TAU * rng.f64()).sin_cos();
    let r = (1.0 - z * z).sqrt();
    [r * cos, r * sin, z]
}
