//! Woop's test, which Kim and others (2014) use. An affine transform maps each triangle to the unit triangle. The test
//! leaks near edges.
//!
//! Woop, *A Ray Tracing Hardware Architecture for Dynamic Scenes* (2004).
//! The third row of the transform is the unit normal. The inverse of the basis `e1, e2, e1 x e2` would instead have the
//! normal divided by its squared length. For small triangles, this squared length underflows.

use super::triangle_data::{TriangleData, TriangleHit};
use crate::scale::PreparedRay;
use geom::{Point, Triangle};
use glam::Vec3;

/// The test of Woop 2004. [`TriangleData`] holds the rows of the transform, each a vector and an offset.
#[derive(Clone, Copy, Debug)]
pub struct Woop;

impl Woop {
    /// Preprocesses a triangle.
    #[inline]
    pub fn preprocess(corners: &Triangle) -> TriangleData {
        let [a, b, c] = corners.map(Vec3::from_array);
        let (e1, e2) = (b - a, c - a);
        let normal = e1.cross(e2);
        let largest = normal.abs().max_element();
        // The normal was rounded to zero though the area is not zero. Data of zeros are never hit.
        if largest == 0.0 {
            return TriangleData::default();
        }
        let shape = normal / largest;
        let length = shape.length();
        let (unit, area) = (shape / length, length * largest);
        let rows = [e2.cross(unit) / area, unit.cross(e1) / area, unit];
        TriangleData(rows.map(|row| row.extend(-row.dot(a)).to_array()))
    }

    #[inline]
    pub(crate) fn intersect(ray: &PreparedRay, data: &TriangleData) -> Option<TriangleHit> {
        let [to_u, to_v, to_height] = &data.0;
        let point = |row| transformed(row, ray.origin, 1.0);
        let vector = |row| transformed(row, ray.direction, 0.0);
        let t = -point(to_height) / vector(to_height);
        let u = point(to_u) + t * vector(to_u);
        let v = point(to_v) + t * vector(to_v);
        // For a ray parallel to the plane, t is infinite or NaN, and so are u and v: no hit.
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then_some(TriangleHit { t, u, v })
    }
}

/// Applies a row to a point (`w` is 1) or a vector (`w` is 0). The order of the sum is that of `cpu-simd`.
#[inline]
fn transformed(row: &[f32; 4], [x, y, z]: Point, w: f32) -> f32 {
    (row[0] * x + row[2] * z) + (row[1] * y + row[3] * w)
}
