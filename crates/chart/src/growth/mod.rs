//! How time, memory and start-up grow with the number of triangles: a curve for each update policy in each layout.

mod panels;
#[cfg(test)]
mod tests;

use crate::data::{Machine, known};

pub use panels::growth_svg;

/// All that one chart of growth shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Growth {
    /// Heading.
    pub title: String,
    /// What did the work.
    pub machine: Machine,
    /// Pixels of a frame: width, height.
    pub size: [u32; 2],
    /// What was measured, in any order.
    pub points: Vec<GrowthPoint>,
}

/// One policy in one layout at one size. Times are milliseconds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GrowthPoint {
    /// Triangles.
    pub triangles: u64,
    /// Name of the update policy; shown by colour and shape.
    pub update: String,
    /// Name of the tree's layout; shown by fill.
    pub layout: String,
    /// Of a frame, by the host's clock.
    pub frame_ms: Option<f64>,
    /// Of the first frame, which waits for the first tree.
    pub first_ms: Option<f64>,
    /// Memory on the device.
    pub device_bytes: Option<u64>,
}

impl GrowthPoint {
    /// Bytes of device memory a triangle.
    #[must_use]
    pub fn bytes_per_triangle(&self) -> Option<f64> {
        known(Some(self.device_bytes? as f64 / self.triangles as f64))
    }
}
