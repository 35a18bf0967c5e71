//! The shadow ray from a hit to a light.

use crate::geometry::Geometry;
use crate::scale::{Scale, flushed};
use geom::{Aabb, Hit, Point, Ray, Triangle};

/// Half a unit in the last place of numbers in `[1, 2)`.
pub const ROUNDING: f32 = 1.0 / 16_777_216.0;

/// Data that all shadow rays of a picture share.
#[derive(Clone, Copy, Debug)]
pub struct Light {
    /// Position in scaled units.
    pub scaled_position: Point,
    /// Position in the scene's units.
    pub position: Point,
    /// Longest edge of the root box, limited by [`geom::CoordinateRange::clearance`], in scaled units. Offsets of
    /// shadow rays grow with the larger of this and the triangle's size.
    pub extent: f32,
}

impl Light {
    /// Creates a light at `position`, in the scene's units. `root` is the tree's root box, in scaled units.
    pub fn new(position: Point, geometry: &Geometry<'_>, root: &Aabb) -> Self {
        let [x, y, z] = root.extent();
        let extent = x.max(y).max(z);
        let limit = geometry.range.clearance * geometry.scale.factor();
        Self {
            scaled_position: geometry.scale.apply(position),
            position,
            extent: extent.min(limit),
        }
    }

    /// Returns the shadow ray from a hit to the light, with `t` in `(0, 1)`, in scaled units. Its origin is offset from
    /// the hit, towards the light's side of the triangle.
    ///
    /// `corners` are those of the hit triangle, and `eye` is the origin of the ray that hit it. Both are scaled.
    pub fn ray(&self, hit: &Hit, [a, b, c]: &Triangle, eye: Point) -> Ray {
        let (e1, e2) = (minus(*b, *a), minus(*c, *a));
        let p = Scale::ONE.apply(std::array::from_fn(|i| {
            a[i] + (hit.u * e1[i] + hit.v * e2[i])
        }));
        let normal = cross(e1, e2);
        let side = match sign(dot(normal, minus(self.scaled_position, p))) {
            0.0 => sign(dot(normal, minus(eye, p))),
            side => side,
        };
        let largest = p[0].abs().max(p[1].abs()).max(p[2].abs());
        let longest = e1.iter().chain(&e2).fold(0.0_f32, |m, x| m.max(x.abs()));
        let extent = self.extent.max(longest);
        let delta = 4.0 * ROUNDING * largest + 32.0 * ROUNDING * extent;
        let origin = std::array::from_fn(|i| p[i] + side * sign(normal[i]) * delta);
        Ray {
            t_max: 1.0,
            ..Ray::new(origin, minus(self.scaled_position, origin))
        }
    }
}

fn minus(a: Point, b: Point) -> Point {
    std::array::from_fn(|i| a[i] - b[i])
}

fn dot(a: Point, b: Point) -> f32 {
    let [x, y, z]: Point = std::array::from_fn(|i| flushed(a[i] * b[i]));
    (x + y) + z
}

fn cross(a: Point, b: Point) -> Point {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        flushed(a[j] * b[k] - a[k] * b[j])
    })
}

/// Returns 1, -1, or 0 for zero and NaN.
fn sign(x: f32) -> f32 {
    f32::from(i8::from(x > 0.0) - i8::from(x < 0.0))
}
