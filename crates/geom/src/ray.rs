//! Rays.

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
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.origin.iter().all(|x| x.is_finite())
            && self.direction.iter().all(|x| x.is_finite())
            && self.direction.iter().any(|&x| x != 0.0)
            && self.t_min < self.t_max
    }
}
