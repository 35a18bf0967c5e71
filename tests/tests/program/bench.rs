//! `bench`: a table for people, and every frame of every run for programs.

use crate::sandbox::{Sandbox, ensure, trial};
use crate::stats::FRAME;
use libtest_mimic::{Failed, Trial};
use serde_json::Value;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("bench::the_file_holds_every_frame_and_the_machine", file),
        trial("bench::the_table_has_all_columns", table),
        trial("bench::an_absent_adapter_is_refused", adapter),
    ]
}

const SMALL: &str = "bench demo:twist:500 --backend cpu --size 16x12 --quiet";

fn file(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = "--frames 5 --time-range 1..1.5 --update refit,async --json b.json";
    sandbox.run(&format!("{SMALL} {words}")).succeeds()?;
    let json: Value = serde_json::from_slice(&sandbox.read("b.json"))?;
    ensure(
        json["command_line"][1] == "bench" && json["cores"].as_u64() > Some(0),
        || "no machine".into(),
    )?;
    let rows = json["rows"].as_array().ok_or("no rows")?;
    ensure(rows.len() == 2, || format!("{} rows", rows.len()))?;
    for row in rows {
        for name in [
            "backend",
            "adapter",
            "threads",
            "device_ms",
            "geometry_ms",
            "sah_ratio",
        ] {
            ensure(!row[name].is_null(), || format!("no {name}"))?;
        }
        ensure(row.get("driver").is_some(), || "no driver".into())?;
        let frames = row["per_frame"].as_array().ok_or("no frames")?;
        let times: Vec<_> = frames.iter().filter_map(|f| f["time"].as_f64()).collect();
        ensure(times == [1.0, 1.125, 1.25, 1.375, 1.5], || {
            format!("{times:?}")
        })?;
        let lacks = |f: &Value| FRAME.iter().any(|name| f.get(name).is_none());
        ensure(!frames.iter().any(lacks), || "a frame lacks a field".into())?;
        let mut device: Vec<_> = frames
            .iter()
            .filter_map(|f| f["device_ms"].as_f64())
            .collect();
        device.sort_by(f64::total_cmp);
        let median = row["device_ms"].as_f64().ok_or("no median")?;
        ensure((median - device[2]).abs() < 1e-5, || {
            format!("{median} of {device:?}")
        })?;
    }
    Ok(())
}

fn table(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = format!("{SMALL} --frames 3 --update async --intersector watertight,woop");
    let run = sandbox.run(&words).succeeds()?;
    for column in [
        "geometry", "device", "wall", "build", "age", "SAH", "woop", "cpu: ",
    ] {
        ensure(run.stdout.contains(column), || {
            format!("no {column} in\n{}", run.stdout)
        })?;
    }
    Ok(())
}

fn adapter(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = format!("{SMALL} --adapter nothing-like-it");
    sandbox.run(&words).fails(2, &["nothing-like-it"])
}
