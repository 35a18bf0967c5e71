//! Woop's test: an affine transform maps each triangle to the unit triangle. It leaks near edges.
//!
//! Woop, *A Ray Tracing Hardware Architecture for Dynamic Scenes* (2004).
//! The third row is the unit normal. The normal over its squared length loses
//! small triangles.

use super::{Meeting, Record, TriangleTest};
use crate::scale::PreparedRay;
use geom::Triangle;
use glam::{Vec3A, Vec4};

/// Woop 2004. A record holds the rows of the transform, each a vector and an offset.
pub struct Woop;

/// A ray as a point, with last component 1, and a vector, with last component 0.
#[derive(Clone, Copy, Debug)]
pub struct RayVectors {
    origin: Vec4,
    direction: Vec4,
}

impl TriangleTest for Woop {
    type Ray = RayVectors;

    #[inline]
    fn record(corners: &Triangle) -> Record {
        let [a, b, c] = corners.map(Vec3A::from_array);
        let (e1, e2) = (b - a, c - a);
        let normal = e1.cross(e2);
        let largest = normal.abs().max_element();
        // The normal was rounded to zero though the area is not zero. A record of zeros is never hit.
        if largest == 0.0 {
            return Record::default();
        }
        let shape = normal / largest;
        let length = shape.length();
        let (unit, area) = (shape / length, length * largest);
        let rows = [e2.cross(unit) / area, unit.cross(e1) / area, unit];
        Record(rows.map(|row| row.extend(-row.dot(a)).to_array()))
    }

    #[inline]
    fn prepare(ray: &PreparedRay) -> RayVectors {
        RayVectors {
            origin: Vec3A::from_array(ray.origin).extend(1.0),
            direction: Vec3A::from_array(ray.direction).extend(0.0),
        }
    }

    #[inline(always)]
    fn meet(ray: &RayVectors, record: &Record) -> Option<Meeting> {
        let [to_u, to_v, to_height] = record.0.map(Vec4::from_array);
        let t = -dot(to_height, ray.origin) / dot(to_height, ray.direction);
        let u = dot(to_u, ray.origin) + t * dot(to_u, ray.direction);
        let v = dot(to_v, ray.origin) + t * dot(to_v, ray.direction);
        // For a ray parallel to the plane, t is infinite or NaN, and so are u and v: no hit.
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then_some(Meeting { t, u, v })
    }
}

/// Adds up in a fixed order, as the vectors of `cpu-simd` do.
#[inline(always)]
fn dot(a: Vec4, b: Vec4) -> f32 {
    let p = a * b;
    (p.x + p.z) + (p.y + p.w)
}
