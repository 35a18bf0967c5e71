//! One frame: what is asked for, and what came of it.

use backend::{FrameReport, Generation};

/// A frame to render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Its number in the output.
    pub index: u64,
    /// Its time in key frames.
    pub time: f64,
}

/// What became of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameRecord {
    /// What was asked for.
    pub frame: Frame,
    /// What the backend says.
    pub report: FrameReport,
    /// Milliseconds the driver spent on the frame: from its begin to the end of
    /// its submission, and waiting for it to finish.
    pub wall_ms: f64,
    /// The tree it was traced with.
    pub tree_generation: Generation,
    /// Frames since the one whose vertices the tree was built from.
    pub tree_age_frames: u64,
    /// The tree this frame swapped to, if it did.
    pub adopted: Option<Adopted>,
    /// Refitted cost over the cost of a fresh tree at the same time where that
    /// is known, else over the cost when it was built. `None` where the backend measures no cost.
    pub sah_ratio: Option<f64>,
}

/// A tree on the day it was swapped in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adopted {
    /// Milliseconds from vertices to binary tree.
    pub build_ms: f64,
    /// Milliseconds from binary tree to record.
    pub convert_ms: f64,
    /// Bytes of the record.
    pub upload_bytes: u64,
}

/// Counts the submission that fetched vertices for a frame's own tree as part of the frame.
pub(crate) fn add_fetched(report: &mut FrameReport, fetched: &FrameReport) {
    let times = &mut report.times;
    times.interpolate_ms = times.interpolate_ms.or(fetched.times.interpolate_ms);
    times.device_ms += fetched.times.device_ms;
    report.readback_bytes += fetched.readback_bytes;
}
