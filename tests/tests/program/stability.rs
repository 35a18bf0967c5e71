//! `stability`: rates by family and intersector, within their bounds, and what is said of them.

use crate::sandbox::{Sandbox, ensure, trial};
use libtest_mimic::{Failed, Trial};
use serde_json::Value;

const FAMILIES: usize = 22;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("stability::the_host_errs_as_often_as_expected", expected),
        trial("stability::robust_intersectors_never_leak", robust),
        trial("stability::one_seed_says_one_thing", repeatable),
        trial(
            "stability::what_is_to_be_expected_can_be_measured_anew",
            recorded,
        ),
        trial("stability::what_cannot_be_is_refused", refused),
    ]
}

fn rows(sandbox: &Sandbox) -> Result<(Value, Vec<Value>), Failed> {
    let json = sandbox.json("s.json")?;
    let rows = json["rows"].as_array().ok_or("no rows")?.clone();
    Ok((json, rows))
}

fn expected(sandbox: &Sandbox) -> Result<(), Failed> {
    let run = sandbox
        .run("stability --backend cpu --json s.json")
        .succeeds()?;
    let (json, rows) = rows(sandbox)?;
    ensure(json["schema"] == 1 && json["seed"] == 1, || {
        json.to_string()
    })?;
    ensure(rows.len() == 4 * FAMILIES, || rows.len().to_string())?;
    for row in &rows {
        let number = |what: &str| row[what].as_f64().ok_or_else(|| row.to_string());
        let (wrong, rays, rate) = (number("wrong")?, number("rays")?, number("rate")?);
        ensure(rays > 0.0 && rate == wrong / rays, || row.to_string())?;
        let within =
            row["bound"][0].as_f64() <= Some(rate) && Some(rate) <= row["bound"][1].as_f64();
        ensure(within && row["ok"] == true, || row.to_string())?;
    }
    for word in [
        "needles",
        "leaks, double hits",
        "rearranged: a refitted tree costs",
    ] {
        ensure(run.stdout.contains(word), || run.stdout.clone())?;
    }
    for mark in ["WORSE", "BETTER", "UNKNOWN"] {
        ensure(!run.stdout.contains(mark), || run.stdout.clone())?;
    }
    ensure(run.stderr.lines().count() == FAMILIES, || {
        run.stderr.clone()
    })
}

fn robust(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = "stability --backend cpu --intersector watertight,exact --seed 9 --rays 3000 --quiet --json s.json";
    let run = sandbox.run(words).succeeds()?;
    ensure(run.stderr.is_empty(), || run.stderr.clone())?;
    let (_, rows) = rows(sandbox)?;
    ensure(rows.len() == 2 * FAMILIES, || rows.len().to_string())?;
    let closed: Vec<_> = rows.iter().filter(|r| !r["leaks"].is_null()).collect();
    ensure(closed.len() == 12, || closed.len().to_string())?;
    for row in closed {
        let none = |what: &str| row[what]["count"] == 0 && row[what]["bound"][1] == 0.0;
        ensure(none("leaks") && none("double_hits"), || row.to_string())?;
        ensure(row["double_hits"]["rays"] == 3000, || row.to_string())?;
    }
    let exact = rows.iter().filter(|r| r["intersector"] == "exact");
    let wrong: Vec<_> = exact.filter(|r| r["wrong"] != 0).collect();
    ensure(wrong.is_empty(), || format!("{wrong:?}"))?;
    let moved = rows.iter().filter(|r| r["family"] == "rearranged");
    for row in moved {
        ensure(row["tree_dependent"]["count"] == 0, || row.to_string())?;
        ensure(row["sah_ratio"].as_f64() > Some(1.0), || row.to_string())?;
    }
    Ok(())
}

fn repeatable(sandbox: &Sandbox) -> Result<(), Failed> {
    let of_seed = |seed: u32| -> Result<String, Failed> {
        let words =
            format!("stability --backend cpu --intersector woop --seed {seed} --rays 600 --quiet");
        Ok(sandbox.run(&words).succeeds()?.stdout)
    };
    let first = of_seed(4)?;
    ensure(first == of_seed(4)?, || first.clone())?;
    ensure(first != of_seed(5)?, || first.clone())
}

fn recorded(sandbox: &Sandbox) -> Result<(), Failed> {
    let run = sandbox
        .run("stability --backend cpu --record b.json --seeds 1 --quiet")
        .succeeds()?;
    let json = sandbox.json("b.json")?;
    ensure(json["arithmetic"]["rounds_division"] == true, || {
        json.to_string()
    })?;
    let ground = json["ground"].as_str().unwrap_or_default();
    ensure(
        ground.contains("8192 rays a family") && run.stdout.contains(ground),
        || run.stdout.clone(),
    )?;
    let entries = json["entries"].as_array().ok_or("no entries")?;
    let of = |name: &str| entries.iter().filter(|e| e["intersector"] == name).count();
    let counts = ["woop", "moller-trumbore", "watertight", "exact"].map(of);
    ensure(counts == [34, 34, 22, 0], || format!("{counts:?}"))
}

fn refused(sandbox: &Sandbox) -> Result<(), Failed> {
    let cases: [(&str, &[&str]); 3] = [
        ("--adapter nowhere", &["cpu", "nowhere"]),
        ("--json no/such/file", &["no/such/file"]),
        ("--record no/such/file", &["no/such/file"]),
    ];
    for (words, says) in cases {
        sandbox
            .run(&format!("stability --backend cpu --quiet {words}"))
            .fails(2, says)?;
    }
    ensure(sandbox.files().is_empty(), || {
        format!("{:?}", sandbox.files())
    })
}
