//! How long every run takes over what every other run of the same scene takes.

use super::Row;
use crate::stop::Stop;
use crate::table::table;
use serde::Serialize;

/// One run over another.
#[derive(Serialize)]
pub(super) struct Ratio {
    scene: String,
    run: String,
    /// The rival.
    over: String,
    /// Of device times with what a frame waited for its tree.
    device: Option<f64>,
    /// Of host times.
    wall: Option<f64>,
}

/// The most runs of a scene that are all set against each other for people; of more, only the baseline is.
const MANY: usize = 12;

/// What a run is called among those of its scene.
pub(super) fn name(r: &Row) -> String {
    let without = if r.predict == Some(false) {
        " unpredicted"
    } else {
        ""
    };
    let words = [r.backend, r.update, r.intersector, r.layout];
    let rays = r.rays.map_or(String::new(), |rays| format!(" {rays} rays"));
    format!("{}{without}{rays}", words.join(" "))
}

/// Whether two runs did the same work.
fn comparable(a: &Row, b: &Row) -> bool {
    (&a.scene, a.rays) == (&b.scene, b.rays)
}

/// Median of what the device took and what the frame waited for its tree.
pub(super) fn frame_ms(r: &Row) -> Option<f64> {
    let frames = r.per_frame.get(1..).filter(|rest| !rest.is_empty());
    let all = frames.unwrap_or(&r.per_frame).iter();
    let ms = all.filter_map(|f| Some(f.device_ms? + f.build_wait_ms.unwrap_or(0.0)));
    output::Summary::of(ms).map(|s| s.median)
}

/// All pairs within each scene.
pub(super) fn ratios(rows: &[Row]) -> Vec<Ratio> {
    let over = |a: Option<f64>, b: Option<f64>| Some(a? / b.filter(|&b| b > 0.0)?);
    let mut all = Vec::new();
    for (i, run) in rows.iter().enumerate() {
        for (j, rival) in rows.iter().enumerate() {
            if i == j || !comparable(run, rival) {
                continue;
            }
            all.push(Ratio {
                scene: run.scene.clone(),
                run: name(run),
                over: name(rival),
                device: over(frame_ms(run), frame_ms(rival)),
                wall: over(run.wall_ms, rival.wall_ms),
            });
        }
    }
    all
}

/// The run of every scene that all others are set against: the first whose name has all words of `against`, else the first.
fn baseline<'a>(rows: &[&'a Row], against: Option<&str>) -> Option<&'a Row> {
    let Some(words) = against else {
        return rows.first().copied();
    };
    let has = |row: &Row| {
        let name = name(row);
        let mut there = name.split(' ');
        words
            .split_whitespace()
            .all(|w| there.by_ref().any(|t| t == w))
    };
    rows.iter().copied().find(|row| has(row))
}

/// Refuses a baseline that is no run of any scene.
pub(super) fn check(rows: &[Row], against: Option<&str>) -> Result<(), Stop> {
    let all: Vec<&Row> = rows.iter().collect();
    if all.is_empty() || baseline(&all, against).is_some() {
        return Ok(());
    }
    let names: Vec<_> = rows.iter().map(name).collect();
    Err(Stop::bad(format!(
        "--against '{}' is none of {}",
        against.unwrap_or_default(),
        names.join(", ")
    )))
}

/// A table a scene: every run over the baseline, and over every other where they are few.
pub(super) fn text(rows: &[Row], against: Option<&str>) -> String {
    let mut text = String::new();
    for of in rows.chunk_by(comparable) {
        let of: Vec<&Row> = of.iter().collect();
        if of.len() > 1
            && let Some(baseline) = baseline(&of, against)
        {
            text += &format!(
                "{}: times over those of {}\n",
                baseline.scene,
                name(baseline)
            );
            text += &matrix(&of, baseline);
        }
    }
    text
}

fn matrix(rows: &[&Row], baseline: &Row) -> String {
    let show = |a: Option<f64>, b: Option<f64>| match (a, b) {
        (Some(a), Some(b)) if b > 0.0 => format!("{:.2}", a / b),
        _ => "-".to_owned(),
    };
    let numbered: Vec<String> = (1..=rows.len()).map(|i| format!("/{i}")).collect();
    let mut head = vec!["", "run", "device", "wall"];
    if rows.len() <= MANY {
        head.extend(numbered.iter().map(String::as_str));
    }
    let line = |(i, r): (usize, &&Row)| {
        let mut cells = vec![(i + 1).to_string(), name(r)];
        cells.push(show(frame_ms(r), frame_ms(baseline)));
        cells.push(show(r.wall_ms, baseline.wall_ms));
        if rows.len() <= MANY {
            cells.extend(rows.iter().map(|rival| show(r.wall_ms, rival.wall_ms)));
        }
        cells
    };
    let lines: Vec<_> = rows.iter().enumerate().map(line).collect();
    table(&head, &lines, 2)
}
