//! Results of a bench for people.

use super::{Report, Row, rivals};
use crate::table::{grouped, ms, table};
use crate::warm_up::Warmed;

const HEAD: [&str; 20] = [
    "scene", "backend", "update", "method", "moving", "interp", "preproc", "refit", "geometry",
    "primary", "shadow", "device", "wall", "Mrays/s", "build", "ns/tri", "trees", "age", "SAH",
    "SAH cost",
];

/// One row a run, and which device each backend ran on.
pub(super) fn text(report: &Report, against: Option<&str>) -> String {
    let rows: Vec<_> = report.rows.iter().map(cells).collect();
    let [width, height] = report.size;
    let cpu = report.cpu.as_deref().unwrap_or("unknown cpu");
    let mut text = format!(
        "medians in ms at {width}x{height} on {cpu}\n{}{}",
        table(&HEAD, &rows, 4),
        adapters(&report.rows)
    );
    text += &unsteady(&report.rows);
    text += &rivals::text(&report.rows, against);
    text
}

fn cells(r: &Row) -> Vec<String> {
    let time = |t: Option<f64>| t.map_or("-".to_owned(), ms);
    let short = |t: Option<f64>| t.map_or("-".to_owned(), |x| format!("{x:.2}"));
    vec![
        r.scene.clone(),
        r.backend.to_owned(),
        update(r),
        method(r),
        grouped(r.moving),
        time(r.interpolate_ms),
        time(r.preprocess_ms),
        time(r.refit_ms),
        time(r.geometry_ms),
        time(r.trace_primary_ms),
        time(r.trace_shadow_ms),
        time(r.device_ms),
        time(r.wall_ms),
        short(r.mrays_per_s),
        time(r.build_ms),
        short(r.build_ns_per_triangle),
        r.trees.to_string(),
        r.tree_age_frames.map_or("-".to_owned(), |x| format!("{x}")),
        short(r.sah_ratio),
        short(r.sah_cost),
    ]
}

/// Intersector and layout, and which rays if not a camera's.
fn method(r: &Row) -> String {
    let rays = r
        .rays
        .map_or(String::new(), |rays| format!(", {rays} rays"));
    format!("{} {}{rays}", r.intersector, r.layout)
}

/// The policy, and whether it goes without prediction.
fn update(r: &Row) -> String {
    let without = if r.predict == Some(false) {
        ", unpredicted"
    } else {
        ""
    };
    format!("{}{without}", r.update)
}

/// Runs whose device was not steady when they began, one line each.
fn unsteady(rows: &[Row]) -> String {
    let warning = |r: &Row| {
        let warning = r.warm_up.and_then(Warmed::warning)?;
        Some(format!("{} {}: {warning}\n", r.scene, rivals::name(r)))
    };
    rows.iter().filter_map(warning).collect()
}

/// Which device each backend ran on, one line each.
fn adapters(rows: &[Row]) -> String {
    let mut lines: Vec<String> = rows
        .iter()
        .map(|r| format!("{}: {}\n", r.backend, r.adapter))
        .collect();
    lines.sort_unstable();
    lines.dedup();
    lines.concat()
}
