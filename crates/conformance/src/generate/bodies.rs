//! Closed bodies, each with a place well inside it.

use super::meshes::{Mesh, quads, split};
use fastrand::Rng;
use geom::Point;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// A closed body about the origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Body {
    pub(crate) name: &'static str,
    pub(crate) shape: fn() -> Mesh,
    /// A point at random that stays inside when all coordinates are off by some hundredths.
    pub(crate) inner: fn(&mut Rng) -> [f64; 3],
    /// No vertex is farther from the origin.
    pub(crate) radius: f64,
}

/// Round, not convex, with coplanar faces, and thin.
pub(crate) const BODIES: &[Body] = &[
    Body {
        name: "icosphere",
        shape: || icosphere(2),
        inner: |rng| near([0.0; 3], [0.3; 3], rng),
        radius: 1.0,
    },
    Body {
        name: "torus",
        shape: || torus(24, 12),
        inner: |rng| {
            let (sin, cos) = (TAU * rng.f64()).sin_cos();
            near([cos, sin, 0.0], [0.1; 3], rng)
        },
        radius: 1.0 + TUBE,
    },
    Body {
        name: "box",
        shape: || cuboid(4),
        inner: |rng| near([0.0; 3], [0.5; 3], rng),
        radius: 1.75,
    },
    Body {
        name: "needle",
        shape: || {
            let (points, triangles) = icosphere(1);
            let stretch = |p: Point| std::array::from_fn(|i| p[i] * [0.5, 0.5, 50.0][i]);
            (points.into_iter().map(stretch).collect(), triangles)
        },
        inner: |rng| near([0.0; 3], [0.1, 0.1, 20.0], rng),
        radius: 50.0,
    },
];

/// Radius of the torus's tube.
const TUBE: f64 = 0.4;

/// At random within `reach` of `centre` along each axis.
fn near(centre: [f64; 3], reach: [f64; 3], rng: &mut Rng) -> [f64; 3] {
    std::array::from_fn(|i| centre[i] + reach[i] * (2.0 * rng.f64() - 1.0))
}

/// Three vertices a triangle.
const ICOSAHEDRON: [u32; 60] = [
    0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4, 11, 10, 2, 10, 7, 6, 7, 1,
    8, 3, 9, 4, 3, 4, 2, 3, 2, 6, 3, 6, 8, 3, 8, 9, 4, 9, 5, 2, 4, 11, 6, 2, 10, 8, 6, 7, 9, 8, 1,
];

/// An icosahedron, its faces split `n` times.
fn icosphere(n: u32) -> Mesh {
    let phi = f32::midpoint(1.0, 5.0_f32.sqrt());
    let corners = |i: usize| {
        [[-1.0, phi], [1.0, phi], [-1.0, -phi], [1.0, -phi]].map(|[a, b]| {
            let mut p = [0.0; 3];
            (p[i], p[(i + 1) % 3]) = (a, b);
            unit(p)
        })
    };
    // 0..4 in the plane x-y, 4..8 in y-z, 8..12 in z-x.
    let points = (0..3).flat_map(corners).collect();
    let triangles = ICOSAHEDRON.as_chunks::<3>().0.to_vec();
    (0..n).fold((points, triangles), |shape, _| {
        split(shape, |a, b| unit(std::array::from_fn(|i| a[i] + b[i])))
    })
}

fn unit(p: Point) -> Point {
    let length = p.iter().map(|x| x * x).sum::<f32>().sqrt();
    p.map(|x| x / length)
}

/// `around` rings of `along` vertices.
fn torus(around: u32, along: u32) -> Mesh {
    let angle = |i: u32, n: u32| TAU * f64::from(i) / f64::from(n);
    let point = |i, j| {
        let ((s, c), (t, d)) = (angle(i, around).sin_cos(), angle(j, along).sin_cos());
        let r = 1.0 + TUBE * d;
        [r * c, r * s, TUBE * t].map(|x| x as f32)
    };
    let points = (0..around)
        .flat_map(|i| (0..along).map(move |j| point(i, j)))
        .collect();
    let at = |i, j| i % around * along + j % along;
    (points, quads(around, along, at).concat())
}

/// The cube `-1..=1`, each face `n` quads each way.
fn cuboid(n: u32) -> Mesh {
    let mut points = Vec::new();
    let mut known = BTreeMap::new();
    let mut vertex = |p: [u32; 3]| {
        *known.entry(p).or_insert_with(|| {
            points.push(p.map(|i| i as f32 / n as f32 * 2.0 - 1.0));
            points.len() as u32 - 1
        })
    };
    let mut triangles = Vec::new();
    for (axis, end) in (0..3).flat_map(|axis| [(axis, 0), (axis, n)]) {
        let lattice = quads(n, n, |i, j| j * (n + 1) + i).concat();
        triangles.extend(lattice.into_iter().map(|[a, b, c]| {
            // Outwards on both ends.
            let corners = if end == 0 { [a, c, b] } else { [a, b, c] };
            corners.map(|at| {
                let mut p = [end; 3];
                (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (at % (n + 1), at / (n + 1));
                vertex(p)
            })
        }));
    }
    (points, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_edge_has_two_sides() {
        for body in BODIES {
            let (points, triangles) = (body.shape)();
            let mut edges = BTreeSet::new();
            for t in &triangles {
                for k in 0..3 {
                    assert!(edges.insert((t[k], t[(k + 1) % 3])), "{}", body.name);
                }
            }
            assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))));
            let used: BTreeSet<u32> = triangles.iter().flatten().copied().collect();
            assert_eq!(used.len(), points.len(), "{}", body.name);
            for p in points {
                let length = p.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt();
                assert!(length < body.radius * 1.000_001, "{} {p:?}", body.name);
            }
        }
    }
}
