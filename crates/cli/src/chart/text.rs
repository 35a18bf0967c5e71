//! The points for people.

use crate::table::{grouped, ms, table};
use chart::{Chart, Point};
use std::path::PathBuf;

const HEAD: [&str; 15] = [
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
    "wrong shadows",
    "t off, ulp",
    "leaks",
    "MiB",
];

/// One row a point, what its columns mean, and where the files are.
pub(super) fn text(chart: &Chart, written: &[PathBuf]) -> String {
    let rows: Vec<_> = chart.points.iter().map(cells).collect();
    let mut text = table(&HEAD, &rows, 5);
    text += "wrong: closest hits of so many that differ from exact arithmetic; aimed: rays at edges and vertices\n\
             t off: 99.9 % of hits are off by no more; leaks: of so many rays from inside closed bodies, at all offsets\n";
    for path in written {
        text += &format!("{}\n", path.display());
    }
    text
}

fn cells(p: &Point) -> Vec<String> {
    let maybe = |x: Option<f64>| x.map_or("-".to_owned(), ms);
    let of = |n: u64, all: u64| format!("{} of {}", grouped(n as usize), grouped(all as usize));
    let leaks = p.leaks.iter().map(|l| l.leaks).sum();
    let fired = p.leaks.iter().map(|l| l.rays).sum();
    let bytes = p.memory_bytes.map(|b| b as f64 / f64::from(1 << 20));
    vec![
        p.scene.clone(),
        p.backend.clone(),
        p.intersector.clone(),
        p.layout.clone(),
        p.update.clone(),
        maybe(p.ms_per_frame.median),
        maybe(p.ms_per_frame.p5),
        maybe(p.ms_per_frame.p95),
        p.mrays_per_s.map_or("-".to_owned(), |r| format!("{r:.2}")),
        of(p.wrong, p.rays_tested),
        of(p.aimed.wrong, p.aimed.rays),
        grouped(p.wrong_shadow as usize),
        p.t_error_ulp
            .and_then(|t| t.p999)
            .map_or("-".to_owned(), |u| format!("{u:.2}")),
        of(leaks, fired),
        bytes.map_or("-".to_owned(), |b| format!("{b:.0}")),
    ]
}
