//! Möller and Trumbore's test, as published. It leaks near edges.
//!
//! *Fast, Minimum Storage Ray/Triangle Intersection* (1997), without culling and without its epsilon.

use super::{Meeting, Record, TriangleTest};
use crate::scale::PreparedRay;
use geom::Triangle;
use glam::Vec3A;

/// Möller, Trumbore 1997. A record holds the first vertex and the edges to the other two.
pub struct MollerTrumbore;

/// A ray as two vectors.
#[derive(Clone, Copy, Debug)]
pub struct RayVectors {
    origin: Vec3A,
    direction: Vec3A,
}

impl TriangleTest for MollerTrumbore {
    type Ray = RayVectors;

    #[inline]
    fn record(corners: &Triangle) -> Record {
        let [a, b, c] = corners.map(Vec3A::from_array);
        Record([a, b - a, c - a].map(|v| v.extend(0.0).to_array()))
    }

    #[inline]
    fn prepare(ray: &PreparedRay) -> RayVectors {
        RayVectors {
            origin: Vec3A::from_array(ray.origin),
            direction: Vec3A::from_array(ray.direction),
        }
    }

    #[inline(always)]
    fn meet(ray: &RayVectors, record: &Record) -> Option<Meeting> {
        let [a, e1, e2] = record.0.map(|row| Vec3A::from_vec4(row.into()));
        let p = ray.direction.cross(e2);
        let inverse = 1.0 / dot(e1, p);
        let s = ray.origin - a;
        let u = dot(s, p) * inverse;
        let q = s.cross(e1);
        let v = dot(ray.direction, q) * inverse;
        // A determinant of zero makes u or v infinite or NaN, so the comparison fails.
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| Meeting {
            t: dot(e2, q) * inverse,
            u,
            v,
        })
    }
}

/// Adds up in a fixed order, as the vectors of `cpu-simd` do.
#[inline(always)]
fn dot(a: Vec3A, b: Vec3A) -> f32 {
    let p = a * b;
    (p.x + p.y) + p.z
}
