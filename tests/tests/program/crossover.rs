//! `crossover`: a table of who wins, and every run behind it.

use crate::sandbox::{Sandbox, ensure, trial};
use libtest_mimic::{Failed, Trial};
use serde_json::Value;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("crossover::every_cell_has_a_winner_and_its_runs", table),
        trial("crossover::what_cannot_be_compared_is_refused", refused),
    ]
}

const SMALL: &str = "crossover demo:twist --backend cpu --size 16x12 --frames 6 --quiet";

fn table(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = "--triangles 200,1K --speeds 0.25,2 --threads 1,2 --against t-sah,device-rebuild --json x.json";
    let run = sandbox.run(&format!("{SMALL} {words}")).succeeds()?;
    for text in ["| triangles | builder threads |", "demo:twist", "Left out:"] {
        ensure(run.stdout.contains(text), || run.stdout.clone())?;
    }
    let json: Value = serde_json::from_slice(&sandbox.read("x.json"))?;
    let cells = json["cells"].as_array().ok_or("no cells")?;
    ensure(cells.len() == 2 * 2 * 2, || {
        format!("{} cells", cells.len())
    })?;
    for cell in cells {
        let runs = cell["runs"].as_array().ok_or("no runs")?;
        let updates: Vec<_> = runs.iter().filter_map(|r| r["update"].as_str()).collect();
        ensure(updates == ["async", "t-sah"], || format!("{updates:?}"))?;
        let ms: Vec<_> = runs.iter().filter_map(|r| r["frame_ms"].as_f64()).collect();
        let ratio = cell["over_async"].as_f64().ok_or("no ratio")?;
        let least = ms[0].min(ms[1]);
        ensure((ratio - least / ms[0]).abs() < 1e-9, || cell.to_string())?;
        let winner = if ms[1] < ms[0] { "t-sah" } else { "async" };
        ensure(cell["winners"][0] == winner, || cell.to_string())?;
    }
    let left_out = json["left_out"].as_array().ok_or("nothing left out")?;
    ensure(
        left_out
            .iter()
            .any(|l| l.to_string().contains("device-rebuild")),
        || format!("{left_out:?}"),
    )
}

fn refused(sandbox: &Sandbox) -> Result<(), Failed> {
    for (words, why) in [
        ("crossover horse/", "no demo"),
        ("crossover demo:twist --speeds 0", "above 0"),
        ("crossover demo:twist --triangles 1G", "number"),
        ("crossover demo:twist --threads 0", "threads"),
    ] {
        sandbox.run(words).fails(2, &[why])?;
    }
    Ok(())
}
