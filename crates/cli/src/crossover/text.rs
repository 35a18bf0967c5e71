//! The table for people, in Markdown: who wins in each cell, then the milliseconds of all.

use super::{Cell, Report, Run};
use crate::table::{grouped, markdown, ms};

/// A table of winners and one of times for each scene.
pub(super) fn text(report: &Report, adapter: &str) -> String {
    let [width, height] = report.size;
    let cpu = report.cpu.as_deref().unwrap_or("unknown cpu");
    let mut text = format!(
        "Frames of {width}x{height} on {adapter}, trees built on {cpu}. Speeds are key frames a frame. Each policy has the layout that is \
         fastest with it.\n"
    );
    for of in report.cells.chunk_by(|a, b| demo(a) == demo(b)) {
        let scene = demo(&of[0]);
        text += &format!(
            "\n{scene}: the fastest (all within 3 %), and its frame over that of async\n\n"
        );
        text += &winners(of, &report.speeds);
        text += &format!(
            "\n{scene}: milliseconds a frame, and over async; > where the run was cut short\n\n"
        );
        text += &times(of);
    }
    if !report.left_out.is_empty() {
        text += "\nLeft out:\n";
        report
            .left_out
            .iter()
            .for_each(|why| text += &format!("- {why}\n"));
    }
    text
}

/// The scene without its size.
fn demo(cell: &Cell) -> &str {
    cell.scene
        .rsplit_once(':')
        .map_or(&cell.scene, |(demo, _)| demo)
}

/// A row for each size and number of threads, a column for each speed.
fn winners(cells: &[Cell], speeds: &[f64]) -> String {
    let mut head = vec!["triangles".to_owned(), "builder threads".to_owned()];
    head.extend(speeds.iter().map(f64::to_string));
    let mut places: Vec<(usize, usize)> = cells
        .iter()
        .map(|c| (c.triangles, c.builder_threads))
        .collect();
    places.sort_unstable();
    places.dedup();
    let row = |&(triangles, threads): &(usize, usize)| {
        let mut row = vec![grouped(triangles), threads.to_string()];
        row.extend(speeds.iter().map(|&speed| {
            let here = (triangles, threads, speed);
            let cell = cells
                .iter()
                .find(|c| (c.triangles, c.builder_threads, c.speed) == here);
            cell.map_or("-".to_owned(), winner)
        }));
        row
    };
    let rows: Vec<_> = places.iter().map(row).collect();
    markdown(&head, &rows)
}

fn winner(cell: &Cell) -> String {
    let ratio = cell
        .over_async
        .map_or("-".to_owned(), |r| format!("{r:.2}"));
    format!("{} {ratio}", cell.winners.join(", "))
}

/// A row for each cell, a column for each policy.
fn times(cells: &[Cell]) -> String {
    let mut updates: Vec<&str> = Vec::new();
    for run in cells.iter().flat_map(|c| &c.runs) {
        if !updates.contains(&run.update) {
            updates.push(run.update);
        }
    }
    let mut head: Vec<String> = ["triangles", "builder threads", "speed"]
        .map(str::to_owned)
        .to_vec();
    head.extend(updates.iter().map(|u| (*u).to_owned()));
    let row = |cell: &Cell| {
        let mut row = vec![
            grouped(cell.triangles),
            cell.builder_threads.to_string(),
            cell.speed.to_string(),
        ];
        row.extend(updates.iter().map(|&update| {
            let run = cell.runs.iter().find(|r| r.update == update);
            run.map_or("-".to_owned(), time)
        }));
        row
    };
    let rows: Vec<_> = cells.iter().map(row).collect();
    markdown(&head, &rows)
}

fn time(run: &Run) -> String {
    let more = if run.timing.cut_short { "> " } else { "" };
    let over = match run.over_async {
        Some(ratio) if run.update != "async" => format!(" ({ratio:.2}x)"),
        _ => String::new(),
    };
    format!("{more}{} {}{over}", ms(run.timing.frame_ms), run.layout)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crossover::tests::run;

    #[test]
    fn each_cell_has_its_winner_at_its_speed() {
        let cell = |triangles, speed, rival, cut_short| {
            let runs = vec![run("async", 2.0, false), run("t-sah", rival, cut_short)];
            Cell::of(("demo:x:7", triangles, speed, 2), runs)
        };
        let cells = vec![
            cell(7, 0.5, 1.0, false),
            cell(7, 2.0, 9.0, true),
            cell(9_000, 2.0, 1.0, false),
        ];
        let report = Report {
            schema: 1,
            version: "",
            command_line: Vec::new(),
            cpu: None,
            cores: 2,
            size: [4, 3],
            speeds: vec![0.5, 2.0],
            cells,
            left_out: vec!["demo:x:9 t-sah: too long".to_owned()],
        };
        let text = text(&report, "card");
        for line in [
            "| triangles | builder threads | 0.5        | 2         |",
            "| 7         | 2               | t-sah 0.50 | async 1.00 |",
            "| 9,000     | 2               | -          | t-sah 0.50 |",
        ] {
            let squeezed = |s: &str| s.split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(
                text.lines().any(|l| squeezed(l) == squeezed(line)),
                "{line}\n{text}"
            );
        }
        assert!(
            text.contains("> 9.000 fast (4.50x)") && text.contains("2.000 fast |"),
            "{text}"
        );
        assert!(text.contains("- demo:x:9 t-sah: too long"), "{text}");
    }
}
