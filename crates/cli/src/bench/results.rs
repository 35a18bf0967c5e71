//! Formats the results of a bench: as JSON, as CSV, as text, and as ratios between all runs of a scene.

use super::{FailedRun, Results};
use crate::measure::{MeasuredRow, frame_ms};
use crate::stop::Stop;
use crate::table::{Cells, grouped, ms, table};
use output::plot::csv_table;
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Columns of the CSV, named as in the JSON. Times are medians in milliseconds, except for the first frame's time.
const COLUMNS: &str = "scene,triangles,moving,backend,adapter,update,predict,intersector,layout,rays,threads,\
     builder_threads,frames,first_ms,interpolate_ms,preprocess_ms,rebuild_ms,refit_ms,trace_primary_ms,trace_shadow_ms,\
     device_ms,wall_ms,mrays_per_s,build_ms,convert_ms,trees,tree_age_frames,sah_ratio,device_bytes,differing,error";

/// Maximum number of runs of a scene that are all compared with each other in text. More runs are compared only with
/// the baseline.
const MANY: usize = 12;

/// Returns all rows, with failed combinations last.
pub(super) fn json(results: &Results) -> Vec<Value> {
    let rows = results.rows.iter().map(|row| json!(row));
    rows.chain(results.failures.iter().map(|failure| json!(failure)))
        .collect()
}

/// Returns a table with one row a run. Unknown cells are empty.
pub(super) fn csv(results: &Results) -> Result<String, Stop> {
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
    csv_table(columns(), rows).map_err(Stop::failed)
}

/// Returns one row per run, the reasons of failures, the device of each backend, and ratios between runs.
pub(super) fn text(results: &Results, against: Option<&str>) -> String {
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
            text += &format!("{scene} {name}: not to be relied on: ");
            text += &format!("after {seconds:.1} s of warm-up frames still changed\n");
        }
    }
    for row in rows {
        if let Some(share) = row.differing {
            let (scene, name, percent) = (&row.scene, name(row), 100.0 * share);
            text += &format!("{scene} {name}: {percent:.4} % of rays hit otherwise than ours\n");
        }
    }
    for of in rows.chunk_by(comparable) {
        if of.len() > 1
            && let Some(baseline) = baseline(of, against)
        {
            let scene = &baseline.scene;
            text += &format!("{scene}: times over those of {}\n", name(baseline));
            text += &matrix(of, baseline);
        }
    }
    text
}

fn cells(r: &MeasuredRow) -> Cells<'static> {
    let show = |value: Option<f64>, show: fn(f64) -> String| value.map_or("-".to_owned(), show);
    let time = |name| show(r.median(name), ms);
    let short = |value| show(value, |x| format!("{x:.2}"));
    let how = &r.setup;
    let update = format!("{}{}", how.update, unless_predicted(r, ", unpredicted"));
    let method = format!("{} {}{}", how.intersector, how.layout, rays(r, ", "));
    vec![
        ("scene", r.scene.clone()),
        ("backend", how.backend.to_owned()),
        ("update", update),
        ("method", method),
        ("moving", grouped(r.moving)),
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
        ("ns/tri", short(r.build_ns_per_triangle)),
        ("trees", r.trees.to_string()),
        ("age", show(r.median("tree_age_frames"), |x| x.to_string())),
        ("SAH", short(r.median("sah_ratio"))),
        ("SAH cost", short(r.median("sah_cost"))),
    ]
}

/// Returns the row of a combination that failed: its names, and no numbers. `row` has the same columns.
fn failed_cells(failure: &FailedRun, row: &MeasuredRow) -> Cells<'static> {
    let rays = failure
        .rays
        .map_or(String::new(), |r| format!(", {r} rays"));
    let method = format!("{} {}{rays}", failure.intersector, failure.layout);
    let names = [&*failure.scene, failure.backend, failure.update, &method];
    let mut names = names.map(str::to_owned).into_iter();
    let columns = cells(row).into_iter().map(|(column, _)| column);
    columns
        .map(|column| (column, names.next().unwrap_or_else(|| "-".to_owned())))
        .collect()
}

