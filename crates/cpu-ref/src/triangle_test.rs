//! What every ray-triangle test has in common.

use crate::extreme::Rule;
use crate::ray::PreparedRay;
use geom::Triangle;

/// What `preprocess` keeps of a triangle: 48 bytes, three rows of four, each test's own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub(crate) struct Record(pub(crate) [[f32; 4]; 3]);

/// Where a ray meets a triangle, before the clamp to its box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Meeting {
    /// Distance in scaled units.
    pub(crate) t: f32,
    /// Weight of the second vertex.
    pub(crate) u: f32,
    /// Weight of the third vertex.
    pub(crate) v: f32,
}

/// A ray-triangle test, chosen when the program is compiled: loops are made once for each.
pub(crate) trait TriangleTest {
    /// How extreme rays are answered, if in exact arithmetic.
    const EXTREMES: Option<Rule> = None;

    /// What the test needs of a ray.
    type Ray: Copy;

    /// Prepares a triangle in scaled units, active and not degenerate.
    fn record(corners: &Triangle) -> Record;

    /// Prepares a ray.
    fn prepare(ray: &PreparedRay) -> Self::Ray;

    /// Where the ray meets the triangle, anywhere along its line; the caller clamps and limits `t`.
    fn meet(ray: &Self::Ray, record: &Record) -> Option<Meeting>;
}
