//! The request for a frame, and its statistics.

use crate::tree_builder::BuildTimestamps;
use backend::{DeviceBytes, FrameReport, Generation, rounded};
use geom::Pose;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// A frame to render.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frame {
    /// Number of the frame in the output.
    pub index: u64,
    /// Time in key frames.
    pub time: f64,
}

/// Statistics of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameRecord {
    /// Frame that was requested.
    pub frame: Frame,
    /// Report of the backend.
    pub report: FrameReport,
    /// Facts about the tree that the frame was traced with.
    pub tree: FrameTreeStats,
    /// Milliseconds that the driver spent on the frame: from its start to the end of its submission, plus the wait for
    /// its results. Frames overlap, so it can be less than the time on the device.
    pub wall_ms: f64,
    /// Milliseconds of `wall_ms` in which the driver was blocked by a build. With `async` and `refit`, 0 for every
    /// frame except the first.
    pub build_wait_ms: f64,
    /// Generation of the tree that this frame requested, if any.
    pub requested: Option<Generation>,
    /// Tree that this frame adopted, if any.
    pub adopted: Option<Adopted>,
    /// Generation of the finished tree that this frame rejected, if any.
    pub rejected: Option<Generation>,
    /// Bytes of device memory that the backend held when the frame was finished, if known.
    pub device_bytes: Option<DeviceBytes>,
    /// Times of the driver's steps.
    pub timestamps: FrameTimestamps,
    /// Submission that traced the frame.
    pub traced: TimedSubmission,
}

impl FrameRecord {
    /// Creates the statistics of a frame that begins.
    pub(crate) fn begin(frame: Frame, started: Instant) -> Self {
        Self {
            frame,
            report: FrameReport::default(),
            tree: FrameTreeStats::default(),
            wall_ms: 0.0,
            build_wait_ms: 0.0,
            requested: None,
            adopted: None,
            rejected: None,
            device_bytes: None,
            timestamps: FrameTimestamps {
                started,
                submitted: started,
                wait_started: started,
                finish_seen: started,
                read: started,
            },
            traced: TimedSubmission {
                submit_started: started,
                finish_seen: started,
            },
        }
    }

    /// Completes the statistics after the driver has waited for the frame and read its results. If a separate
    /// submission read back vertices, `self.report` holds its report. Its times and bytes count for the frame.
    pub(crate) fn finish(
        &mut self,
        mut report: FrameReport,
        [wait_started, finish_seen, read]: [Instant; 3],
    ) {
        self.traced.finish_seen = finish_seen;
        let (times, fetched) = (&mut report.times, &self.report.times);
        times.interpolate_ms = times.interpolate_ms.or(fetched.interpolate_ms);
        times.device_ms += fetched.device_ms;
        report.readback_bytes += self.report.readback_bytes;
        self.tree.build_ms = self.tree.build_ms.or(report.times.rebuild_ms);
        self.report = report;
        let timestamps = &mut self.timestamps;
        (
            timestamps.wait_started,
            timestamps.finish_seen,
            timestamps.read,
        ) = (wait_started, finish_seen, read);
        self.wall_ms =
            ms((timestamps.submitted - timestamps.started) + (finish_seen - wait_started));
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
    /// Whether a finished tree was rejected. It cost no less than the current one, or a newer tree would arrive before
    /// its time of use.
    pub rejected: bool,
    /// Milliseconds from vertices to the complete binary tree, if this frame adopted it. For a tree built on the
    /// device, milliseconds of the stage `rebuild`.
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

/// Times of the driver's steps for a frame, on the host's clock, in order. Other frames may run between `submitted` and
/// `wait_started`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameTimestamps {
    /// The driver started the frame.
    pub started: Instant,
    /// The driver had submitted the frame.
    pub submitted: Instant,
    /// The driver started to wait for the frame.
    pub wait_started: Instant,
    /// The driver saw that the frame was finished.
    pub finish_seen: Instant,
    /// Results were copied, if requested.
    pub read: Instant,
}

/// Times of one submission, on the host's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimedSubmission {
    /// The host started to submit it. The device started later.
    pub submit_started: Instant,
    /// The host saw that it was finished. The device had finished earlier.
    pub finish_seen: Instant,
}

/// Statistics of a tree that a frame adopted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adopted {
    /// Bytes of vertices that were read back for the build.
    pub snapshot_bytes: u64,
    /// Number of triangles in the tree.
    pub triangles: usize,
    /// Pose that it was built for.
    pub built_for: Pose,
    /// Times of the steps from the request to the adoption.
    pub timestamps: TreeTimestamps,
}

/// Times of the steps from a tree's request to its adoption, on the host's clock, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TreeTimestamps {
    /// A frame requested it.
    pub requested: Instant,
    /// The vertices were on the host. A build from key frames reaches this step immediately.
    pub arrived: Instant,
    /// Times of the build.
    pub build: BuildTimestamps,
    /// The driver started to pass it to the backend.
    pub taken: Instant,
    /// The backend had adopted it.
    pub adopted: Instant,
}
