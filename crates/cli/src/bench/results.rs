//! Formats the results of a bench: as JSON, as CSV and as text.

use super::Results;
use crate::error::CliError;
use crate::measure::MeasuredRow;
use crate::table::{Cells, format_count, ms, table};
use output::plot::{Failure, csv_table};
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Columns of the CSV, named as in the JSON. Times are medians in milliseconds, except for the first frame's time.
const COLUMNS: &str = "scene,triangles,moving,backend,adapter,update,predict,intersector,rays,threads,\
     builder_threads,frames,first_ms,interpolate_ms,preprocess_ms,rebuild_ms,refit_ms,trace_primary_ms,trace_shadow_ms,\
     device_ms,wall_ms,mrays_per_s,build_ms,convert_ms,trees,tree_age_frames,sah_ratio,device_bytes,differing,error";

/// Returns all rows, with failed combinations last.
pub(super) fn json(results: &Results) -> Vec<Value> {
    let rows = results.rows.iter().map(|row| json!(row));
    rows.chain(results.failures.iter().map(|failure| json!(failure)))
        .collect()
}

/// Returns a table with one row per run. Unknown cells are empty.
pub(super) fn csv(results: &Results) -> Result<String, CliError> {
    let columns = || COLUMNS.split(',');
    let record = |mut json: Value| -> Vec<String> {
        if json["rays"].is_null() {
            json["rays"] = "camera".into();
        }
        let cell = |column: &str| match &json[column] {
            Value::Null => String::new(),
            Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        columns().map(cell).collect()
    };
    let rows = json(results).into_iter().map(record);
    csv_table(columns(), rows).map_err(CliError::failed)
}

/// Returns a table with one row per run, then failures, devices, runs with unsteady times, and differing hits.
pub(super) fn text(results: &Results) -> String {
    let (rows, failures) = (&results.rows, &results.failures);
    let adapter = |r: &MeasuredRow| format!("{}: {}\n", r.setup.backend, r.setup.adapter);
    let adapters: BTreeSet<String> = rows.iter().map(adapter).collect();
    let of_failures = rows.first().into_iter().flat_map(|row| {
        let failed = failures.iter();
        failed.map(move |failure| failed_cells(failure, row))
    });
    let mut text = table(rows.iter().map(cells).chain(of_failures), 4);
    text.extend(failures.iter().map(|failure| format!("{failure}\n")));
    text.extend(adapters);
    for row in rows {
        if let Some(warmed) = row.warm_up.filter(|warmed| !warmed.steady) {
            let (scene, name, seconds) = (&row.scene, name(row), warmed.seconds);
            text += &format!("{scene} {name}: unreliable: ");
            text += &format!("frame times were not steady after {seconds:.1} s of warm-up\n");
        }
    }
    for row in rows {
        if let Some(share) = row.differing {
            let (scene, name, percent) = (&row.scene, name(row), 100.0 * share);
            text += &format!("{scene} {name}: {percent:.4} % of rays differ from backend cpu\n");
        }
    }
    text
}

fn cells(r: &MeasuredRow) -> Cells<'static> {
    let show = |value: Option<f64>, show: fn(f64) -> String| value.map_or("-".to_owned(), show);
    let time = |name| show(r.median(name), ms);
    let short = |value| show(value, |x| format!("{x:.2}"));
    let how = &r.setup;
    let intersector = how.intersector.to_owned() + &rays_text(r.rays, ", ");
    vec![
        ("scene", r.scene.clone()),
        ("backend", how.backend.to_owned()),
        ("update", how.update.to_owned()),
        ("intersector", intersector),
        ("moving", format_count(r.moving)),
        ("interp", time("interpolate_ms")),
        ("preproc", time("preprocess_ms")),
        ("refit", time("refit_ms")),
        ("geometry", time("geometry_ms")),
        ("primary", time("trace_primary_ms")),
        ("shadow", time("trace_shadow_ms")),
        ("device", time("device_ms")),
        ("wall", time("wall_ms")),
        ("Mrays/s", short(r.mrays_per_s)),
        ("build", time("build_ms")),
        ("trees", r.trees.to_string()),
        ("age", show(r.median("tree_age_frames"), |x| x.to_string())),
        ("SAH", short(r.median("sah_ratio"))),
        ("SAH cost", short(r.median("sah_cost"))),
    ]
}

/// Returns the row of a combination that failed, with `-` instead of numbers. The columns are those of `row`.
fn failed_cells(failure: &Failure, row: &MeasuredRow) -> Cells<'static> {
    let intersector = failure.intersector.clone() + &rays_text(failure.rays, ", ");
    let [scene, backend, update] =
        [&failure.scene, &failure.backend, &failure.update].map(String::clone);
    let mut names = [scene, backend, update, intersector].into_iter();
    let columns = cells(row).into_iter().map(|(column, _)| column);
    columns
        .map(|column| (column, names.next().unwrap_or_else(|| "-".to_owned())))
        .collect()
}

/// Returns the kind of rays after a separator, or an empty string for a camera's.
fn rays_text(rays: Option<&str>, separator: &str) -> String {
    rays.map_or(String::new(), |rays| format!("{separator}{rays} rays"))
}

/// Returns the name of a run within its scene.
fn name(r: &MeasuredRow) -> String {
    let how = &r.setup;
    let words = [how.backend, how.update, how.intersector].join(" ");
    words + &rays_text(r.rays, " ")
}
