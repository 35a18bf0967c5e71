//! How time, memory and start-up grow with the number of triangles: a curve for each update policy in each layout.

mod panels;
mod table;
#[cfg(test)]
mod tests;

use crate::data::{Machine, known};
use serde::{Deserialize, Serialize};

pub use panels::growth_svg;
pub use table::{growth_csv, growth_json};

/// All that one chart of growth shows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Growth {
    /// Heading.
    pub title: String,
    /// What did the work.
    pub machine: Machine,
    /// What was traced, whatever its size.
    pub scene: String,
    /// Pixels of a frame: width, height.
    pub size: [u32; 2],
    /// Key frames that the motion goes on from a frame to the next.
    pub speed: f64,
    /// What was measured, in any order.
    pub points: Vec<GrowthPoint>,
    /// What was left out, and why.
    #[serde(default)]
    pub left_out: Vec<String>,
}

/// One policy in one layout at one size. Times are milliseconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GrowthPoint {
    /// Triangles.
    pub triangles: u64,
    /// Name of the update policy; shown by colour and shape.
    pub update: String,
    /// Name of the tree's layout; shown by fill.
    pub layout: String,
    /// Of a frame, by the host's clock.
    pub frame_ms: Option<f64>,
    /// Of a frame's stages before its rays, by the device's clock.
    pub geometry_ms: Option<f64>,
    /// Of a frame's rays, by the device's clock.
    pub trace_ms: Option<f64>,
    /// Of the first frame, which waits for the first tree.
    pub first_ms: Option<f64>,
    /// Of the first tree's build on the host.
    pub build_ms: Option<f64>,
    /// Memory on the device.
    pub device_bytes: Option<u64>,
    /// Of that, the tree and the triangles' records.
    #[serde(default)]
    pub tree_bytes: Option<u64>,
    /// Of that, room in which trees are made or wait to be sent.
    #[serde(default)]
    pub scratch_bytes: Option<u64>,
    /// Of that, the scene itself: key frames, positions, which vertices are a triangle's.
    #[serde(default)]
    pub scene_bytes: Option<u64>,
    /// Of that, rays, hits and what else a frame needs.
    #[serde(default)]
    pub frame_bytes: Option<u64>,
    /// Seconds that the device was warmed up before the second frame.
    #[serde(default)]
    pub warm_up_s: Option<f64>,
    /// Frames that were timed, the first included.
    pub frames: u64,
    /// Whether the run was ended before all its frames were done.
    pub cut_short: bool,
}

impl GrowthPoint {
    /// Bytes of device memory a triangle.
    #[must_use]
    pub fn bytes_per_triangle(&self) -> Option<f64> {
        self.a_triangle(self.device_bytes)
    }

    /// So many bytes of it a triangle.
    #[must_use]
    pub fn a_triangle(&self, bytes: Option<u64>) -> Option<f64> {
        known(Some(bytes? as f64 / self.triangles as f64))
    }
}
