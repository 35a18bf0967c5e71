//! Statistics file: one JSON object with schema version 1. Unknown values are `null`.

use crate::{OutputError, write_whole};
use backend::rounded;
use pipeline::FrameRecord;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

/// Version of the file's schema.
pub const SCHEMA: u32 = 1;

/// Choice that an `auto` option made, with the reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct AutoChoice {
    /// Name of the option, such as `backend`.
    pub what: String,
    /// Chosen value.
    pub takes: String,
    /// Reason for the choice.
    pub why: String,
}

impl fmt::Display for AutoChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, takes, why } = self;
        write!(f, "auto chooses {what} {takes}: {why}")
    }
}

/// Summary of one quantity over all frames with a known value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// Median. For an even number of values, the mean of the middle two.
    #[serde(serialize_with = "rounded")]
    pub median: f64,
    /// 95th percentile by nearest rank.
    #[serde(serialize_with = "rounded")]
    pub p95: f64,
    /// Maximum.
    #[serde(serialize_with = "rounded")]
    pub worst: f64,
}

impl Summary {
    /// Summarizes `values`. Returns `None` if they are empty.
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

/// Function that returns a time, or another quantity, of a frame.
pub type FrameQuantity = fn(&FrameRecord) -> Option<f64>;

/// Times that are summarized, in stage order.
pub const TIMES: [(&str, FrameQuantity); 11] = [
    ("interpolate_ms", |f| f.report.times.interpolate_ms),
    ("preprocess_ms", |f| f.report.times.preprocess_ms),
    ("rebuild_ms", |f| f.report.times.rebuild_ms),
    ("refit_ms", |f| f.report.times.refit_ms),
    ("trace_primary_ms", |f| f.report.times.trace_primary_ms),
    ("trace_shadow_ms", |f| f.report.times.trace_shadow_ms),
    ("device_ms", |f| Some(f.report.times.device_ms)),
    ("wall_ms", |f| Some(f.wall_ms)),
    ("build_wait_ms", |f| Some(f.build_wait_ms)),
    ("build_ms", |f| f.tree.build_ms),
    ("convert_ms", |f| f.tree.convert_ms),
];

/// Memory that is summarized: the resident bytes of this process, and the bytes that the backend has allocated.
const BYTES: [(&str, FrameQuantity); 2] = [
    ("host_bytes", |f| Some(f.host_bytes? as f64)),
    ("device_bytes", |f| Some(f.device_bytes? as f64)),
];

/// Summarizes each quantity over all frames with a known value, by name.
#[must_use]
pub fn overview(frames: &[FrameRecord]) -> BTreeMap<&'static str, Option<Summary>> {
    let of = |time: FrameQuantity| Summary::of(frames.iter().filter_map(time));
    let all = TIMES.iter().chain(&BYTES);
    all.map(|&(name, time)| (name, of(time))).collect()
}

/// Writes `value` as indented JSON with a newline at the end.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), OutputError> {
    write_whole(path, &json_bytes(path, value)?)
}

/// Returns the contents of a JSON file. `path` is named in errors.
pub(crate) fn json_bytes(path: &Path, value: &impl Serialize) -> Result<Vec<u8>, OutputError> {
    let mut bytes = serde_json::to_vec_pretty(value)
        .map_err(|e| OutputError::writing(path, std::io::Error::other(e)))?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// Returns a line of text about adopted and rejected trees and their age.
#[must_use]
pub fn trees_text(frames: &[FrameRecord]) -> String {
    let adopted = frames.iter().filter(|f| f.tree.adopted).count();
    let newest = frames
        .iter()
        .map(|f| f.tree.generation.0)
        .max()
        .unwrap_or(0);
    let ages = Summary::of(frames.iter().map(|f| f.tree.age_frames as f64));
    let ratios = Summary::of(frames.iter().filter_map(|f| f.tree.sah_ratio));
    let rejected = frames.iter().filter(|f| f.tree.rejected).count();
    let mut text =
        format!("trees: {adopted} adopted, {rejected} rejected, newest generation {newest}");
    if let Some(s) = ages {
        text += &format!("; age in frames: median {}, worst {}", s.median, s.worst);
    }
    if let Some(s) = ratios {
        text += &format!("; SAH ratio: median {:.3}, worst {:.3}", s.median, s.worst);
    }
    text + "\n"
}

/// Returns million rays per second, for `count` rays in `ms` milliseconds. Returns `None` if `ms` is 0.
#[must_use]
pub fn mrays(count: f64, ms: f64) -> Option<f64> {
    (ms > 0.0).then(|| count / ms * 1e-3)
}

/// Returns the peak memory as one line of text per known quantity.
#[must_use]
pub fn memory_text(frames: &[FrameRecord]) -> String {
    let most = |(name, of): &(&str, FrameQuantity)| {
        let most = frames.iter().filter_map(of).reduce(f64::max)?;
        let (owner, mib) = (name.trim_end_matches("_bytes"), most / f64::from(1 << 20));
        Some(format!("{owner} memory: at most {mib:.1} MiB\n"))
    };
    BYTES.iter().filter_map(most).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_values_serialize_as_null() {
        let mut frame = FrameRecord::default();
        frame.report.times.refit_ms = Some(1.0 / 3.0);
        frame.tree.sah_ratio = Some(f64::NAN);
        let json = serde_json::to_value(&frame).unwrap();
        assert!(json["build_ms"].is_null() && json["sah_ratio"].is_null());
        assert_eq!(json["refit_ms"], 0.333_333);
        let read: FrameRecord = serde_json::from_value(json.clone()).unwrap();
        assert_eq!(serde_json::to_value(&read).unwrap(), json);
        let summary = serde_json::to_value(overview(&[frame])).unwrap();
        assert_eq!(summary["refit_ms"]["median"], 0.333_333);
        assert!(summary["build_ms"].is_null() && summary["device_bytes"].is_null());
    }

    #[test]
    fn percentiles_use_sorted_values() {
        let s = Summary::of((1..=100).rev().map(f64::from)).unwrap();
        assert_eq!((s.median, s.p95, s.worst), (50.5, 95.0, 100.0));
        let s = Summary::of([3.0, 1.0, 2.0]).unwrap();
        assert_eq!((s.median, s.p95, s.worst), (2.0, 3.0, 3.0));
        assert_eq!(Summary::of([]), None);
    }
}
