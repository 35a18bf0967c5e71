//! Closed bodies, and rays at them from inside and outside.

use super::meshes::{IndexedMesh, point, quads, split, unit};
use geom::{Animation, Point, Ray};
use glam::{DAffine3, DMat3};
use proptest::array::uniform3;
use proptest::collection::vec;
use proptest::prelude::*;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Target of a ray at a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BodyTarget {
    /// A point on an edge, rounded to single precision.
    Edge,
    /// A vertex.
    Vertex,
    /// A random point.
    Random,
}

/// A kind of rays at a body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyRayKind {
    pub(crate) target: BodyTarget,
    /// Whether rays start inside the body.
    pub(crate) is_inside: bool,
}

impl BodyRayKind {
    /// Returns kind `i % 6`: the three targets from inside, then the three from outside.
    pub(crate) fn nth(i: usize) -> Self {
        Self {
            target: [BodyTarget::Edge, BodyTarget::Vertex, BodyTarget::Random][i % 3],
            is_inside: (i / 3).is_multiple_of(2),
        }
    }
}

/// A closed body around the origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClosedBody {
    pub(crate) name: &'static str,
    pub(crate) shape: fn() -> IndexedMesh,
    /// Maps an angle and a point of the cube `-1..1` to a point inside the body. The point stays inside if coordinates
    /// change by a few hundredths.
    inner: fn(f64, [f64; 3]) -> [f64; 3],
    /// Upper bound of the distance of vertices from the origin.
    pub(crate) radius: f64,
}

/// A round body, a concave one, one with coplanar faces, and a thin one.
pub(crate) const BODIES: &[ClosedBody] = &[
    ClosedBody {
        name: "icosphere",
        shape: || icosphere(2),
        inner: |_, p| p.map(|x| 0.3 * x),
        radius: 1.0,
    },
    ClosedBody {
        name: "torus",
        shape: || torus(24, 12),
        inner: |angle, [x, y, z]| {
            let (sin, cos) = libm::sincos(angle);
            [cos + 0.1 * x, sin + 0.1 * y, 0.1 * z]
        },
        radius: 1.0 + TUBE,
    },
    ClosedBody {
        name: "box",
        shape: || cuboid(2),
        inner: |_, p| p.map(|x| 0.5 * x),
        radius: 1.75,
    },
    ClosedBody {
        name: "needle",
        shape: || {
            let (points, triangles) = icosphere(1);
            let stretch = |p: Point| std::array::from_fn(|i| p[i] * [0.5, 0.5, 50.0][i]);
            (points.into_iter().map(stretch).collect(), triangles)
        },
        inner: |_, [x, y, z]| [0.1 * x, 0.1 * y, 20.0 * z],
        radius: 50.0,
    },
];

/// A body whose triangles are shuffled, at a new position and optionally rotated.
#[derive(Clone, Debug)]
pub(crate) struct PlacedBody {
    pub(crate) body: &'static ClosedBody,
    points: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    /// Transform from the body's space to the scene's.
    to_scene: DAffine3,
}

/// A body that is moved by `offset` plus a random distance below 1 along each axis. If `is_turned`, it is also rotated,
/// so that rounding makes flat faces uneven.
pub(crate) fn placed_body(
    body: &'static ClosedBody,
    offset: f32,
    is_turned: bool,
) -> impl Strategy<Value = PlacedBody> {
    let (points, triangles) = (body.shape)();
    let orders = vec(Just([0, 1, 2]).prop_shuffle(), triangles.len());
    let numbers = (
        Just(triangles).prop_shuffle(),
        orders,
        [0.0..TAU, 0.0..TAU],
        uniform3((0.0..1.0, any::<bool>())),
    );
    let placed = numbers.prop_map(move |(mut triangles, orders, turns, moves)| {
        for (triangle, order) in triangles.iter_mut().zip(orders) {
            *triangle = order.map(|k: usize| triangle[k]);
        }
        let rotation = rotation(turns.map(|turn| if is_turned { turn } else { 0.0 }));
        let centre = moves.map(|(more, is_negative)| {
            let sign = if is_negative { -1.0 } else { 1.0 };
            sign * (f64::from(offset) + more)
        });
        let to_scene = DAffine3::from_mat3_translation(rotation, centre.into());
        let points = points.iter().map(|p| placed(&to_scene, p.map(f64::from)));
        PlacedBody {
            body,
            points: points.collect(),
            triangles,
            to_scene,
        }
    });
    placed.no_shrink()
}

/// Returns the rotation by the first angle about the z axis, followed by the second about the x axis.
fn rotation(angles: [f64; 2]) -> DMat3 {
    let [(s, c), (t, d)] = angles.map(libm::sincos);
    let about_z = DMat3::from_cols_array(&[c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0]);
    let about_x = DMat3::from_cols_array(&[1.0, 0.0, 0.0, 0.0, d, t, 0.0, -t, d]);
    about_x * about_z
}

/// Random numbers that describe a ray at a body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyRay {
    pub(crate) kind: BodyRayKind,
    /// Number that selects the triangle of the target, modulo the number of triangles.
    triangle: u32,
    /// Edge or vertex of the triangle.
    part: usize,
    /// Position on the edge.
    weight: f32,
    angle: f64,
    inner: [f64; 3],
    /// Directions of length 1.
    directions: [[f64; 3]; 2],
    /// Random numbers from 0 to 1, for the distances of the start and of a random target from the body's centre.
    distances: [f64; 2],
}

