//! The chart as a page that works offline: the picture and a table.

use super::Result;
use super::data::Chart;
use super::page::{front, svg};
use super::table::{HEAD, escape, rows};
use std::fmt::Write as _;

const STYLE: &str = "body { font: 15px sans-serif; margin: 1em auto; max-width: 1000px; color: #1a1a1a; background: #fff }\n\
    svg { max-width: 100%; height: auto }\n\
    .wide { overflow-x: auto }\n\
    table { border-collapse: collapse; white-space: nowrap }\n\
    th, td { padding: 0.2em 0.6em; border-bottom: 1px solid #ddd; text-align: left }\n";

/// The chart as one HTML file that asks for nothing from outside, and says so to the browser.
///
/// # Errors
/// See [`super::ChartError`].
pub fn html(chart: &Chart) -> Result<String> {
    let picture = svg(chart)?;
    let title = escape(&chart.title);
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
         <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <p>Point at a mark to see its numbers and the command that times it again.</p>\n\
         <figure>\n{picture}</figure>\n\
         <h2>All points</h2>\n<p>★: no other point of its scene is both faster and more often right.</p>\n\
         <div class=\"wide\"><table>\n<thead><tr><th></th>"
    );
    for name in HEAD.iter().chain(&["command"]) {
        let _ = write!(out, "<th>{name}</th>");
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    for (i, (point, row)) in chart.points.iter().zip(rows(chart)).enumerate() {
        let is_on_front = front(chart, &point.scene).iter().any(|d| d.index == i);
        let star = if is_on_front { "★" } else { "" };
        let _ = write!(out, "<tr><td>{star}</td>");
        for cell in row {
            let _ = write!(out, "<td>{}</td>", escape(&cell));
        }
        let command = escape(&point.command);
        let _ = writeln!(out, "<td><code>{command}</code></td></tr>");
    }
    out.push_str("</tbody>\n</table></div>\n</body>\n</html>\n");
    Ok(out)
}
