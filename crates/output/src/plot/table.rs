//! Tables of the points: CSV and JSON for programs, and formatted text for people.

use super::{Chart, ChartPoint, Failure, FamilyCounts, Rate, Result};
use serde::Serialize;

/// Schema version of `points.json`.
pub const SCHEMA: u32 = 1;

/// Returns the whole chart as JSON.
pub fn json(chart: &Chart) -> Result<String> {
    #[derive(Serialize)]
    struct File<'a> {
        schema: u32,
        #[serde(flatten)]
        chart: &'a Chart,
    }
    let schema = SCHEMA;
    Ok(serde_json::to_string_pretty(&File { schema, chart })? + "\n")
}

/// Returns the points as CSV with one row each, in chart order, followed by the failures. Unknown cells are empty.
///
/// The fixed columns are followed by `rays_of_F` and `wrong_of_F` for each family `F` of mixed range.
pub fn csv(chart: &Chart) -> Result<String> {
    let head = cells(chart, &ChartPoint::default(), false);
    let points = chart.points.iter().enumerate();
    let points = points.map(|(i, point)| cells(chart, point, chart.is_on_front(i)));
    let failures = chart.failures.iter();
    let failures = failures.map(|failure| failed_cells(&head, failure));
    let rows: Vec<_> = points.chain(failures).collect();
    let rows = rows.into_iter();
    let names = head.into_iter().map(|c| c.0);
    csv_table(names, rows.map(|row| row.into_iter().map(|c| c.1)))
}

/// Formats a table as CSV (RFC 4180).
pub fn csv_table(
    head: impl IntoIterator<Item: AsRef<[u8]>>,
    rows: impl IntoIterator<Item: IntoIterator<Item: AsRef<[u8]>>>,
) -> Result<String> {
    let mut out = csv::Writer::from_writer(Vec::new());
    out.write_record(head)?;
    rows.into_iter().try_for_each(|row| out.write_record(row))?;
    Ok(String::from_utf8(out.into_inner()?)?)
}

/// Returns the row of a failure: its names, its reason and the schema version. All other cells are empty.
fn failed_cells(head: &[(String, String)], failure: &Failure) -> Vec<(String, String)> {
    let cell = |column: &str| match column {
        "scene" => failure.scene.clone(),
        "backend" => failure.backend.clone(),
        "intersector" => failure.intersector.clone(),
        "update" => failure.update.clone(),
        "error" => failure.error.clone(),
        "schema" => SCHEMA.to_string(),
        _ => String::new(),
    };
    let named = head
        .iter()
        .map(|(column, _)| (column.clone(), cell(column)));
    named.collect()
}

/// Returns the cells of a CSV row with their column names.
fn cells(chart: &Chart, point: &ChartPoint, is_on_front: bool) -> Vec<(String, String)> {
    let scene = chart.scenes.iter().find(|s| s.name == point.scene);
    let machine = &chart.machine;
    let adapter = machine.adapters.iter().find(|a| a.backend == point.backend);
    let ms = point.ms_per_frame;
    let rate = Rate::of(point.wrong, point.rays_tested);
    let fixed = [
        ("scene", point.scene.clone()),
        ("triangles", plain(scene.map(|s| s.triangles))),
        ("backend", point.backend.clone()),
        ("adapter", plain(adapter.map(|a| &a.adapter))),
        ("driver", plain(adapter.map(|a| &a.driver))),
        ("intersector", point.intersector.clone()),
        ("update", point.update.clone()),
        ("samples", point.samples.to_string()),
        ("ms_median", ms.median.to_string()),
        ("ms_p5", ms.p5.to_string()),
        ("ms_p95", ms.p95.to_string()),
        ("mrays_per_s", plain(point.mrays_per_s)),
        ("rays_tested", point.rays_tested.to_string()),
        ("wrong", point.wrong.to_string()),
        ("wrong_per_million", plain(rate.map(|r| r.value))),
        ("wrong_per_million_low", plain(rate.map(|r| r.low))),
        ("wrong_per_million_high", plain(rate.map(|r| r.high))),
        ("on_front", u8::from(is_on_front).to_string()),
        ("wrong_shadow", point.wrong_shadow.to_string()),
        ("aimed_rays", point.aimed.rays.to_string()),
        ("aimed_wrong", point.aimed.wrong.to_string()),
        ("memory_bytes", plain(point.memory_bytes)),
        ("cpu", plain(machine.cpu.as_ref())),
        ("version", machine.version.clone()),
        ("date", machine.date.clone()),
        ("schema", SCHEMA.to_string()),
        ("error", String::new()),
    ];
    let mut cells = fixed.map(|(name, cell)| (name.to_owned(), cell)).to_vec();
    for family in chart.families() {
        let counts = point.mixed_range.iter().find(|f| f.family == family);
        cells.push((format!("rays_of_{family}"), plain(counts.map(|f| f.rays))));
        cells.push((format!("wrong_of_{family}"), plain(counts.map(|f| f.wrong))));
    }
    cells
}

