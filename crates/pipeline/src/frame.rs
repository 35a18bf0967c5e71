//! One frame: what is asked for, and what came of it.

use crate::tree_builder::BuildMoments;
use backend::{DeviceBytes, FrameReport, Generation, StageTimes};
use geom::Pose;
use std::time::{Duration, Instant};

/// A frame to render.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
    /// Milliseconds the driver spent on the frame: from its begin to its submission's end, and waiting for it to finish.
    pub wall_ms: f64,
    /// Milliseconds of those in which the driver was blocked until a tree was
    /// built: 0 for every frame but the first where the builder runs free, and with `refit`.
    pub build_wait_ms: f64,
    /// The tree it was traced with.
    pub tree_generation: Generation,
    /// Frames since the one that asked for the tree; it was built from that
    /// frame's vertices, unless [`DriverOptions::predict`](crate::DriverOptions::predict) looked ahead.
    pub tree_age_frames: u64,
    /// The tree this frame asked for, if it did.
    pub asked: Option<Generation>,
    /// The tree this frame swapped to, if it did.
    pub adopted: Option<Adopted>,
    /// Whether the frame made the tree before the current one current again, because it costs less.
    pub returned: bool,
    /// Whether the backend made the tree within this frame.
    pub made: bool,
    /// The tree this frame could have swapped to, but that it was no better than the one in use, or built for a moment
    /// that is further off than the next tree.
    pub rejected: Option<Generation>,
    /// Refitted cost over the cost of a fresh tree at the same time where that
    /// is known, else over the cost when it was built (with
    /// [`Update::TSah`](crate::Update::TSah), over that of a fresh tree at the first frame). `None` where the backend measures no cost.
    pub sah_ratio: Option<f64>,
    /// Bytes of device memory the backend held when the frame was done, where it can tell.
    pub device_bytes: Option<DeviceBytes>,
    /// When the driver did what.
    pub moments: FrameMoments,
    /// The submission that fetched vertices for the frame's own tree, where there was one.
    pub fetched: Option<Submission>,
    /// The submission that traced it.
    pub traced: Submission,
}

impl FrameRecord {
    /// Of a frame that the driver takes up, of which nothing is known yet.
    pub(crate) fn begin(frame: Frame, begun: Instant) -> Self {
        Self {
            frame,
            report: FrameReport::default(),
            wall_ms: 0.0,
            build_wait_ms: 0.0,
            tree_generation: Generation(0),
            tree_age_frames: 0,
            asked: None,
            adopted: None,
            returned: false,
            made: false,
            rejected: None,
            sah_ratio: None,
            device_bytes: None,
            moments: FrameMoments {
                begun,
                submitted: begun,
                waited: begun,
                seen: begun,
                read: begun,
            },
            fetched: None,
            traced: Submission {
                handed_in: begun,
                seen: begun,
                times: StageTimes::default(),
            },
        }
    }

    /// After the driver waited, saw its end and read its hits. What is reported so far, the submission that fetched
    /// vertices for the frame's own tree, counts as part of the frame.
    pub(crate) fn finish(&mut self, mut report: FrameReport, [waited, seen, read]: [Instant; 3]) {
        (self.traced.seen, self.traced.times) = (seen, report.times);
        let (times, fetched) = (&mut report.times, &self.report.times);
        times.interpolate_ms = times.interpolate_ms.or(fetched.interpolate_ms);
        times.device_ms += fetched.device_ms;
        report.readback_bytes += self.report.readback_bytes;
        self.report = report;
        let moments = &mut self.moments;
        (moments.waited, moments.seen, moments.read) = (waited, seen, read);
        self.wall_ms = ms((moments.submitted - moments.begun) + (seen - waited));
    }
}

/// Milliseconds.
pub(crate) fn ms(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}

/// What the driver did for a frame, on the host's clock, in order.
/// Other frames may lie between `submitted` and `waited`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameMoments {
    /// The driver took the frame up.
    pub begun: Instant,
    /// It had submitted it.
    pub submitted: Instant,
    /// It came back to wait for it.
    pub waited: Instant,
    /// It saw that it was done.
    pub seen: Instant,
    /// Hits were copied, if they were wanted.
    pub read: Instant,
}

/// One submission, seen from both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Submission {
    /// The host was about to hand it in, so nothing of it ran before.
    pub handed_in: Instant,
    /// The host saw that it was done, so nothing of it ran after.
    pub seen: Instant,
    /// How long each stage took, and when it began, on the device's clock.
    pub times: StageTimes,
}

/// A tree on the day it was swapped in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adopted {
    /// Frames from the one that asked for it to the one that found it finished; it may have waited for its moment since.
    pub latency_frames: u64,
    /// Milliseconds from vertices to binary tree.
    pub build_ms: f64,
    /// Milliseconds from binary tree to record, and to lists of what moves.
    pub convert_ms: f64,
    /// Bytes of the record.
    pub upload_bytes: u64,
    /// Bytes of the vertices that were read back for it.
    pub snapshot_bytes: u64,
    /// Triangles it holds.
    pub triangles: usize,
    /// Where the motion stands that it was built for: of [`Update::TSah`](crate::Update::TSah), the first frame.
    pub built_for: Pose,
    /// How it came about.
    pub moments: TreeMoments,
}

/// The way of a tree on the host's clock, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TreeMoments {
    /// A frame asked for it.
    pub asked: Instant,
    /// Its vertices were seen on the host; if it was built from key frames, right away.
    pub arrived: Instant,
    /// It was built.
    pub build: BuildMoments,
    /// The driver began to hand it to the backend.
    pub taken: Instant,
    /// The backend had it.
    pub adopted: Instant,
}
