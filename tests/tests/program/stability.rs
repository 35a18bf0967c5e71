//! `stability`: rates by family and intersector, within their bounds, and what is said of them.

use crate::sandbox::{Sandbox, list, says, trial};
use libtest_mimic::Trial;
use serde_json::Value;

const FAMILIES: usize = 21;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("stability::the_host_errs_as_often_as_expected", expected),
        trial("stability::one_seed_says_one_thing", repeatable),
        // Half a minute of one core.
        trial("stability::a_baseline_can_be_measured_anew", recorded)
            .with_ignored_flag(!integration::is_full()),
    ]
}

fn expected(sandbox: &Sandbox) {
    let run = sandbox.does("stability --backend cpu --rays 2048 --json s.json");
    let json = sandbox.json("s.json");
    let rows = list(&json["rows"]);
    assert!(json["schema"] == 1 && json["seed"] == 1, "{json}");
    assert_eq!(rows.len(), 4 * FAMILIES);
    let mut closed = 0;
    for row in rows {
        let number = |what: &str| row[what].as_f64().unwrap();
        let (wrong, rays, rate) = (number("wrong"), number("rays"), number("rate"));
        assert!(rays > 0.0 && rate == wrong / rays, "{row}");
        let [low, high] = [0, 1].map(|end| row["bound"][end].as_f64().unwrap());
        assert!((low..=high).contains(&rate) && row["ok"] == true, "{row}");
        let exact = row["intersector"] == "exact";
        assert!(!exact || wrong == 0.0, "{row}");
        if (exact || row["intersector"] == "watertight") && !row["leaks"].is_null() {
            closed += 1;
            let none = |what: &str| row[what]["count"] == 0 && row[what]["bound"][1] == 0.0;
            // Closed triangles may share a hit: those of `exact` are not counted.
            let counted = row["double_hits"]["rays"] == 2048 && none("double_hits");
            assert!(none("leaks") && (counted || exact), "{row}");
        }
    }
    assert_eq!(closed, 12);
    says(&run.stdout, "needles|leaks, double hits");
    for mark in ["WORSE", "BETTER", "UNKNOWN"] {
        assert!(!run.stdout.contains(mark), "{}", run.stdout);
    }
    assert_eq!(run.stderr.lines().count(), FAMILIES, "{}", run.stderr);
}

fn repeatable(sandbox: &Sandbox) {
    let words = "stability --backend cpu --intersector woop --rays 600 --quiet --seed";
    let [first, again, other] = [4, 4, 5].map(|seed| sandbox.does(&format!("{words} {seed}")));
    assert_eq!(first.stdout, again.stdout);
    assert_ne!(first.stdout, other.stdout);
    assert_eq!(first.stderr, "");
}

fn recorded(sandbox: &Sandbox) {
    let run = sandbox.does("stability --backend cpu --record b.json --seeds 1 --quiet");
    let json = sandbox.json("b.json");
    assert_eq!(json["arithmetic"]["rounds_division"], true);
    let ground = json["ground"].as_str().unwrap();
    let told = ground.contains("8192 rays a family") && run.stdout.contains(ground);
    assert!(told, "{ground}: {}", run.stdout);
    let entries = list(&json["entries"]);
    let is_sound =
        |e: &Value| e["count"].as_u64() <= e["of"].as_u64() && e["spread"].as_f64() >= Some(1.0);
    assert!(entries.iter().all(is_sound), "{json}");
    let of = |name: &str| entries.iter().filter(|e| e["intersector"] == name).count();
    let counts = ["woop", "moller-trumbore", "watertight", "exact"].map(of);
    assert_eq!(counts, [33, 33, 21, 0]);
}
