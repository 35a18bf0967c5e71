//! `conform`: properties by name. `stability`: error rates within bounds, by intersector and by family. A family is
//! one way in which scenes and rays are hard.

use crate::sandbox::{Sandbox, assert_contains, list, trial};
use integration::{is_full, share};
use libtest_mimic::Trial;
use serde_json::Value;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("conform::host_satisfies_every_property", every_property),
        trial("stability::host_error_rates_match_baseline", expected),
        trial("stability::equal_seeds_give_equal_results", repeatable),
        // Takes half a minute of one core.
        trial("stability::baseline_can_be_recorded", recorded).with_ignored_flag(!is_full()),
    ]
}

fn every_property(sandbox: &Sandbox) {
    let cases = if is_full() { 4 } else { 2 };
    let words = format!("conform --backend cpu --seed 5 --cases {cases}");
    let (run, json) = sandbox.run_json(&words, "--json");
    assert!(json["schema"] == 1 && json["seed"] == 5, "{json}");
    assert_eq!(json["backends"][0]["backend"], "cpu");
    let rows = list(&json["rows"]);
    assert!(rows.len() >= 19, "{} rows", rows.len());
    let held = |r: &Value| r["held"].as_u64() >= Some(cases) && r["disagreement"].is_null();
    assert!(rows.iter().all(held), "{json}");
    assert_contains(&run.stdout, "trees of other scenes are refused");
    assert!(!run.stdout.contains("DISAGREES"), "{}", run.stdout);
    let lines = || run.stderr.lines();
    let held = lines().filter(|line| line.contains(": held in "));
    assert_eq!([lines().count(), held.count()], [rows.len(); 2]);
    let property = "--property hits_equal_the_reference --case 7";
    let (_, json) = sandbox.run_json(&format!("conform --backend cpu {property}"), "--json");
    let rows = list(&json["rows"]);
    assert!(rows.len() == 1 && rows[0]["held"] == 1, "{json}");
    assert_eq!(json["cases"], 1);
}

/// Number of families that `stability` measures.
const FAMILIES: usize = 21;

fn expected(sandbox: &Sandbox) {
    let rays = share(1024);
    let words = format!("stability --backend cpu --rays {rays}");
    let (run, json) = sandbox.run_json(&words, "--json");
    let rows = list(&json["rows"]);
    assert!(json["schema"] == 1 && json["seed"] == 1, "{json}");
    assert_eq!(rows.len(), 4 * FAMILIES);
    let mut closed = 0;
    for row in rows {
        let number = |what: &str| row[what].as_f64().unwrap();
        let (wrong, of, rate) = (number("wrong"), number("rays"), number("rate"));
        assert!(of > 0.0 && rate == wrong / of, "{row}");
        let [low, high] = [0, 1].map(|end| row["bound"][end].as_f64().unwrap());
        assert!((low..=high).contains(&rate) && row["ok"] == true, "{row}");
        let exact = row["intersector"] == "exact";
        assert!(!exact || wrong == 0.0, "{row}");
        if (exact || row["intersector"] == "watertight") && !row["leaks"].is_null() {
            closed += 1;
            let none = |what: &str| row[what]["count"] == 0 && row[what]["bound"][1] == 0.0;
            // `exact` may hit two triangles at a shared edge, so its double hits are not counted.
            let counted = row["double_hits"]["rays"] == rays && none("double_hits");
            assert!(none("leaks") && (counted || exact), "{row}");
        }
    }
    assert_eq!(closed, 12);
    assert_contains(&run.stdout, "needles|leaks, double hits");
    for mark in ["WORSE", "BETTER", "UNKNOWN"] {
        assert!(!run.stdout.contains(mark), "{}", run.stdout);
    }
    assert_eq!(run.stderr.lines().count(), FAMILIES, "{}", run.stderr);
}

fn repeatable(sandbox: &Sandbox) {
    let words = "stability --backend cpu --intersector woop --rays 200 --quiet --seed";
    let [first, again, other] = [4, 4, 5].map(|seed| sandbox.run_ok(&format!("{words} {seed}")));
    assert_eq!(first.stdout, again.stdout);
    assert_ne!(first.stdout, other.stdout);
    assert_eq!(first.stderr, "");
}

fn recorded(sandbox: &Sandbox) {
    let (run, json) = sandbox.run_json("stability --backend cpu --seeds 1 --quiet", "--record");
    assert_eq!(json["arithmetic"]["rounds_division"], true);
    // This text states where and from how many rays the rates were measured.
    let ground = json["ground"].as_str().unwrap();
    let told = ground.contains("8192 rays per family") && run.stdout.contains(ground);
    assert!(told, "{ground}: {}", run.stdout);
    let entries = list(&json["entries"]);
    let is_sound =
        |e: &Value| e["count"].as_u64() <= e["of"].as_u64() && e["spread"].as_f64() >= Some(1.0);
    assert!(entries.iter().all(is_sound), "{json}");
    let of = |name: &str| entries.iter().filter(|e| e["intersector"] == name).count();
    let counts = ["woop", "moller-trumbore", "watertight", "exact"].map(of);
    assert_eq!(counts, [33, 33, 21, 0]);
}
