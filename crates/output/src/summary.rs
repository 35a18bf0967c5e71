//! All frames of a run at a glance.

use crate::stats::{FrameStats, rounded};
use serde::Serialize;
use std::collections::BTreeMap;

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
    #[serde(serialize_with = "rounded")]
    pub median: f64,
    /// The least that 95 of 100 do not exceed (nearest rank).
    #[serde(serialize_with = "rounded")]
    pub p95: f64,
    /// The largest.
    #[serde(serialize_with = "rounded")]
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

/// Sums every time up over the frames that know it.
#[must_use]
pub fn summarize(frames: &[FrameStats]) -> BTreeMap<&'static str, Option<Summary>> {
    let of = |time: Time| Summary::of(frames.iter().filter_map(time));
    TIMES.iter().map(|&(name, time)| (name, of(time))).collect()
}

/// Sums everything up over the frames that know it.
#[must_use]
pub fn overview(frames: &[FrameStats]) -> Overview {
    Overview {
        times: summarize(frames),
        host_bytes: Course::of(frames.iter().filter_map(|f| f.host_bytes)),
        device_bytes: Course::of(frames.iter().filter_map(|f| f.device_bytes)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
