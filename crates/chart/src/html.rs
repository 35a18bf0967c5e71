//! The chart as a page that works offline: the picture, a box with what the pointer is on, and a table.

use crate::data::{Chart, Point, known};
use crate::error::Result;
use crate::overlay::{bands, rate_words};
use crate::page;
use crate::table::front;
use crate::text::{count, escape, number};
use std::fmt::Write as _;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

const COLUMNS: [&str; 14] = [
    "scene",
    "backend",
    "layout",
    "intersector",
    "update",
    "ms a frame (5 to 95 %)",
    "Mrays/s",
    "wrong / rays tested",
    "wrong per million (95 %)",
    "wrong shadows",
    "wrong / rays aimed at edges",
    "t error, ulp (median, 99.9 %, worst)",
    "memory, MiB",
    "frames timed",
];

/// The chart as one HTML file that asks for nothing from outside, and says so to the browser.
///
/// Pointing at or focusing a point shows its numbers and its command, which can be copied.
/// Without scripts the picture and the table remain.
///
/// # Errors
/// See [`crate::ChartError`].
pub fn html(chart: &Chart) -> Result<String> {
    let picture = bands(chart, &page::draw(chart)?);
    let title = escape(&chart.title);
    Ok(format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" \
         content=\"default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n\
         <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n\
         <p class=\"hint\">Point at a mark, or step through the marks with Tab, to see its numbers and its command; \
         a click or Enter keeps them in view.</p>\n\
         <figure>\n{picture}</figure>\n\
         <aside id=\"details\" hidden>\n<h2></h2>\n<dl></dl>\n\
         <p class=\"command\"><code></code><button type=\"button\">copy</button></p>\n</aside>\n\
         {}</main>\n<script>\n{SCRIPT}</script>\n</body>\n</html>\n",
        table(chart),
    ))
}

fn table(chart: &Chart) -> String {
    let front = front(chart);
    let mut out = String::from(
        "<section>\n<h2>All points</h2>\n<p>★ is on its scene's Pareto front.</p>\n\
         <div class=\"wide\"><table>\n<thead><tr><th></th>",
    );
    for name in COLUMNS {
        let _ = write!(out, "<th scope=\"col\">{name}</th>");
    }
    out.push_str("<th scope=\"col\">command</th></tr></thead>\n<tbody>\n");
    for (i, point) in chart.points.iter().enumerate() {
        let star = if front.contains(&i) { "★" } else { "" };
        let _ = write!(out, "<tr id=\"point-{i}\"><td>{star}</td>");
        for cell in cells(point) {
            let _ = write!(out, "<td>{}</td>", escape(&cell));
        }
        let _ = writeln!(out, "<td><code>{}</code></td></tr>", escape(&point.command));
    }
    out.push_str("</tbody>\n</table></div>\n</section>\n");
    out
}

fn cells(point: &Point) -> [String; 14] {
    let ms = point.ms_per_frame;
    let t = point.t_error_ulp.unwrap_or_default();
    let maybe = |x: Option<f64>| known(x).map_or_else(|| "–".to_owned(), number);
    let mib = point.memory_bytes.map(|b| b as f64 / f64::from(1 << 20));
    [
        point.scene.clone(),
        point.backend.clone(),
        point.layout.clone(),
        point.intersector.clone(),
        point.update.clone(),
        format!(
            "{} ({} to {})",
            maybe(ms.median),
            maybe(ms.p5),
            maybe(ms.p95)
        ),
        maybe(point.mrays_per_s),
        format!("{} / {}", count(point.wrong), count(point.rays_tested)),
        rate_words(point.wrong, point.rays_tested),
        count(point.wrong_shadow),
        format!("{} / {}", count(point.aimed.wrong), count(point.aimed.rays)),
        format!("{}, {}, {}", maybe(t.median), maybe(t.p999), maybe(t.worst)),
        maybe(mib),
        count(point.samples),
    ]
}
