//! Möller and Trumbore's test, without its epsilon. It leaks near edges.
//!
//! *Fast, Minimum Storage Ray/Triangle Intersection* (1997), without culling.

use super::triangle_data::{TriangleData, TriangleHit};
use crate::scale::PreparedRay;
use geom::Triangle;
use glam::Vec3;

/// The test of Möller, Trumbore 1997. [`TriangleData`] holds the first vertex and the edges to the other two.
#[derive(Clone, Copy, Debug)]
pub struct MollerTrumbore;

impl MollerTrumbore {
    pub(crate) fn preprocess(corners: &Triangle) -> TriangleData {
        let [a, b, c] = corners.map(Vec3::from_array);
        TriangleData([a, b - a, c - a].map(|v| v.extend(0.0).to_array()))
    }

    #[inline]
    pub(crate) fn intersect(ray: &PreparedRay, data: &TriangleData) -> Option<TriangleHit> {
        let [origin, direction] = [ray.origin, ray.direction].map(Vec3::from_array);
        let [a, e1, e2] = data.0.map(|[x, y, z, _]| Vec3::new(x, y, z));
        let p = direction.cross(e2);
        let inverse = 1.0 / e1.dot(p);
        let s = origin - a;
        let u = s.dot(p) * inverse;
        let q = s.cross(e1);
        let v = direction.dot(q) * inverse;
        // A determinant of zero makes u or v infinite or NaN, so the comparison fails.
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| TriangleHit {
            t: e2.dot(q) * inverse,
            u,
            v,
        })
    }
}
