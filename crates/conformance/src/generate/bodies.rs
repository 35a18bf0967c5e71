//! Closed bodies, and rays at them from inside and outside.

use super::meshes::{Mesh, quads, split};
use fastrand::Rng;
use geom::{Animation, Point, Ray};
use glam::{DAffine3, DMat3};
use std::f64::consts::TAU;
use std::sync::Arc;

backend::named! {
    /// Target of a ray.
    pub enum Aim {
        /// A point on an edge, as close as its coordinates can be.
        Edge = "an edge",
        /// A vertex.
        Vertex = "a vertex",
        /// A random point.
        Random = "random",
    }
}

/// A sort of rays at a body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RaySort {
    pub(crate) aim: Aim,
    /// Whether rays start inside the body.
    pub(crate) is_inside: bool,
}

impl RaySort {
    /// All sorts, which are used in rotation.
    pub(crate) const ALL: [Self; 6] = {
        const fn of(aim: Aim, is_inside: bool) -> RaySort {
            RaySort { aim, is_inside }
        }
        [
            of(Aim::Edge, true),
            of(Aim::Vertex, true),
            of(Aim::Random, true),
            of(Aim::Edge, false),
            of(Aim::Vertex, false),
            of(Aim::Random, false),
        ]
    };
}

/// A closed body around the origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClosedBody {
    pub(crate) name: &'static str,
    pub(crate) shape: fn() -> Mesh,
    /// Returns a random point that stays inside even if all coordinates are off by a few hundredths.
    pub(crate) inner: fn(&mut Rng) -> [f64; 3],
    /// Upper bound of the distance of vertices from the origin.
    pub(crate) radius: f64,
}

