//! Data that the triangle tests read and return.

/// A preprocessed triangle: three rows of four floats, 48 bytes. Each test defines the meaning of the rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub struct TriangleData(pub [[f32; 4]; 3]);

/// Intersection of a ray with a triangle, before `t` is clamped to the triangle's box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Distance in scaled units.
    pub t: f32,
    /// Weight of the second vertex.
    pub u: f32,
    /// Weight of the third vertex.
    pub v: f32,
}