/// Rays of a kind.
pub(crate) fn body_rays(kind: BodyRayKind) -> impl Strategy<Value = BodyRay> {
    let target = (any::<u32>(), 0..3_usize, 0.0_f32..1.0);
    let places = (
        0.0..TAU,
        point(),
        [direction(), direction()],
        [0.0..1.0, 0.0..1.0],
    );
    let numbers = (target, places).prop_map(move |(target, places)| {
        let (triangle, part, weight) = target;
        let (angle, inner, directions, distances) = places;
        BodyRay {
            kind,
            triangle,
            part,
            weight,
            angle,
            inner,
            directions,
            distances,
        }
    });
    numbers.no_shrink()
}

impl PlacedBody {
    /// Returns the static body as an animation.
    pub(crate) fn animation(&self) -> Arc<Animation> {
        let animation = Animation::new(vec![self.points.clone()], self.triangles.clone());
        Arc::new(animation.expect("bodies use only their own vertices"))
    }

    /// Returns the described ray at the body.
    pub(crate) fn ray(&self, ray: &BodyRay) -> Ray {
        let BodyRayKind { target, is_inside } = ray.kind;
        let radius = self.body.radius;
        let place = |p| placed(&self.to_scene, p);
        let [from, to] = ray.directions;
        let origin = if is_inside {
            place((self.body.inner)(ray.angle, ray.inner))
        } else {
            let far = radius * (1.5 + 2.0 * ray.distances[0]);
            place(from.map(|x| x * far))
        };
        let corners = self.triangles[ray.triangle as usize % self.triangles.len()];
        let vertex = |k: usize| self.points[corners[k % 3] as usize];
        let at: Point = match target {
            BodyTarget::Vertex => vertex(ray.part),
            BodyTarget::Edge => {
                let (a, b) = (vertex(ray.part), vertex(ray.part + 1));
                std::array::from_fn(|i| a[i] + ray.weight * (b[i] - a[i]))
            }
            BodyTarget::Random if is_inside => {
                std::array::from_fn(|i| origin[i] + (to[i] * radius) as f32)
            }
            BodyTarget::Random => place(to.map(|x| x * radius * ray.distances[1])),
        };
        Ray::new(origin, std::array::from_fn(|i| at[i] - origin[i]))
    }
}

/// Transforms a point, and rounds once to single precision.
fn placed(to_scene: &DAffine3, p: [f64; 3]) -> Point {
    to_scene.transform_point3(p.into()).as_vec3().to_array()
}

/// Uniformly distributed directions of length 1.
fn direction() -> impl Strategy<Value = [f64; 3]> {
    (unit(), 0.0..TAU).prop_map(|(z, angle): (f64, f64)| {
        let (sin, cos) = libm::sincos(angle);
        let r = (1.0 - z * z).sqrt();
        [r * cos, r * sin, z]
    })
}

/// Radius of the torus's tube.
const TUBE: f64 = 0.4;

/// Vertex indices of the triangles.
const ICOSAHEDRON: [u32; 60] = [
    0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4, 11, 10, 2, 10, 7, 6, 7, 1,
    8, 3, 9, 4, 3, 4, 2, 3, 2, 6, 3, 6, 8, 3, 8, 9, 4, 9, 5, 2, 4, 11, 6, 2, 10, 8, 6, 7, 9, 8, 1,
];

/// Returns an icosahedron whose faces are split `n` times.
pub(crate) fn icosphere(n: u32) -> IndexedMesh {
    let phi = f32::midpoint(1.0, 5.0_f32.sqrt());
    let corners = |i: usize| {
        [[-1.0, phi], [1.0, phi], [-1.0, -phi], [1.0, -phi]].map(|[a, b]| {
            let mut p = [0.0; 3];
            (p[i], p[(i + 1) % 3]) = (a, b);
            normalized(p)
        })
    };
    // Vertices 0..4 are in the plane x-y, 4..8 in y-z, 8..12 in z-x.
    let points = (0..3).flat_map(corners).collect();
    let triangles = ICOSAHEDRON.as_chunks::<3>().0.to_vec();
    (0..n).fold((points, triangles), |shape, _| {
        split(shape, |a, b| {
            normalized(std::array::from_fn(|i| a[i] + b[i]))
        })
    })
}

fn normalized(p: Point) -> Point {
    let length = p.iter().map(|x| x * x).sum::<f32>().sqrt();
    p.map(|x| x / length)
}

/// Returns a torus of `around` rings with `along` vertices each.
fn torus(around: u32, along: u32) -> IndexedMesh {
    let angle = |i: u32, n: u32| TAU * f64::from(i) / f64::from(n);
    let point = |i, j| {
        let [(s, c), (t, d)] = [angle(i, around), angle(j, along)].map(libm::sincos);
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
fn cuboid(n: u32) -> IndexedMesh {
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
    use crate::generate::strategies::sample;
    use crate::stage::triangles;

    #[test]
    fn placed_bodies_have_no_degenerate_triangles() {
        for (body, offset) in BODIES
            .iter()
            .flat_map(|b| [0.0, 10.0, 1e3, 1e5].map(|o| (b, o)))
        {
            let moved = sample(&placed_body(body, offset, true), 3).animation();
            assert!(!triangles(&moved, 0.0).iter().any(geom::is_degenerate));
        }
    }
}
