//! The points of a chart of growth as rows and as one object.

use super::{Growth, GrowthPoint};
use crate::error::{ChartError, Result};
use crate::table::{SCHEMA, failed, plain};
use serde::Serialize;

const COLUMNS: [&str; 20] = [
    "scene",
    "triangles",
    "update",
    "layout",
    "frame_ms",
    "geometry_ms",
    "trace_ms",
    "first_ms",
    "build_ms",
    "device_bytes",
    "bytes_per_triangle",
    "frames",
    "cut_short",
    "cpu",
    "version",
    "tree_bytes",
    "scratch_bytes",
    "scene_bytes",
    "frame_bytes",
    "warm_up_s",
];

#[derive(Serialize)]
struct File<'a> {
    schema: u32,
    #[serde(flatten)]
    growth: &'a Growth,
}

/// All of it as JSON; it reads back as a [`Growth`].
///
/// # Errors
/// [`ChartError::Json`].
pub fn growth_json(growth: &Growth) -> Result<String> {
    let schema = SCHEMA;
    let mut text = serde_json::to_string_pretty(&File { schema, growth })?;
    text.push('\n');
    Ok(text)
}

/// The points as CSV (RFC 4180), one row each, in the order given; what is unknown is empty.
///
/// # Errors
/// [`ChartError::Csv`].
pub fn growth_csv(growth: &Growth) -> Result<String> {
    let mut out = csv::Writer::from_writer(Vec::new());
    out.write_record(COLUMNS).map_err(failed)?;
    for point in &growth.points {
        out.write_record(row(growth, point)).map_err(failed)?;
    }
    let bytes = out
        .into_inner()
        .map_err(|e| ChartError::Csv(e.to_string()))?;
    String::from_utf8(bytes).map_err(|e| ChartError::Csv(e.to_string()))
}

fn whole(bytes: Option<u64>) -> String {
    bytes.map_or_else(String::new, |b| b.to_string())
}

fn row(growth: &Growth, p: &GrowthPoint) -> [String; 20] {
    [
        growth.scene.clone(),
        p.triangles.to_string(),
        p.update.clone(),
        p.layout.clone(),
        plain(p.frame_ms),
        plain(p.geometry_ms),
        plain(p.trace_ms),
        plain(p.first_ms),
        plain(p.build_ms),
        whole(p.device_bytes),
        plain(p.bytes_per_triangle()),
        p.frames.to_string(),
        u8::from(p.cut_short).to_string(),
        growth.machine.cpu.clone().unwrap_or_default(),
        growth.machine.version.clone(),
        whole(p.tree_bytes),
        whole(p.scratch_bytes),
        whole(p.scene_bytes),
        whole(p.frame_bytes),
        plain(p.warm_up_s),
    ]
}