/// Bodies that are round, not convex, with coplanar faces, and thin.
pub(crate) const BODIES: &[ClosedBody] = &[
    ClosedBody {
        name: "icosphere",
        shape: || icosphere(2),
        inner: |rng| near([0.0; 3], [0.3; 3], rng),
        radius: 1.0,
    },
    ClosedBody {
        name: "torus",
        shape: || torus(24, 12),
        inner: |rng| {
            let (sin, cos) = (TAU * rng.f64()).sin_cos();
            near([cos, sin, 0.0], [0.1; 3], rng)
        },
        radius: 1.0 + TUBE,
    },
    ClosedBody {
        name: "box",
        shape: || cuboid(2),
        inner: |rng| near([0.0; 3], [0.5; 3], rng),
        radius: 1.75,
    },
    ClosedBody {
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

/// A body whose triangles are shuffled, at a new position and optionally rotated.
pub(crate) struct PlacedBody<'a> {
    body: &'a ClosedBody,
    points: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    /// Transform from the body's space to the scene's.
    to_scene: DAffine3,
}

impl<'a> PlacedBody<'a> {
    /// Moves a body by `offset` plus a random distance below 1 along each axis. Flat faces stay flat unless the body is
    /// turned.
    pub(crate) fn new(body: &'a ClosedBody, offset: f32, is_turned: bool, rng: &mut Rng) -> Self {
        let (points, mut triangles) = (body.shape)();
        rng.shuffle(&mut triangles);
        triangles.iter_mut().for_each(|t| rng.shuffle(t));
        let [a, b] = [(); 2].map(|()| if is_turned { TAU * rng.f64() } else { 0.0 });
        let rotation = DMat3::from_rotation_x(b) * DMat3::from_rotation_z(a);
        let centre = [(); 3].map(|()| {
            let sign = if rng.bool() { 1.0 } else { -1.0 };
            sign * (f64::from(offset) + rng.f64())
        });
        let to_scene = DAffine3::from_mat3_translation(rotation, centre.into());
        let placed = |p: Point| placed(&to_scene, p.map(f64::from));
        Self {
            body,
            points: points.into_iter().map(placed).collect(),
            triangles,
            to_scene,
        }
    }

    /// Returns the static body as an animation.
    pub(crate) fn animation(&self) -> Arc<Animation> {
        let animation = Animation::new(vec![self.points.clone()], self.triangles.clone());
        Arc::new(animation.expect("bodies name their own vertices"))
    }

    /// Returns a ray of a sort at the body.
    pub(crate) fn ray(&self, sort: RaySort, rng: &mut Rng) -> Ray {
        let RaySort { aim, is_inside } = sort;
        let radius = self.body.radius;
        let place = |p| placed(&self.to_scene, p);
        let origin = if is_inside {
            place((self.body.inner)(rng))
        } else {
            let far = radius * (1.5 + 2.0 * rng.f64());
            place(sphere(rng).map(|x| x * far))
        };
        let vertex = |i: u32| self.points[i as usize];
        let corners = self.triangles[rng.usize(..self.triangles.len())];
        let k = rng.usize(..3);
        let at: Point = match aim {
            Aim::Vertex => vertex(corners[k]),
            Aim::Edge => {
                let (a, b, s) = (vertex(corners[k]), vertex(corners[(k + 1) % 3]), rng.f32());
                std::array::from_fn(|i| a[i] + s * (b[i] - a[i]))
            }
            Aim::Random if is_inside => {
                let far = sphere(rng);
                std::array::from_fn(|i| origin[i] + (far[i] * radius) as f32)
            }
            Aim::Random => {
                let reach = radius * rng.f64();
                place(sphere(rng).map(|x| x * reach))
            }
        };
        Ray::new(origin, std::array::from_fn(|i| at[i] - origin[i]))
    }
}

/// Transforms a point, and rounds once to single precision.
fn placed(to_scene: &DAffine3, p: [f64; 3]) -> Point {
    to_scene.transform_point3(p.into()).as_vec3().to_array()
}

/// Returns a uniformly distributed direction of length 1.
fn sphere(rng: &mut Rng) -> [f64; 3] {
    let z = 2.0 * rng.f64() - 1.0;
    let (sin, cos) = (TAU * rng.f64()).sin_cos();
    let r = (1.0 - z * z).sqrt();
    [r * cos, r * sin, z]
}

/// Radius of the torus's tube.
const TUBE: f64 = 0.4;

/// Returns a random point within `reach` of `centre` along each axis.
fn near(centre: [f64; 3], reach: [f64; 3], rng: &mut Rng) -> [f64; 3] {
    std::array::from_fn(|i| centre[i] + reach[i] * (2.0 * rng.f64() - 1.0))
}

/// Vertex indices of the triangles.
const ICOSAHEDRON: [u32; 60] = [
    0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4, 11, 10, 2, 10, 7, 6, 7, 1,
    8, 3, 9, 4, 3, 4, 2, 3, 2, 6, 3, 6, 8, 3, 8, 9, 4, 9, 5, 2, 4, 11, 6, 2, 10, 8, 6, 7, 9, 8, 1,
];

/// Returns an icosahedron whose faces are split `n` times.
pub(crate) fn icosphere(n: u32) -> Mesh {
    let phi = f32::midpoint(1.0, 5.0_f32.sqrt());
    let corners = |i: usize| {
        [[-1.0, phi], [1.0, phi], [-1.0, -phi], [1.0, -phi]].map(|[a, b]| {
            let mut p = [0.0; 3];
            (p[i], p[(i + 1) % 3]) = (a, b);
            unit(p)
        })
    };
    // Vertices 0..4 are in the plane x-y, 4..8 in y-z, 8..12 in z-x.
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

/// Returns a torus of `around` rings with `along` vertices each.
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

/// Returns the cube `-1..=1`, with its faces split `n` times.
fn cuboid(n: u32) -> Mesh {
    let corner = |i: u32| [0, 1, 2].map(|axis| (2 * (i >> axis & 1)) as f32 - 1.0);
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let halves = sides.map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).concat();
    let whole = ((0..8).map(corner).collect(), halves);
    (0..n).fold(whole, |mesh, _| {
        split(mesh, |a, b| {
            std::array::from_fn(|i| f32::midpoint(a[i], b[i]))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaks::OFFSETS;
    use crate::stage::triangles;

    #[test]
    fn placed_bodies_have_no_degenerate_triangles() {
        for (body, offset) in BODIES.iter().flat_map(|b| OFFSETS.map(|o| (b, o))) {
            let moved = PlacedBody::new(body, offset, true, &mut Rng::with_seed(3)).animation();
            assert!(!triangles(&moved, 0.0).iter().any(geom::is_degenerate));
        }
    }
}