/// Formats a value. A number gets the fewest digits that identify it. `None` becomes an empty cell.
fn plain(x: Option<impl ToString>) -> String {
    x.map_or_else(String::new, |x| x.to_string())
}

/// Returns the formatted cells of a point with their column names.
#[must_use]
pub fn row(p: &ChartPoint) -> Vec<(&'static str, String)> {
    let maybe = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), number);
    let of = |n, rays| format!("{} of {}", format_count(n), format_count(rays));
    let ms = p.ms_per_frame;
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let sum = |count: fn(&FamilyCounts) -> u64| {
        let counts = p.mixed_range.iter().map(count);
        counts.fold(0, u64::saturating_add)
    };
    let mixed = of(sum(|f| f.wrong), sum(|f| f.rays));
    vec![
        ("scene", p.scene.clone()),
        ("backend", p.backend.clone()),
        ("intersector", p.intersector.clone()),
        ("update", p.update.clone()),
        ("ms a frame", number(ms.median)),
        ("5 %", number(ms.p5)),
        ("95 %", number(ms.p95)),
        ("Mrays/s", maybe(p.mrays_per_s)),
        ("wrong", of(p.wrong, p.rays_tested)),
        ("wrong aimed", of(p.aimed.wrong, p.aimed.rays)),
        ("wrong mixed range", mixed),
        ("wrong shadows", format_count(p.wrong_shadow)),
        ("MiB", maybe(p.memory_bytes.map(mib))),
    ]
}

/// Describes a point in one line.
pub(crate) fn described(p: &ChartPoint) -> String {
    let ms = number(p.ms_per_frame.median);
    let (wrong, of) = (format_count(p.wrong), format_count(p.rays_tested));
    format!(
        "{}, {}: {ms} ms a frame, {wrong} wrong of {of} rays",
        p.scene,
        p.name()
    )
}

/// Formats a number with three significant digits.
pub(crate) fn number(x: f64) -> String {
    let scientific = format!("{x:.2e}");
    match scientific.parse::<f64>() {
        Ok(rounded) if x == 0.0 || (1e-4..1e6).contains(&x.abs()) => rounded.to_string(),
        _ => scientific,
    }
}

/// Formats an integer with thousands separators.
#[must_use]
pub fn format_count(n: u64) -> String {
    let digits: Vec<char> = n.to_string().chars().collect();
    let groups = digits.rchunks(3).rev().map(String::from_iter);
    groups.collect::<Vec<_>>().join(",")
}

/// Escapes the special characters of XML and HTML.
pub(crate) fn escape(text: &str) -> String {
    (super::panel::clean(text).replace('&', "&amp;"))
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
        .replace('\'', "&#39;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_numbers_and_counts() {
        let cases = [
            (0.0, "0"),
            (9.999, "10"),
            (0.012_345, "0.0123"),
            (123_456.0, "123000"),
            (1.5e-9, "1.50e-9"),
            (-4.2e12, "-4.20e12"),
        ];
        for (x, text) in cases {
            assert_eq!(number(x), text);
        }
        let counts = [0, 999, 1000, 1_234_567].map(format_count);
        assert_eq!(counts, ["0", "999", "1,000", "1,234,567"]);
    }
}
