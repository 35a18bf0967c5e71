//! The statistics file: one JSON object, schema 1. What is not known is `null`.

use crate::summary::Overview;
use crate::{Taken, WriteError, write_whole};
use serde::{Deserialize, Serialize, Serializer};
use std::path::Path;

/// The version of the file's schema.
pub const SCHEMA: u32 = 1;

/// All that is said of one run.
#[derive(Clone, Debug, Serialize)]
pub struct Stats {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Version of the program.
    pub version: String,
    /// The command line, program first.
    pub command_line: Vec<String>,
    /// What was rendered.
    pub scene: SceneFacts,
    /// Name of the backend.
    pub backend: String,
    /// The device's own name.
    pub adapter: String,
    /// Driver and version.
    pub driver: Option<String>,
    /// Threads that render.
    pub threads: usize,
    /// Threads that build.
    pub builder_threads: usize,
    /// Update policy, as carried out.
    pub update: String,
    /// Frames between asking for a tree and taking it up, where fixed.
    pub lockstep: Option<u64>,
    /// With `async`: whether trees are built for what comes.
    pub predict: Option<bool>,
    /// Intersector.
    pub intersector: String,
    /// Layout of the tree.
    pub layout: String,
    /// What was left to `auto`.
    pub auto: Vec<Taken>,
    /// Pixels of a frame: width, height.
    pub size: [u32; 2],
    /// One row a frame.
    pub frames: Vec<FrameStats>,
    /// All frames at a glance.
    pub summary: Overview,
}

/// What was rendered.
#[derive(Clone, Debug, Serialize)]
pub struct SceneFacts {
    /// Its name.
    pub name: String,
    /// Key frames.
    pub keys: usize,
    /// Vertices in each.
    pub vertices: usize,
    /// Triangles, inactive ones included.
    pub triangles: usize,
    /// Triangles active in some key frame.
    pub live: usize,
    /// Live triangles that move. Those that never do are interpolated, preprocessed and refitted once.
    pub moving: usize,
    /// What else its source told.
    pub facts: serde_json::Value,
}

/// One frame. Times in milliseconds.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[expect(
    missing_docs,
    reason = "the names are the schema's, listed in the manual"
)]
pub struct FrameStats {
    pub frame: usize,
    #[serde(serialize_with = "rounded")]
    pub time: f64,
    #[serde(serialize_with = "maybe_rounded")]
    pub interpolate_ms: Option<f64>,
    #[serde(serialize_with = "maybe_rounded")]
    pub preprocess_ms: Option<f64>,
    #[serde(serialize_with = "maybe_rounded")]
    pub rebuild_ms: Option<f64>,
    #[serde(serialize_with = "maybe_rounded")]
    pub refit_ms: Option<f64>,
    #[serde(serialize_with = "maybe_rounded")]
    pub trace_primary_ms: Option<f64>,
    #[serde(serialize_with = "maybe_rounded")]
    pub trace_shadow_ms: Option<f64>,
    #[serde(serialize_with = "maybe_rounded")]
    pub device_ms: Option<f64>,
    #[serde(serialize_with = "maybe_rounded")]
    pub wall_ms: Option<f64>,
    #[serde(serialize_with = "maybe_rounded")]
    pub build_wait_ms: Option<f64>,
    pub tree_generation: u64,
    pub tree_age_frames: u64,
    pub adopted: bool,
    /// A finished tree was no better than the one in use, or its moment too far off.
    pub rejected: bool,
    #[serde(serialize_with = "maybe_rounded")]
    pub build_ms: Option<f64>,
    #[serde(serialize_with = "maybe_rounded")]
    pub convert_ms: Option<f64>,
    pub upload_bytes: u64,
    pub readback_bytes: u64,
    #[serde(serialize_with = "maybe_rounded")]
    pub sah_ratio: Option<f64>,
    #[serde(serialize_with = "maybe_rounded")]
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
fn round(x: f64) -> f64 {
    (x * 1e6).round() / 1e6
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
pub(crate) fn rounded<S: Serializer>(x: &f64, s: S) -> Result<S::Ok, S::Error> {
    s.serialize_f64(round(*x))
}

#[expect(clippy::ref_option, reason = "serde's signature")]
fn maybe_rounded<S: Serializer>(x: &Option<f64>, s: S) -> Result<S::Ok, S::Error> {
    x.map(round).serialize(s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::summarize;

    #[test]
    fn unknown_numbers_are_null_and_known_ones_are_rounded() {
        let frame = FrameStats {
            refit_ms: Some(1.0 / 3.0),
            sah_ratio: Some(f64::NAN),
            ..FrameStats::default()
        };
        let json = serde_json::to_value(&frame).unwrap();
        assert_eq!(json["refit_ms"], 0.333_333);
        assert!(json["build_ms"].is_null() && json["sah_ratio"].is_null());
        let summary = serde_json::to_value(summarize(&[frame])).unwrap();
        assert_eq!(summary["refit_ms"]["median"], 0.333_333);
        assert!(summary["build_ms"].is_null());
    }
}
