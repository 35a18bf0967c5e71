//! `conform`: laws by name, leaks by number, and what is said of them.

use crate::sandbox::{Sandbox, ensure, trial};
use libtest_mimic::{Failed, Trial};
use serde_json::Value;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("conform::the_host_keeps_every_law", keeps),
        trial("conform::nothing_leaks", leaks),
        trial("conform::exact_is_held_to_the_oracle", oracle),
        trial("conform::wrong_answers_of_watertight_are_counted", counted),
        trial("conform::one_case_can_be_asked_for", one_case),
        trial("conform::what_cannot_be_is_refused", refused),
    ]
}

fn keeps(sandbox: &Sandbox) -> Result<(), Failed> {
    let run = sandbox
        .run("conform --backend cpu --seed 5 --cases 4 --json c.json")
        .succeeds()?;
    let json = sandbox.json("c.json")?;
    ensure(json["schema"] == 1 && json["seed"] == 5, || {
        json.to_string()
    })?;
    ensure(json["backends"][0]["backend"] == "cpu", || json.to_string())?;
    let rows = rows_of(&json, "rows")?;
    ensure(rows.len() >= 19, || format!("{} rows", rows.len()))?;
    let held = |r: &Value| r["held"].as_u64() >= Some(4) && r["disagreement"].is_null();
    ensure(rows.iter().all(held), || json.to_string())?;
    ensure(run.stdout.contains("a wrong tree is refused"), || {
        run.stdout.clone()
    })?;
    ensure(!run.stdout.contains("DISAGREES"), || run.stdout.clone())?;
    let told = run.stderr.lines();
    let outcomes = told.clone().filter(|line| line.contains(": held in "));
    ensure([told.count(), outcomes.count()] == [rows.len(); 2], || {
        run.stderr.clone()
    })
}

fn leaks(sandbox: &Sandbox) -> Result<(), Failed> {
    let words =
        "conform --backend cpu --cases 0 --leak-rays 3000 --offsets 0,1000 --quiet --json c.json";
    let run = sandbox.run(words).succeeds()?;
    ensure(run.stderr.is_empty(), || run.stderr.clone())?;
    let json = sandbox.json("c.json")?;
    let rows = rows_of(&json, "leaks")?;
    let sums = ["rays", "counted", "leaks", "miscounts"].map(|what| sum(rows, what));
    ensure(sums == [3000, 3000, 0, 0], || json.to_string())?;
    ensure(rows_of(&json, "rows")?.is_empty(), || json.to_string())
}

fn rows_of<'a>(json: &'a Value, what: &str) -> Result<&'a Vec<Value>, Failed> {
    json[what].as_array().ok_or_else(|| "no rows".into())
}

fn sum(rows: &[Value], what: &str) -> u64 {
    rows.iter().filter_map(|r| r[what].as_u64()).sum()
}

fn oracle(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = "conform demo:collide:300 --backend cpu --cases 0 --oracle-rays 7500 --json c.json";
    let run = sandbox.run(words).succeeds()?;
    let json = sandbox.json("c.json")?;
    let rows = rows_of(&json, "oracle")?;
    ensure(rows.len() == 15, || json.to_string())?;
    let all_of = |r: &Value| r["rays"] == 500 && r["intersector"] == "exact";
    ensure(rows.iter().all(all_of), || json.to_string())?;
    let given = |r: &Value| r["mesh"] == "demo:collide:300" && r["hits"].as_u64() > Some(100);
    ensure(rows.iter().any(given), || json.to_string())?;
    let wrong = sum(rows, "wrong") + sum(rows, "wrong_any") + sum(rows, "wrong_t");
    ensure(wrong == 0, || run.stdout.clone())?;
    for seen in ["ties", "edges", "degenerate", "inactive", "settled"] {
        ensure(sum(rows, seen) > 10, || format!("{seen}: {json}"))?;
    }
    ensure(run.stdout.contains("exact wrong"), || run.stdout.clone())?;
    ensure(run.stderr.lines().count() == 1, || run.stderr.clone())
}

fn counted(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = "conform --backend cpu --cases 0 --oracle-rays 8000 --intersector watertight --quiet --json c.json";
    sandbox.run(words).succeeds()?;
    let all = sandbox.json("c.json")?;
    ensure(sum(rows_of(&all, "oracle")?, "wrong") > 100, || {
        all.to_string()
    })?;
    sandbox
        .run(&format!("{words} --oracle-batch 3"))
        .succeeds()?;
    let one = sandbox.json("c.json")?;
    let rows = rows_of(&one, "oracle")?;
    ensure(rows.len() == 1 && rows[0]["scenes"] == 1, || {
        one.to_string()
    })?;
    let same =
        |r: &Value| r["mesh"] == rows[0]["mesh"] && r["rays"].as_u64() > rows[0]["rays"].as_u64();
    ensure(rows_of(&all, "oracle")?.iter().any(same), || {
        all.to_string()
    })
}

fn one_case(sandbox: &Sandbox) -> Result<(), Failed> {
    for case in ["7", "sliver-far-away"] {
        let words = format!(
            "conform --backend cpu --law closest_hits_equal_the_reference --case {case} --json c.json"
        );
        sandbox.run(&words).succeeds()?;
        let json = sandbox.json("c.json")?;
        let rows = rows_of(&json, "rows")?;
        ensure(rows.len() == 1 && rows[0]["held"] == 1, || json.to_string())?;
    }
    Ok(())
}

fn refused(sandbox: &Sandbox) -> Result<(), Failed> {
    let cases: [(&str, &[&str]); 4] = [
        ("--adapter nowhere", &["cpu", "nowhere"]),
        ("--json no/such/file", &["no/such/file"]),
        ("--oracle-rays 9 no/such/scene", &["no/such/scene"]),
        ("--cases 0 --oracle-rays 9 --oracle-batch 999", &["999"]),
    ];
    for (words, says) in cases {
        sandbox
            .run(&format!("conform --backend cpu --quiet {words}"))
            .fails(2, says)?;
    }
    ensure(sandbox.files().is_empty(), || {
        format!("{:?}", sandbox.files())
    })
}
