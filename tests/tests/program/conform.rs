//! `conform`: laws by name, leaks by number, and what is said of them.

use crate::sandbox::{Sandbox, ensure, trial};
use libtest_mimic::{Failed, Trial};
use serde_json::Value;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("conform::the_host_keeps_every_law", keeps),
        trial("conform::nothing_leaks", leaks),
        trial("conform::one_case_can_be_asked_for", one_case),
        trial("conform::what_cannot_be_is_refused", refused),
    ]
}

fn json(sandbox: &Sandbox) -> Result<Value, Failed> {
    Ok(serde_json::from_slice(&sandbox.read("c.json"))?)
}

fn keeps(sandbox: &Sandbox) -> Result<(), Failed> {
    let run = sandbox
        .run("conform --backend cpu --seed 5 --cases 4 --json c.json")
        .succeeds()?;
    let json = json(sandbox)?;
    ensure(json["schema"] == 1 && json["seed"] == 5, || {
        json.to_string()
    })?;
    ensure(json["backends"][0]["backend"] == "cpu", || json.to_string())?;
    let rows = json["rows"].as_array().ok_or("no rows")?;
    ensure(rows.len() >= 19, || format!("{} rows", rows.len()))?;
    let held = |r: &Value| r["held"].as_u64() >= Some(4) && r["disagreement"].is_null();
    ensure(rows.iter().all(held), || json.to_string())?;
    ensure(run.stdout.contains("a wrong tree is refused"), || {
        run.stdout.clone()
    })?;
    ensure(!run.stdout.contains("DISAGREES"), || run.stdout.clone())?;
    let steps = run.stderr.lines().count();
    ensure(steps == rows.len(), || run.stderr.clone())
}

fn leaks(sandbox: &Sandbox) -> Result<(), Failed> {
    let words =
        "conform --backend cpu --cases 0 --leak-rays 3000 --offsets 0,1000 --quiet --json c.json";
    let run = sandbox.run(words).succeeds()?;
    ensure(run.stderr.is_empty(), || run.stderr.clone())?;
    let json = json(sandbox)?;
    let rows = json["leaks"].as_array().ok_or("no rows")?;
    let sum = |what: &str| rows.iter().filter_map(|r| r[what].as_u64()).sum::<u64>();
    ensure(sum("rays") == 3000 && sum("counted") == 3000, || {
        json.to_string()
    })?;
    ensure(sum("leaks") + sum("miscounts") == 0, || json.to_string())?;
    ensure(json["rows"].as_array().is_some_and(Vec::is_empty), || {
        json.to_string()
    })
}

fn one_case(sandbox: &Sandbox) -> Result<(), Failed> {
    for case in ["7", "sliver-far-away"] {
        let words = format!(
            "conform --backend cpu --law closest_hits_equal_the_reference --case {case} --json c.json"
        );
        sandbox.run(&words).succeeds()?;
        let json = json(sandbox)?;
        let rows = json["rows"].as_array().ok_or("no rows")?;
        ensure(rows.len() == 1 && rows[0]["held"] == 1, || json.to_string())?;
    }
    Ok(())
}

fn refused(sandbox: &Sandbox) -> Result<(), Failed> {
    let cases: [(&str, &[&str]); 6] = [
        ("--backend cpu --adapter nowhere", &["cpu", "nowhere"]),
        ("--backend opengl", &["opengl"]),
        ("--backend cpu --law gravity", &["gravity"]),
        ("--backend cpu --case first", &["first", "sliver-far-away"]),
        ("--backend cpu --offsets 1e9", &["1e9"]),
        ("--backend cpu --json no/such/file", &["no/such/file"]),
    ];
    for (words, says) in cases {
        sandbox
            .run(&format!("conform --quiet {words}"))
            .fails(2, says)?;
    }
    ensure(sandbox.files().is_empty(), || {
        format!("{:?}", sandbox.files())
    })
}
