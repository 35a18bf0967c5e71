//! The triangles of a scene at one moment.

use crate::scale::Scale;
use geom::{CoordinateRange, Point, Triangle};
use std::ops::Add;

/// The triangles of a scene at one moment.
#[derive(Clone, Copy, Debug)]
pub struct Geometry<'a> {
    /// Position of each vertex, in the scene's units.
    pub positions: &'a [Point],
    /// Three vertex indices per triangle.
    pub triangles: &'a [[u32; 3]],
    /// Conversion to scaled units.
    pub scale: Scale,
    /// Range of the coordinates at this moment.
    pub range: CoordinateRange,
}

impl Geometry<'_> {
    /// Returns a triangle's corners in the scene's units.
    #[inline]
    pub fn corners(&self, triangle: u32) -> Triangle {
        self.triangles[triangle as usize].map(|v| self.positions[v as usize])
    }

    /// Returns a triangle's corners in scaled units.
    #[inline]
    pub fn scaled_corners(&self, triangle: u32) -> Triangle {
        self.corners(triangle).map(|p| self.scale.apply(p))
    }
}

/// Counts of leaves that no ray can hit, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unhittable {
    /// Leaves with a corner that is not finite.
    pub inactive: u64,
    /// Active leaves of zero area.
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
