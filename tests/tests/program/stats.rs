//! The statistics file: schema 1.

use crate::sandbox::{Sandbox, ensure, trial};
use libtest_mimic::{Failed, Trial};
use serde_json::Value;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("stats::every_promised_field_is_there", every_field),
        trial("stats::generations_and_ages_follow_the_lockstep", lockstep),
        trial("stats::the_rebuilt_tree_is_always_fresh", rebuilt),
    ]
}

const TOP: [&str; 9] = [
    "schema",
    "version",
    "command_line",
    "scene",
    "backend",
    "adapter",
    "driver",
    "threads",
    "summary",
];

const FRAME: [&str; 21] = [
    "frame",
    "time",
    "interpolate_ms",
    "preprocess_ms",
    "refit_ms",
    "trace_primary_ms",
    "trace_shadow_ms",
    "device_ms",
    "wall_ms",
    "tree_generation",
    "tree_age_frames",
    "adopted",
    "build_ms",
    "convert_ms",
    "upload_bytes",
    "readback_bytes",
    "sah_ratio",
    "hits",
    "blocked",
    "inactive",
    "degenerate",
];

const TIMES: [&str; 9] = [
    "interpolate_ms",
    "preprocess_ms",
    "refit_ms",
    "trace_primary_ms",
    "trace_shadow_ms",
    "device_ms",
    "wall_ms",
    "build_ms",
    "convert_ms",
];

fn stats(sandbox: &Sandbox, options: &str) -> Result<Value, Failed> {
    let words =
        "render demo:collide:2000 --backend cpu --size 24x16 --no-images --quiet --stats s.json";
    sandbox.run(&format!("{words} {options}")).succeeds()?;
    Ok(serde_json::from_slice(&sandbox.read("s.json"))?)
}

/// One number of each frame.
fn column(stats: &Value, name: &str) -> Vec<Option<f64>> {
    let frames = stats["frames"].as_array().map_or(&[][..], Vec::as_slice);
    frames.iter().map(|f| f[name].as_f64()).collect()
}

fn every_field(sandbox: &Sandbox) -> Result<(), Failed> {
    let stats = stats(sandbox, "--frames 4 --update async --lockstep 1")?;
    let lacks = |value: &Value, names: &[&str]| -> Vec<String> {
        let absent = |n: &&&str| value.get(**n).is_none();
        names
            .iter()
            .filter(absent)
            .map(ToString::to_string)
            .collect()
    };
    let mut missing = lacks(&stats, &TOP);
    missing.extend(lacks(&stats["summary"], &TIMES));
    for i in 0..4 {
        missing.extend(lacks(&stats["frames"][i], &FRAME));
    }
    for time in TIMES {
        missing.extend(lacks(&stats["summary"][time], &["median", "p95", "worst"]));
    }
    ensure(missing.is_empty(), || format!("missing: {missing:?}"))?;
    ensure(stats["schema"] == 1 && stats["backend"] == "cpu", || {
        stats.to_string()
    })
}

/// Each tree is adopted exactly two frames after it was asked for.
fn lockstep(sandbox: &Sandbox) -> Result<(), Failed> {
    let stats = stats(sandbox, "--frames 8 --update async --lockstep 2")?;
    let ages = column(&stats, "tree_age_frames");
    let generations = column(&stats, "tree_generation");
    let expect = |xs: [f64; 8]| xs.map(Some).to_vec();
    ensure(
        ages == expect([0.0, 1.0, 2.0, 2.0, 3.0, 2.0, 3.0, 2.0]),
        || format!("{ages:?}"),
    )?;
    ensure(
        generations == expect([1.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0]),
        || format!("{generations:?}"),
    )
}

fn rebuilt(sandbox: &Sandbox) -> Result<(), Failed> {
    for policy in ["rebuild", "async --lockstep 0"] {
        let stats = stats(sandbox, &format!("--frames 5 --update {policy}"))?;
        let (ages, ratios) = (
            column(&stats, "tree_age_frames"),
            column(&stats, "sah_ratio"),
        );
        ensure(ages == [Some(0.0); 5], || format!("{policy}: {ages:?}"))?;
        ensure(ratios == [Some(1.0); 5], || format!("{policy}: {ratios:?}"))?;
    }
    Ok(())
}
