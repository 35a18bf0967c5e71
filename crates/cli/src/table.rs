//! Formats results as text.

use crate::console;
use comfy_table::{Cell, CellAlignment, Table, presets};
use output::{Summary, TIMES, overview, plot};
use pipeline::FrameRecord;

/// A row of a table: cells with the names of their columns.
pub(crate) type Cells<'a> = Vec<(&'a str, String)>;

/// Formats rows as a table. All rows have the same columns. The first `words` columns hold text, the others hold
/// numbers. If the terminal is too narrow, returns a list instead.
pub(crate) fn table<'a>(rows: impl IntoIterator<Item = Cells<'a>>, words: usize) -> String {
    let rows: Vec<_> = rows.into_iter().collect();
    within(console::columns(), &rows, words)
}

fn within(columns: Option<usize>, rows: &[Cells<'_>], words: usize) -> String {
    let text = wide(rows, words);
    let fits = |line: &str| columns.is_none_or(|most| line.chars().count() <= most);
    if text.lines().all(fits) {
        return text;
    }
    let line = |(name, text): &(&str, String)| format!("{name}: {text}\n");
    let list = |row: &Cells<'_>| row.iter().map(line).collect::<String>();
    rows.iter().map(list).collect::<Vec<_>>().join("\n")
}

fn wide(rows: &[Cells<'_>], words: usize) -> String {
    let mut table = Table::new();
    table.load_style(presets::UTF8_BORDERS_ONLY);
    let head = rows.iter().take(1).flatten();
    table.set_header(head.map(|(name, _)| Cell::new(name)));
    for row in rows {
        table.add_row(row.iter().map(|(_, text)| Cell::new(text)));
    }
    for column in table.column_iter_mut().skip(words) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table.trim_fmt() + "\n"
}

/// Formats the median, the 95th percentile and the maximum of each stage's time as a table. Omits stages without times.
pub(crate) fn stages(frames: &[FrameRecord]) -> String {
    let summary = overview(frames);
    let row = |&(name, _): &(&str, _)| {
        let s: Summary = summary.get(name).copied().flatten()?;
        let title = name.trim_end_matches("_ms").replace('_', " ");
        Some(vec![
            ("stage", title),
            ("median ms", ms(s.median)),
            ("p95 ms", ms(s.p95)),
            ("worst ms", ms(s.worst)),
        ])
    };
    table(TIMES.iter().filter_map(row), 1)
}

pub(crate) fn ms(x: f64) -> String {
    format!("{x:.3}")
}

/// Formats an integer with thousands separators.
pub(crate) fn format_count(n: usize) -> String {
    plot::format_count(n as u64)
}

/// Formats a number with its noun: `1 frame`, `2,000 frames`.
pub(crate) fn counted(n: usize, [one, many]: [&str; 2]) -> String {
    format!("{} {}", format_count(n), if n == 1 { one } else { many })
}

/// Singular and plural of a noun, for [`counted`].
pub(crate) const TRIANGLES: [&str; 2] = ["triangle", "triangles"];
pub(crate) const KEY_FRAMES: [&str; 2] = ["key frame", "key frames"];
pub(crate) const FRAMES: [&str; 2] = ["frame", "frames"];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_table_becomes_a_list() {
        let row = |update: &str| {
            let texts = [update, "1.25", "12.5"].map(str::to_owned);
            let names = ["update", "trace primary ms", "worst ms"];
            names.into_iter().zip(texts).collect::<Cells<'_>>()
        };
        let at = |columns| within(columns, &[row("refit"), row("async")], 1);
        assert_eq!(at(Some(100)), at(None));
        assert!(at(None).lines().all(|l| l.chars().count() > 39));
        let list = "update: refit\ntrace primary ms: 1.25\nworst ms: 12.5\n";
        let lists = format!("{list}\n{}", list.replace("refit", "async"));
        assert_eq!(at(Some(39)), lists);
    }

    #[test]
    fn counts_use_singular_and_plural() {
        let all = [0, 1, 1000].map(|n| counted(n, KEY_FRAMES));
        assert_eq!(all, ["0 key frames", "1 key frame", "1,000 key frames"]);
    }

    #[test]
    fn omits_unmeasured_stages() {
        let mut frame = FrameRecord {
            host_bytes: Some(3 << 20),
            ..FrameRecord::default()
        };
        frame.report.times.refit_ms = Some(2.0);
        let told = stages(&[frame]);
        let refits = told.contains("refit") && !told.contains("interpolate");
        assert!(refits, "{told}");
    }
}
