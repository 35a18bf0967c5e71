//! Results of a bench as CSV (RFC 4180): a row a run, empty where nothing is known.

use super::Row;
use crate::memory::DeviceMemory;
use crate::stop::Stop;
use serde::Serialize;

/// Times are medians in milliseconds, but for the first frame's.
#[derive(Serialize)]
struct Record<'a> {
    scene: &'a str,
    triangles: usize,
    moving: usize,
    backend: &'a str,
    adapter: &'a str,
    update: &'a str,
    predict: Option<bool>,
    intersector: &'a str,
    layout: &'a str,
    rays: &'a str,
    threads: usize,
    builder_threads: usize,
    frames: usize,
    first_ms: Option<f64>,
    interpolate_ms: Option<f64>,
    preprocess_ms: Option<f64>,
    rebuild_ms: Option<f64>,
    refit_ms: Option<f64>,
    trace_primary_ms: Option<f64>,
    trace_shadow_ms: Option<f64>,
    device_ms: Option<f64>,
    wall_ms: Option<f64>,
    mrays_per_s: Option<f64>,
    build_ms: Option<f64>,
    convert_ms: Option<f64>,
    trees: usize,
    tree_age_frames: Option<f64>,
    sah_ratio: Option<f64>,
    device_bytes: Option<u64>,
}

pub(super) fn csv(rows: &[Row]) -> Result<String, Stop> {
    let mut out = csv::Writer::from_writer(Vec::new());
    for row in rows {
        out.serialize(record(row)).map_err(Stop::failed)?;
    }
    let bytes = out.into_inner().map_err(Stop::failed)?;
    String::from_utf8(bytes).map_err(Stop::failed)
}

fn record(r: &Row) -> Record<'_> {
    Record {
        scene: &r.scene,
        triangles: r.triangles,
        moving: r.moving,
        backend: r.backend,
        adapter: &r.adapter,
        update: r.update,
        predict: r.predict,
        intersector: r.intersector,
        layout: r.layout,
        rays: r.rays.unwrap_or("camera"),
        threads: r.threads,
        builder_threads: r.builder_threads,
        frames: r.frames,
        first_ms: r.first_ms,
        interpolate_ms: r.interpolate_ms,
        preprocess_ms: r.preprocess_ms,
        rebuild_ms: r.rebuild_ms,
        refit_ms: r.refit_ms,
        trace_primary_ms: r.trace_primary_ms,
        trace_shadow_ms: r.trace_shadow_ms,
        device_ms: r.device_ms,
        wall_ms: r.wall_ms,
        mrays_per_s: r.mrays_per_s,
        build_ms: r.build_ms,
        convert_ms: r.convert_ms,
        trees: r.trees,
        tree_age_frames: r.tree_age_frames,
        sah_ratio: r.sah_ratio,
        device_bytes: r.memory.map(DeviceMemory::total),
    }
}