fn unless_predicted(r: &MeasuredRow, what: &'static str) -> &'static str {
    match r.setup.predict {
        Some(false) => what,
        _ => "",
    }
}

fn rays(r: &MeasuredRow, after: &str) -> String {
    let rays = r.rays.map(|rays| format!("{after}{rays} rays"));
    rays.unwrap_or_default()
}

/// Returns the name of a run within its scene.
fn name(r: &MeasuredRow) -> String {
    let how = &r.setup;
    let words = [how.backend, how.update, how.intersector, how.layout].join(" ");
    let without = unless_predicted(r, " unpredicted");
    format!("{words}{without}{}", rays(r, " "))
}

/// Returns whether two runs did the same work.
fn comparable(a: &MeasuredRow, b: &MeasuredRow) -> bool {
    (&a.scene, a.rays) == (&b.scene, b.rays)
}

/// Returns the device and host times of one run, divided by those of another.
fn over(run: &MeasuredRow, rival: &MeasuredRow) -> [Option<f64>; 2] {
    let over = |a: Option<f64>, b: Option<f64>| Some(a? / b.filter(|&b| b > 0.0)?);
    let device = |r: &MeasuredRow| {
        let ms = r.later_frames().iter().map(frame_ms);
        output::Summary::of(ms).map(|s| s.median)
    };
    let wall = |r: &MeasuredRow| r.median("wall_ms");
    let [ours, theirs] = [run, rival].map(|r| [device(r), wall(r)]);
    [over(ours[0], theirs[0]), over(ours[1], theirs[1])]
}

/// Returns the ratios of every run to every other of its scene. Device times include a frame's wait for its tree.
pub(super) fn ratios(rows: &[MeasuredRow]) -> Vec<Value> {
    let is_rival = |a: &MeasuredRow, b: &MeasuredRow| !std::ptr::eq(a, b) && comparable(a, b);
    let with_each = |run| rows.iter().map(move |rival| (run, rival));
    let pairs = rows.iter().flat_map(with_each);
    let ratio = |(run, rival): (&MeasuredRow, &MeasuredRow)| {
        let ([device, wall], names) = (over(run, rival), [run, rival].map(name));
        let scene = &run.scene;
        json!({ "scene": scene, "run": names[0], "over": names[1], "device": device, "wall": wall })
    };
    pairs.filter(|(a, b)| is_rival(a, b)).map(ratio).collect()
}

/// Returns the run that all others are compared with: the first whose name has all words of `against`, in order.
fn baseline<'a>(rows: &'a [MeasuredRow], against: Option<&str>) -> Option<&'a MeasuredRow> {
    let words = against.unwrap_or_default();
    rows.iter().find(|row| {
        let name = name(row);
        let mut there = name.split(' ');
        let mut words = words.split_whitespace();
        words.all(|w| there.by_ref().any(|t| t == w))
    })
}

/// Refuses a baseline that matches no run of any scene.
pub(super) fn check(rows: &[MeasuredRow], against: Option<&str>) -> Result<(), Stop> {
    if rows.is_empty() || baseline(rows, against).is_some() {
        return Ok(());
    }
    let names = rows.iter().map(name).collect::<Vec<_>>().join(", ");
    let against = against.unwrap_or_default();
    let why = format!("--against '{against}' is none of {names}");
    Err(Stop::bad(why))
}

/// Returns the ratios of every run to the baseline, and to every other run if there are few.
fn matrix(rows: &[MeasuredRow], baseline: &MeasuredRow) -> String {
    let show = |ratio: Option<f64>| ratio.map_or("-".to_owned(), |x| format!("{x:.2}"));
    let few = if rows.len() <= MANY { rows } else { &[] };
    let numbered: Vec<String> = (1..=few.len()).map(|i| format!("/{i}")).collect();
    let line = |(i, r): (usize, &MeasuredRow)| {
        let [device, wall] = over(r, baseline).map(show);
        let mut cells = vec![("", (i + 1).to_string()), ("run", name(r))];
        cells.extend([("device", device), ("wall", wall)]);
        let each = numbered.iter().zip(few);
        cells.extend(each.map(|(n, rival)| (n.as_str(), show(over(r, rival)[1]))));
        cells
    };
    table(rows.iter().enumerate().map(line), 2)
}
