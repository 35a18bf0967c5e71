//! The request for a frame, and its statistics.

use backend::{DeviceBytes, FrameReport, Generation, rounded};
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// A frame to render.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Number of the frame in the output.
    #[serde(rename = "frame")]
    pub index: u64,
    /// Time in key frames.
    #[serde(serialize_with = "rounded")]
    pub time: f64,
}

/// Statistics of a frame. The command-line program writes them to its statistics file. Times are in milliseconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Frame that was requested.
    #[serde(flatten)]
    pub frame: Frame,
    /// Report of the backend.
    #[serde(flatten)]
    pub report: FrameReport,
    /// Facts about the tree that the frame was traced with.
    #[serde(flatten)]
    pub tree: FrameTreeStats,
    /// Time that the driver spent on the frame: from its start to the end of its submission, plus the wait for its
    /// results. Frames overlap, so it can be less than the time on the device.
    #[serde(serialize_with = "rounded")]
    pub wall_ms: f64,
    /// Part of `wall_ms` in which the driver was blocked by a build. With `refit`, and with `async` without
    /// `--lockstep`, 0 for every frame except the first.
    #[serde(serialize_with = "rounded")]
    pub build_wait_ms: f64,
    /// Resident bytes of the process; `None` unless the program measures them.
    pub host_bytes: Option<u64>,
    /// Bytes of device memory that the backend held when the frame was finished, if known.
    pub device_bytes: Option<u64>,
    /// The same bytes by purpose.
    #[serde(skip)]
    pub device_memory: Option<DeviceBytes>,
}

impl FrameRecord {
    /// Stores the report of a submission of this frame. Earlier submissions read back vertices. Their device times and
    /// bytes are added. An earlier interpolation time is used if `report` has none.
    pub(crate) fn complete(&mut self, mut report: FrameReport) {
        let (times, read_back) = (&mut report.times, &self.report.times);
        times.interpolate_ms = times.interpolate_ms.or(read_back.interpolate_ms);
        times.device_ms += read_back.device_ms;
        report.readback_bytes += self.report.readback_bytes;
        self.tree.build_ms = self.tree.build_ms.or(report.times.rebuild_ms);
        self.report = report;
    }
}

/// Facts about the tree of a frame. The command-line program writes them to its statistics file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameTreeStats {
    /// Generation of the tree that the frame was traced with.
    #[serde(rename = "tree_generation")]
    pub generation: Generation,
    /// Number of frames since the one that requested the tree. The tree was built from that frame's vertices, unless
    /// [`DriverOptions::predict`](crate::DriverOptions::predict) selected a later time.
    #[serde(rename = "tree_age_frames")]
    pub age_frames: u64,
    /// Whether this frame adopted the tree, or the backend built it within this frame.
    pub adopted: bool,
    /// Whether a finished tree was rejected, for one of three reasons. It costs no less than the current tree. It
    /// exceeds the memory or a limit of the device. Or a newer tree would arrive too early: before frame times are
    /// nearer to this tree's target time than to the current tree's.
    pub rejected: bool,
    /// Milliseconds of the host build up to the complete binary tree, if this frame adopted it. Includes the
    /// interpolation of vertices that the builder does itself. For a tree built on the device, milliseconds of the stage
    /// `rebuild`.
    #[serde(serialize_with = "rounded")]
    pub build_ms: Option<f64>,
    /// Milliseconds from the binary tree to the topology, including its lists of moving nodes, if this frame adopted
    /// it.
    #[serde(serialize_with = "rounded")]
    pub convert_ms: Option<f64>,
    /// Bytes of the adopted topology that are uploaded.
    pub upload_bytes: u64,
    /// Cost of the refitted tree divided by its cost when it was built; 1 if it was built for this frame's pose. `None`
    /// if the backend measures no cost.
    #[serde(serialize_with = "rounded")]
    pub sah_ratio: Option<f64>,
}

/// Returns a duration in milliseconds.
pub(crate) fn ms(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}
