//! The points as rows and as one object.

use crate::data::{Chart, Point, known};
use crate::error::{ChartError, Result};
use crate::page::dots;
use crate::plane::{Dot, PER, front_of};
use crate::rate::Rate;
use serde::Serialize;

/// The version of `points.json`.
pub const SCHEMA: u32 = 1;

const COLUMNS: [&str; 31] = [
    "scene",
    "triangles",
    "backend",
    "adapter",
    "driver",
    "layout",
    "intersector",
    "update",
    "samples",
    "ms_median",
    "ms_p5",
    "ms_p95",
    "mrays_per_s",
    "rays_tested",
    "wrong",
    "wrong_per_million",
    "wrong_per_million_low",
    "wrong_per_million_high",
    "on_front",
    "wrong_shadow",
    "aimed_rays",
    "aimed_wrong",
    "t_error_ulp_median",
    "t_error_ulp_p999",
    "t_error_ulp_worst",
    "memory_bytes",
    "cpu",
    "version",
    "date",
    "command",
    "schema",
];

#[derive(Serialize)]
struct File<'a> {
    schema: u32,
    #[serde(flatten)]
    chart: &'a Chart,
}

/// The whole chart as JSON; it reads back as a [`Chart`].
///
/// # Errors
/// [`ChartError::Json`].
pub fn json(chart: &Chart) -> Result<String> {
    let mut text = serde_json::to_string_pretty(&File {
        schema: SCHEMA,
        chart,
    })?;
    text.push('\n');
    Ok(text)
}

/// The points as CSV (RFC 4180), one row each, in the order given; what is unknown is empty.
///
/// After the columns that every chart has come `edge_rays_at_X`, `leaks_at_X`, `counted_at_X` and `double_hits_at_X` for
/// each offset `X` that any point was measured at. Key-frame curves are in [`json`] alone.
///
/// # Errors
/// [`ChartError::Csv`].
pub fn csv(chart: &Chart) -> Result<String> {
    let offsets = offsets(chart);
    let front = front(chart);
    let mut out = csv::Writer::from_writer(Vec::new());
    let edge = offsets.iter().flat_map(|x| {
        ["edge_rays", "leaks", "counted", "double_hits"].map(|n| format!("{n}_at_{x}"))
    });
    out.write_record(COLUMNS.map(str::to_owned).into_iter().chain(edge))
        .map_err(failed)?;
    for (i, point) in chart.points.iter().enumerate() {
        let mut row = identity(chart, point);
        row.extend(numbers(point, front.contains(&i)));
        row.extend(origin(chart, point));
        row.extend(edges(point, &offsets));
        out.write_record(row).map_err(failed)?;
    }
    let bytes = out
        .into_inner()
        .map_err(|e| ChartError::Csv(e.to_string()))?;
    String::from_utf8(bytes).map_err(|e| ChartError::Csv(e.to_string()))
}

pub(crate) fn failed(e: csv::Error) -> ChartError {
    ChartError::Csv(e.to_string())
}

/// Offsets that any point was measured at.
fn offsets(chart: &Chart) -> Vec<f64> {
    let all = chart.points.iter().flat_map(|p| &p.leaks);
    let mut offsets: Vec<f64> = all.filter_map(|l| known(l.offset)).collect();
    offsets.sort_by(f64::total_cmp);
    offsets.dedup();
    offsets
}

/// Points on their scene's Pareto front.
pub(crate) fn front(chart: &Chart) -> Vec<usize> {
    let dots = dots(chart);
    let on_front = |d: &&Dot<'_>| {
        let here: Vec<Dot<'_>> = dots
            .iter()
            .filter(|o| o.point.scene == d.point.scene)
            .copied()
            .collect();
        front_of(&here).iter().any(|f| f.index == d.index)
    };
    dots.iter().filter(on_front).map(|d| d.index).collect()
}

fn identity(chart: &Chart, point: &Point) -> Vec<String> {
    let scene = chart.scenes.iter().find(|s| s.name == point.scene);
    let adapter = chart
        .machine
        .adapters
        .iter()
        .find(|a| a.backend == point.backend);
    vec![
        point.scene.clone(),
        scene.map_or_else(String::new, |s| s.triangles.to_string()),
        point.backend.clone(),
        adapter.map_or_else(String::new, |a| a.adapter.clone()),
        adapter.map_or_else(String::new, |a| a.driver.clone()),
        point.layout.clone(),
        point.intersector.clone(),
        point.update.clone(),
    ]
}

fn numbers(point: &Point, on_front: bool) -> [String; 18] {
    let ms = point.ms_per_frame;
    let rate = Rate::of(point.wrong, point.rays_tested).map(|r| r.per(PER));
    let t = point.t_error_ulp.unwrap_or_default();
    [
        point.samples.to_string(),
        plain(ms.median),
        plain(ms.p5),
        plain(ms.p95),
        plain(point.mrays_per_s),
        point.rays_tested.to_string(),
        point.wrong.to_string(),
        plain(rate.map(|r| r.value)),
        plain(rate.map(|r| r.low)),
        plain(rate.map(|r| r.high)),
        u8::from(on_front).to_string(),
        point.wrong_shadow.to_string(),
        point.aimed.rays.to_string(),
        point.aimed.wrong.to_string(),
        plain(t.median),
        plain(t.p999),
        plain(t.worst),
        point
            .memory_bytes
            .map_or_else(String::new, |b| b.to_string()),
    ]
}

fn origin(chart: &Chart, point: &Point) -> [String; 5] {
    let machine = &chart.machine;
    [
        machine.cpu.clone().unwrap_or_default(),
        machine.version.clone(),
        machine.date.clone(),
        point.command.clone(),
        SCHEMA.to_string(),
    ]
}

fn edges(point: &Point, offsets: &[f64]) -> impl Iterator<Item = String> {
    offsets.iter().flat_map(|&x| {
        let found = point.leaks.iter().find(|l| l.offset == Some(x));
        let counts = found.map(|l| [l.rays, l.leaks, l.counted, l.double_hits]);
        counts.map_or_else(<[String; 4]>::default, |c| c.map(|n| n.to_string()))
    })
}

/// The shortest digits that read back as the same number.
pub(crate) fn plain(x: Option<f64>) -> String {
    known(x).map_or_else(String::new, |x| x.to_string())
}
