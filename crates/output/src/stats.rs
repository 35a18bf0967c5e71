//! The statistics file: one JSON object, schema 1. What is not known is `null`.

use crate::{WriteError, write_whole};
use serde::{Deserialize, Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

/// The version of the file's schema.
pub const SCHEMA: u32 = 1;

/// All that is said of one run.
#[derive(Clone, Debug, Serialize)]
#[expect(
    missing_docs,
    reason = "the names are the schema's, listed in the manual"
)]
pub struct Stats {
    /// [`SCHEMA`].
    pub schema: u32,
    pub version: String,
    /// Program first.
    pub command_line: Vec<String>,
    pub scene: SceneFacts,
    pub backend: String,
    pub adapter: String,
    pub driver: Option<String>,
    /// Threads that render.
    pub threads: usize,
    pub builder_threads: usize,
    /// As carried out.
    pub update: String,
    /// Frames between asking for a tree and taking it up, where fixed.
    pub lockstep: Option<u64>,
    /// With `async`: whether trees are built for what comes.
    pub predict: Option<bool>,
    pub intersector: String,
    pub layout: String,
    /// What was left to `auto`.
    pub auto: Vec<Taken>,
    /// Pixels of a frame: width, height.
    pub size: [u32; 2],
    pub frames: Vec<FrameStats>,
    pub summary: Overview,
}

/// What was rendered: counts of key frames, of vertices in each, and of triangles, inactive ones included.
#[derive(Clone, Debug, Serialize)]
#[expect(
    missing_docs,
    reason = "the names are the schema's, listed in the manual"
)]
pub struct SceneFacts {
    pub name: String,
    pub keys: usize,
    pub vertices: usize,
    pub triangles: usize,
    /// Triangles active in some key frame.
    pub live: usize,
    /// Live triangles that move. Those that never do are interpolated, preprocessed and refitted once.
    pub moving: usize,
    /// What else its source told.
    pub facts: serde_json::Value,
}

/// One frame. Times in milliseconds, which [`rounded`] makes short.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[expect(
    missing_docs,
    reason = "the names are the schema's, listed in the manual"
)]
pub struct FrameStats {
    pub frame: usize,
    pub time: f64,
    pub interpolate_ms: Option<f64>,
    pub preprocess_ms: Option<f64>,
    pub rebuild_ms: Option<f64>,
    pub refit_ms: Option<f64>,
    pub trace_primary_ms: Option<f64>,
    pub trace_shadow_ms: Option<f64>,
    pub device_ms: Option<f64>,
    pub wall_ms: Option<f64>,
    pub build_wait_ms: Option<f64>,
    pub tree_generation: u64,
    pub tree_age_frames: u64,
    pub adopted: bool,
    /// A finished tree was no better than the one in use, or its moment too far off.
    pub rejected: bool,
    pub build_ms: Option<f64>,
    pub convert_ms: Option<f64>,
    pub upload_bytes: u64,
    pub readback_bytes: u64,
    pub sah_ratio: Option<f64>,
    pub sah_cost: Option<f64>,
    pub hits: u64,
    pub blocked: u64,
    pub inactive: u64,
    pub degenerate: u64,
    /// Rays that exact arithmetic settled.
    pub settled: u64,
    pub host_bytes: Option<u64>,
    pub device_bytes: Option<u64>,
}

/// What `auto` took, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Taken {
    /// What was left open, such as `backend`.
    pub what: String,
    /// What was taken.
    pub takes: String,
    /// The reason.
    pub why: String,
}

impl fmt::Display for Taken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, takes, why } = self;
        write!(f, "{what} auto takes {takes}: {why}")
    }
}

/// All frames at a glance.
#[derive(Clone, Debug, Serialize)]
pub struct Overview {
    /// Times by name; see [`TIMES`].
    #[serde(flatten)]
    pub times: BTreeMap<&'static str, Option<Summary>>,
    /// Memory of this process that is resident, in bytes.
    pub host_bytes: Option<Course>,
    /// Device memory the backend holds, in bytes.
    pub device_bytes: Option<Course>,
}

/// One quantity over all frames that know it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The middle one (of an even number, the mean of the middle two).
    #[serde(serialize_with = "short")]
    pub median: f64,
    /// The least that 95 of 100 do not exceed (nearest rank).
    #[serde(serialize_with = "short")]
    pub p95: f64,
    /// The largest.
    #[serde(serialize_with = "short")]
    pub worst: f64,
}

