//! What a ray met.

use bytemuck::{Pod, Zeroable};

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
    #[must_use]
    #[inline]
    pub fn is_hit(&self) -> bool {
        self.triangle != u32::MAX
    }

    /// The order that makes the answer independent of any tree: least `t`, then least index.
    #[must_use]
    #[inline]
    pub fn is_before(&self, other: &Self) -> bool {
        self.t < other.t || (self.t == other.t && self.triangle < other.triangle)
    }
}
