//! `bench` over sizes: a table and a picture.

use crate::sandbox::{Sandbox, ensure, trial};
use libtest_mimic::{Failed, Trial};

pub(crate) fn trials() -> Vec<Trial> {
    vec![trial("bench::sizes_have_their_rows_and_points", files)]
}

fn files(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = "bench demo:twist:300 demo:twist:1000 --backend cpu --update async,refit --layout bvh2 --frames 5 \
                 --size 16x12 --builder-threads 1,2 --csv b.csv --growth b.svg --quiet";
    sandbox.run(words).succeeds()?;
    let csv = String::from_utf8(sandbox.read("b.csv"))?;
    let rows: Vec<Vec<&str>> = csv.lines().map(|l| l.split(',').collect()).collect();
    // Two sizes, two policies, two numbers of threads, and the heading.
    ensure(rows.len() == 9, || csv.clone())?;
    let column = |name: &str| {
        rows[0]
            .iter()
            .position(|c| *c == name)
            .ok_or(name.to_owned())
    };
    let (wall, builders) = (column("wall_ms")?, column("builder_threads")?);
    for row in &rows[1..] {
        let is_known = row[wall].parse::<f64>().is_ok_and(|ms| ms > 0.0);
        ensure(is_known && ["1", "2"].contains(&row[builders]), || {
            row.join(",")
        })?;
    }
    let svg = String::from_utf8(sandbox.read("b.svg"))?;
    ensure(svg.contains("<svg") && svg.contains("Start-up"), || svg)
}