impl Summary {
    /// Of `values`; `None` if there are none.
    #[must_use]
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = values.into_iter().collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let n = sorted.len();
        let worst = *sorted.last()?;
        Some(Self {
            median: f64::midpoint(sorted[(n - 1) / 2], sorted[n / 2]),
            p95: sorted[(n * 95).div_ceil(100) - 1],
            worst,
        })
    }
}

/// One amount from the first frame that knows it to the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Course {
    /// After the first frame.
    pub first: u64,
    /// After the last one.
    pub last: u64,
    /// The most there was.
    pub peak: u64,
}

impl Course {
    /// Of `values` in order; `None` if there are none.
    #[must_use]
    pub fn of(values: impl IntoIterator<Item = u64>) -> Option<Self> {
        values.into_iter().fold(None, |course, last| {
            let Self { first, peak, .. } = course.unwrap_or(Self {
                first: last,
                last,
                peak: last,
            });
            let peak = peak.max(last);
            Some(Self { first, last, peak })
        })
    }
}

/// Reads one time of a frame.
pub type Time = fn(&FrameStats) -> Option<f64>;

/// The times that are summed up, in the order of the stages.
pub const TIMES: [(&str, Time); 11] = [
    ("interpolate_ms", |f| f.interpolate_ms),
    ("preprocess_ms", |f| f.preprocess_ms),
    ("rebuild_ms", |f| f.rebuild_ms),
    ("refit_ms", |f| f.refit_ms),
    ("trace_primary_ms", |f| f.trace_primary_ms),
    ("trace_shadow_ms", |f| f.trace_shadow_ms),
    ("device_ms", |f| f.device_ms),
    ("wall_ms", |f| f.wall_ms),
    ("build_wait_ms", |f| f.build_wait_ms),
    ("build_ms", |f| f.build_ms),
    ("convert_ms", |f| f.convert_ms),
];

/// Sums everything up over the frames that know it.
#[must_use]
pub fn overview(frames: &[FrameStats]) -> Overview {
    let of = |time: Time| Summary::of(frames.iter().filter_map(time));
    Overview {
        times: TIMES.iter().map(|&(name, time)| (name, of(time))).collect(),
        host_bytes: Course::of(frames.iter().filter_map(|f| f.host_bytes)),
        device_bytes: Course::of(frames.iter().filter_map(|f| f.device_bytes)),
    }
}

/// Writes `value` as indented JSON with a newline at the end.
///
/// # Errors
/// [`WriteError`]; `path` then holds what it held before.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), WriteError> {
    let mut bytes = serde_json::to_vec_pretty(value)
        .map_err(|e| WriteError::new(path, std::io::Error::other(e)))?;
    bytes.push(b'\n');
    write_whole(path, &bytes)
}

/// Six digits after the point: nanoseconds of a millisecond.
#[must_use]
pub fn rounded(x: f64) -> f64 {
    (x * 1e6).round() / 1e6
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn short<S: Serializer>(x: &f64, s: S) -> Result<S::Ok, S::Error> {
    s.serialize_f64(rounded(*x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_numbers_are_null_and_summaries_are_rounded() {
        let frame = FrameStats {
            refit_ms: Some(1.0 / 3.0),
            sah_ratio: Some(f64::NAN),
            ..FrameStats::default()
        };
        let json = serde_json::to_value(&frame).unwrap();
        assert!(json["build_ms"].is_null() && json["sah_ratio"].is_null());
        let summary = serde_json::to_value(overview(&[frame])).unwrap();
        assert_eq!(summary["refit_ms"]["median"], 0.333_333);
        assert!(summary["build_ms"].is_null());
    }

    #[test]
    fn percentiles_are_those_of_the_sorted_values() {
        let s = Summary::of((1..=100).rev().map(f64::from)).unwrap();
        assert_eq!((s.median, s.p95, s.worst), (50.5, 95.0, 100.0));
        let s = Summary::of([3.0, 1.0, 2.0]).unwrap();
        assert_eq!((s.median, s.p95, s.worst), (2.0, 3.0, 3.0));
        assert_eq!(Summary::of([]), None);
    }

    #[test]
    fn a_course_has_a_begin_an_end_and_a_peak() {
        let course = Course::of([3, 9, 1, 4]).unwrap();
        assert_eq!((course.first, course.last, course.peak), (3, 4, 9));
        assert_eq!(Course::of([]), None);
        let frame = |bytes| FrameStats {
            host_bytes: Some(bytes),
            ..FrameStats::default()
        };
        let json = serde_json::to_value(overview(&[frame(5), frame(2)])).unwrap();
        assert_eq!(json["host_bytes"]["peak"], 5);
        assert!(json["device_bytes"].is_null() && json["refit_ms"].is_null());
    }
}
