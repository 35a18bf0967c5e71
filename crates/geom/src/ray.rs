//! Rays, and what they met.

use crate::Point;
use bytemuck::{Pod, Zeroable};

/// A ray `origin + t * direction` with the open interval `(t_min, t_max)`.
///
/// The direction may have any length but zero; `t` is in units of it.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Ray {
    /// Start point.
    pub origin: Point,
    /// Hits lie strictly beyond.
    pub t_min: f32,
    /// Direction of any length but zero.
    pub direction: Point,
    /// Hits lie strictly before; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// A ray that hits nothing, as its direction of zero says.
    pub const VOID: Self = Self {
        origin: [0.0; 3],
        t_min: 0.0,
        direction: [0.0; 3],
        t_max: f32::INFINITY,
    };

    /// A ray over `(0, inf)`.
    #[must_use]
    pub fn new(origin: Point, direction: Point) -> Self {
        Self {
            origin,
            t_min: 0.0,
            direction,
            t_max: f32::INFINITY,
        }
    }

    /// Whether the ray can hit anything: finite origin, finite non-zero
    /// direction, and an interval that is not empty. Every other ray misses.
    pub fn is_valid(&self) -> bool {
        self.origin.iter().all(|x| x.is_finite())
            && self.direction.iter().all(|x| x.is_finite())
            && self.direction.iter().any(|&x| x != 0.0)
            && self.t_min < self.t_max
    }
}

/// The closest hit of one ray, or [`Hit::MISS`]. 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Hit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Weight of the triangle's second vertex.
    pub u: f32,
    /// Weight of the triangle's third vertex.
    pub v: f32,
    /// Index of the triangle in the scene; `u32::MAX` for a miss.
    pub triangle: u32,
}

impl Hit {
    /// No triangle was met.
    pub const MISS: Self = Self {
        t: f32::INFINITY,
        u: 0.0,
        v: 0.0,
        triangle: u32::MAX,
    };

    /// Whether a triangle was met.
    #[inline]
    pub fn is_hit(&self) -> bool {
        self.triangle != u32::MAX
    }

    /// The order that makes the answer independent of any tree: least `t`, then least index.
    #[inline]
    pub fn is_before(&self, other: &Self) -> bool {
        self.t < other.t || (self.t == other.t && self.triangle < other.triangle)
    }
}
