//! The points as rows: for programs as CSV and JSON, for people in words.

use super::Result;
use super::data::{Chart, Leaks, Point, known};
use super::page::{PER, front};
use super::rate::Rate;
use serde::Serialize;
use std::collections::BTreeSet;

/// The version of `points.json`.
pub const SCHEMA: u32 = 1;

/// What [`rows`] hold.
pub const HEAD: [&str; 16] = [
    "scene",
    "backend",
    "intersector",
    "layout",
    "update",
    "ms a frame",
    "5 %",
    "95 %",
    "Mrays/s",
    "wrong",
    "wrong aimed",
    "wrong mixed range",
    "wrong shadows",
    "t off, ulp",
    "leaks",
    "MiB",
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
/// [`super::ChartError::Json`].
pub fn json(chart: &Chart) -> Result<String> {
    let schema = SCHEMA;
    let text = serde_json::to_string_pretty(&File { schema, chart })?;
    Ok(text + "\n")
}

/// The points as CSV (RFC 4180), one row each, in the order given; what is unknown is empty.
///
/// After the columns that every chart has come `edge_rays_at_X`, `leaks_at_X`, `counted_at_X` and `double_hits_at_X` for
/// each offset `X` that any point was measured at, and `rays_of_F` and `wrong_of_F` for each family `F` of mixed range.
/// Key-frame curves are in [`json`] alone.
///
/// # Errors
/// [`super::ChartError::Csv`].
pub fn csv(chart: &Chart) -> Result<String> {
    let mut out = csv::Writer::from_writer(Vec::new());
    let nothing = Point::default();
    out.write_record(cells(chart, &nothing, false).into_iter().map(|c| c.0))?;
    for (i, point) in chart.points.iter().enumerate() {
        let is_on_front = front(chart, &point.scene).iter().any(|d| d.index == i);
        let row = cells(chart, point, is_on_front);
        out.write_record(row.into_iter().map(|c| c.1))?;
    }
    let bytes = out
        .into_inner()
        .map_err(|e| csv::Error::from(e.into_error()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// One row of the CSV with its heading.
fn cells(chart: &Chart, point: &Point, is_on_front: bool) -> Vec<(String, String)> {
    let scene = chart.scenes.iter().find(|s| s.name == point.scene);
    let machine = &chart.machine;
    let adapter = machine.adapters.iter().find(|a| a.backend == point.backend);
    let ms = point.ms_per_frame;
    let rate = Rate::of(point.wrong, point.rays_tested).map(|r| r.per(PER));
    let t = point.t_error_ulp.unwrap_or_default();
    let mut cells: Vec<(String, String)> = Vec::new();
    let mut add = |name: &str, cell: String| cells.push((name.to_owned(), cell));
    add("scene", point.scene.clone());
    add("triangles", plain(scene.map(|s| s.triangles)));
    add("backend", point.backend.clone());
    add("adapter", plain(adapter.map(|a| &a.adapter)));
    add("driver", plain(adapter.map(|a| &a.driver)));
    add("layout", point.layout.clone());
    add("intersector", point.intersector.clone());
    add("update", point.update.clone());
    add("samples", point.samples.to_string());
    add("ms_median", plain(known(ms.median)));
    add("ms_p5", plain(known(ms.p5)));
    add("ms_p95", plain(known(ms.p95)));
    add("mrays_per_s", plain(known(point.mrays_per_s)));
    add("rays_tested", point.rays_tested.to_string());
    add("wrong", point.wrong.to_string());
    add("wrong_per_million", plain(rate.map(|r| r.value)));
    add("wrong_per_million_low", plain(rate.map(|r| r.low)));
    add("wrong_per_million_high", plain(rate.map(|r| r.high)));
    add("on_front", u8::from(is_on_front).to_string());
    add("wrong_shadow", point.wrong_shadow.to_string());
    add("aimed_rays", point.aimed.rays.to_string());
    add("aimed_wrong", point.aimed.wrong.to_string());
    add("t_error_ulp_median", plain(known(t.median)));
    add("t_error_ulp_p999", plain(known(t.p999)));
    add("t_error_ulp_worst", plain(known(t.worst)));
    add("memory_bytes", plain(point.memory_bytes));
    add("cpu", plain(machine.cpu.as_ref()));
    add("version", machine.version.clone());
    add("date", machine.date.clone());
    add("command", point.command.clone());
    add("schema", SCHEMA.to_string());
    for x in offsets(chart) {
        let at = point.leaks.iter().find(|l| l.offset == Some(x));
        let mut add = |name, read: fn(&Leaks) -> u64| {
            add(&format!("{name}_at_{x}"), plain(at.map(read)));
        };
        add("edge_rays", |l| l.rays);
        add("leaks", |l| l.leaks);
        add("counted", |l| l.counted);
        add("double_hits", |l| l.double_hits);
    }
    for family in families(chart) {
        let of = point.mixed_range.iter().find(|f| f.family == family);
        add(&format!("rays_of_{family}"), plain(of.map(|f| f.rays)));
        add(&format!("wrong_of_{family}"), plain(of.map(|f| f.wrong)));
    }
    cells
}

/// The shortest digits that read back as the same number, or nothing.
fn plain(x: Option<impl ToString>) -> String {
    x.map_or_else(String::new, |x| x.to_string())
}

/// Offsets that any point was measured at.
pub(crate) fn offsets(chart: &Chart) -> Vec<f64> {
    let leaks = chart.points.iter().flat_map(|p| &p.leaks);
    let mut offsets: Vec<f64> = leaks.filter_map(|l| known(l.offset)).collect();
    offsets.sort_by(f64::total_cmp);
    offsets.dedup();
    offsets
}

/// Families of mixed range that any point was measured in.
pub(crate) fn families(chart: &Chart) -> BTreeSet<String> {
    let all = chart.points.iter().flat_map(|p| &p.mixed_range);
    all.map(|f| f.family.clone()).collect()
}

/// The points for people, one row each; [`HEAD`] says what its cells are.
#[must_use]
pub fn rows(chart: &Chart) -> Vec<Vec<String>> {
    chart.points.iter().map(row).collect()
}

fn row(p: &Point) -> Vec<String> {
    let maybe = |x| known(x).map_or_else(|| "-".to_owned(), number);
    let sum = |counts: &mut dyn Iterator<Item = (u64, u64)>| {
        let add = |(n, of): (u64, u64), more: (u64, u64)| {
            (n.saturating_add(more.0), of.saturating_add(more.1))
        };
        let (n, of) = counts.fold((0, 0), add);
        format!("{} of {}", count(n), count(of))
    };
    let ms = p.ms_per_frame;
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    vec![
        p.scene.clone(),
        p.backend.clone(),
        p.intersector.clone(),
        p.layout.clone(),
        p.update.clone(),
        maybe(ms.median),
        maybe(ms.p5),
        maybe(ms.p95),
        maybe(p.mrays_per_s),
        sum(&mut [(p.wrong, p.rays_tested)].into_iter()),
        sum(&mut [(p.aimed.wrong, p.aimed.rays)].into_iter()),
        sum(&mut p.mixed_range.iter().map(|f| (f.wrong, f.rays))),
        count(p.wrong_shadow),
        maybe(p.t_error_ulp.and_then(|t| t.p999)),
        sum(&mut p.leaks.iter().map(|l| (l.leaks, l.rays))),
        maybe(p.memory_bytes.map(mib)),
    ]
}

/// A point in a sentence.
pub(crate) fn described(p: &Point) -> String {
    let ms = known(p.ms_per_frame.median).map_or("unknown".to_owned(), number);
    let (wrong, of) = (count(p.wrong), count(p.rays_tested));
    format!(
        "{}, {}: {ms} ms a frame, {wrong} wrong of {of} rays",
        p.scene,
        p.name()
    )
}

/// Three significant digits.
pub(crate) fn number(x: f64) -> String {
    let scientific = format!("{x:.2e}");
    match scientific.parse::<f64>() {
        Ok(rounded) if x == 0.0 || (1e-4..1e6).contains(&x.abs()) => rounded.to_string(),
        _ => scientific,
    }
}

/// A whole number with its thousands apart.
pub(crate) fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// The text with the characters that mean something to XML and HTML written as references.
pub(crate) fn escape(text: &str) -> String {
    let clean = super::panel::clean(text);
    let pairs = [
        ('&', "&amp;"),
        ('<', "&lt;"),
        ('>', "&gt;"),
        ('"', "&quot;"),
        ('\'', "&#39;"),
    ];
    let replace = |text: String, (c, by): (char, &str)| text.replace(c, by);
    pairs.into_iter().fold(clean, replace)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_and_counts_are_grouped() {
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
        let counts = [0, 999, 1000, 1_234_567].map(count);
        assert_eq!(counts, ["0", "999", "1,000", "1,234,567"]);
    }

    #[test]
    fn nothing_in_a_name_is_markup() {
        assert_eq!(escape("<&>\"'\u{1}\n"), "&lt;&amp;&gt;&quot;&#39;\u{fffd} ");
    }
}
