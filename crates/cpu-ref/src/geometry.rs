//! Where triangles are at one moment, and which of them can be hit.

use crate::scale::Scale;
use geom::{Point, Range, Ray, Triangle};
use std::ops::Add;

/// Leaves that are never hit, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unhittable {
    /// A corner is not finite.
    pub inactive: u64,
    /// Active, but of zero area.
    pub degenerate: u64,
}

impl Add for Unhittable {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            inactive: self.inactive + other.inactive,
            degenerate: self.degenerate + other.degenerate,
        }
    }
}

/// Where triangles are.
#[derive(Clone, Copy, Debug)]
pub struct Geometry<'a> {
    /// One a vertex, in the scene's units.
    pub positions: &'a [Point],
    /// Three vertices a triangle.
    pub triangles: &'a [[u32; 3]],
    /// To scaled units.
    pub scale: Scale,
    /// How far coordinates reach at this moment.
    pub range: Range,
}

impl Geometry<'_> {
    /// A triangle's corners in the scene's units.
    #[inline]
    pub fn corners(&self, triangle: u32) -> Triangle {
        self.triangles[triangle as usize].map(|v| self.positions[v as usize])
    }

    /// Whether the ray is beyond what rounded tests can tell.
    #[inline]
    pub fn is_extreme(&self, ray: &Ray) -> bool {
        self.range.is_extreme(self.scale.apply(ray.origin))
    }

    /// A triangle's corners in scaled units.
    #[inline]
    pub fn scaled_corners(&self, triangle: u32) -> Triangle {
        self.corners(triangle).map(|p| self.scale.apply(p))
    }
}
