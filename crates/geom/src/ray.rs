//! Rays and hits.

use crate::Point;
use bytemuck::{Pod, Zeroable};

/// Ray `origin + t * direction` with the open interval `(t_min, t_max)`.
///
/// The direction may have any length except zero. `t` counts multiples of the direction.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Ray {
    /// Start point.
    pub origin: Point,
    /// Exclusive lower bound of `t`.
    pub t_min: f32,
    /// Direction of any length except zero.
    pub direction: Point,
    /// Exclusive upper bound of `t`; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// Ray that hits nothing, because its direction is zero.
    pub const VOID: Self = Self {
        origin: [0.0; 3],
        t_min: 0.0,
        direction: [0.0; 3],
        t_max: f32::INFINITY,
    };

    /// Creates a ray over `(0, inf)`.
    #[must_use]
    pub fn new(origin: Point, direction: Point) -> Self {
        Self {
            origin,
            t_min: 0.0,
            direction,
            t_max: f32::INFINITY,
        }
    }

    /// Returns whether the ray can hit anything.
    ///
    /// A valid ray has a finite origin, a finite non-zero direction, and an interval that is not empty. Every other ray
    /// misses.
    pub fn is_valid(&self) -> bool {
        self.origin.iter().all(|x| x.is_finite())
            && self.direction.iter().all(|x| x.is_finite())
            && self.direction.iter().any(|&x| x != 0.0)
            && self.t_min < self.t_max
    }
}

/// Closest hit of one ray, or [`Hit::MISS`]. 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Hit {
    /// Distance in multiples of the ray's direction.
    pub t: f32,
    /// Weight of the triangle's second vertex.
    pub u: f32,
    /// Weight of the triangle's third vertex.
    pub v: f32,
    /// Index of the triangle in the scene; `u32::MAX` for a miss.
    pub triangle: u32,
}

impl Hit {
    /// Result of a ray that hits no triangle.
    pub const MISS: Self = Self {
        t: f32::INFINITY,
        u: 0.0,
        v: 0.0,
        triangle: u32::MAX,
    };

    /// Returns whether a triangle was hit.
    #[inline]
    pub fn is_hit(&self) -> bool {
        self.triangle != u32::MAX
    }

    /// Returns whether `self` precedes `other`: smaller `t`, then smaller index. This order makes the result
    /// independent of the tree.
    #[inline]
    pub fn is_before(&self, other: &Self) -> bool {
        self.t < other.t || (self.t == other.t && self.triangle < other.triangle)
    }
}
