//! `chart`: four files that show the same points, and counts of wrong answers. `bench --csv`: a table over sizes.

use crate::devices::backend_trial;
use crate::sandbox::{Run, SQUARE, Sandbox, assert_contains, list, trial};
use libtest_mimic::Trial;
use serde_json::Value;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("chart::files_list_every_method_once", files),
        trial("chart::only_exact_has_no_errors", only_exact_has_no_errors),
        trial("chart::failed_method_reports_its_reason", failed),
        trial("chart::scenes_have_different_titles", titles),
        trial("chart::results_are_reproducible", repeated),
        trial("bench::each_scene_size_has_rows", sizes),
        // Backend `wgpu` uses the same kernels, which a software driver would compile again.
        backend_trial("chart::robust_hits_match_the_host", "vulkan", robust),
    ]
}

const SMALL: &str = "chart demo:collide:300 --backend cpu --frames 2 --size 64x40 --out c";

fn draw(sandbox: &Sandbox, rays: usize, more: &str) -> (Run, Vec<Value>) {
    let run = sandbox.run_ok(&format!("{SMALL} --rays {rays} {more}"));
    let json = sandbox.json("c/points.json");
    assert!(json["schema"] == 1, "{json}");
    (run, list(&json["points"]).to_vec())
}

fn files(sandbox: &Sandbox) {
    // A link in the folder is replaced, and its target is kept.
    #[cfg(unix)]
    {
        sandbox.write("c/mine", b"mine");
        std::os::unix::fs::symlink("mine", sandbox.path().join("c/points.csv")).unwrap();
    }
    let (run, points) = draw(sandbox, 2000, "");
    #[cfg(unix)]
    {
        assert!(sandbox.read("c/mine") == b"mine", "a link was followed");
        sandbox.remove("c/mine");
    }
    let names = sandbox.files();
    let expected = ["chart.html", "chart.svg", "points.csv", "points.json"];
    let expected = expected.map(|name| std::path::Path::new("c").join(name));
    assert!(names == expected, "{names:?}");
    assert!(points.len() == 12, "{} points", points.len());
    for p in &points {
        let known = ["/ms_per_frame/median", "/mrays_per_s", "/memory_bytes"];
        let is_known = |k: &&str| p.pointer(k).is_some_and(Value::is_number);
        assert!(known.iter().all(is_known), "{p}");
        let counts = [&p["rays_tested"], &p["samples"]].map(Value::as_u64);
        assert!(counts == [Some(2000), Some(1)], "{p}");
        assert!(p["aimed"]["rays"] == 500, "{p}");
        let name = p["intersector"].as_str().unwrap();
        assert!(run.stdout.contains(name), "{}", run.stdout);
    }
    let csv = sandbox.text("c/points.csv");
    assert!(csv.lines().count() == 13, "{csv}");
    let commas = |line: &str| line.matches(',').count();
    let first = csv.lines().next().map(commas);
    assert!(csv.lines().all(|l| Some(commas(l)) == first), "{csv}");
    assert_contains(&sandbox.text("c/chart.svg"), "extreme-keys|</svg>");
    assert_contains(&sandbox.text("c/chart.html"), "All points|</svg>");
}

fn only_exact_has_no_errors(sandbox: &Sandbox) {
    for p in draw(sandbox, 20_000, "--quiet --update refit,async").1 {
        let sum = |name: &str, what: &str| -> u64 {
            list(&p[name]).iter().filter_map(|l| l[what].as_u64()).sum()
        };
        let mixed = sum("mixed_range", "wrong");
        assert!(sum("mixed_range", "rays") == 3 * 2048, "{p}");
        let wrong = [&p["wrong"], &p["aimed"]["wrong"], &p["wrong_shadow"]];
        let wrong = wrong.map(|n| n.as_u64().unwrap_or(u64::MAX));
        let fits = match p["intersector"].as_str() {
            Some("exact") => wrong == [0; 3] && mixed == 0,
            // It may return a neighbour at an edge.
            Some("watertight") => wrong[1] > 0 && wrong[0] <= 2,
            _ => wrong[1] > 0 && mixed > 0,
        };
        assert!(fits, "{p}");
    }
}

/// Checks that other methods keep their points when some fail.
fn failed(sandbox: &Sandbox) {
    sandbox.write("bad.obj", "f 1 2 3");
    let words = "chart bad.obj demo:collide:300 --backend cpu --update refit --intersector woop,exact --frames 2";
    let run = sandbox.run(&format!("{words} --size 16x10 --rays 100 --out c --quiet"));
    assert_contains(&run.stdout, "bad.obj cpu woop refit failed: ");
    run.fails(1, &["2 of 4 points could not be measured"]);
    let json = sandbox.json("c/points.json");
    assert_eq!(list(&json["points"]).len(), 2);
    let failures = list(&json["failures"]);
    let told = |f: &Value| f["scene"] == "bad.obj" && f["error"].is_string();
    assert!(failures.len() == 2 && failures.iter().all(told), "{json}");
    let csv = sandbox.text("c/points.csv");
    assert!(csv.lines().count() == 5, "{csv}");
    assert_contains(&sandbox.text("c/chart.html"), "<li>bad.obj cpu exact refit");
}

fn titles(sandbox: &Sandbox) {
    for folder in ["old/walk", "walk"] {
        for key in 1..=2 {
            let mesh = SQUARE.replace("v 1 1 0", &format!("v 1 1 {key}"));
            sandbox.write(&format!("{folder}/{key}.obj"), mesh);
        }
    }
    let words = "--backend cpu --update refit --intersector exact --frames 2 --size 16x10";
    sandbox.run_ok(&format!(
        "chart old/walk walk {words} --rays 100 --out c --quiet"
    ));
    let json = sandbox.json("c/points.json");
    let titles: Vec<_> = list(&json["points"]).iter().map(|p| &p["scene"]).collect();
    assert_eq!(titles, ["walk", "walk (2)"]);
}

/// Checks that robust intersectors have the host's counts.
fn robust(sandbox: &Sandbox, backend: &str) {
    let words = "--quiet --update refit,async --intersector watertight,exact";
    let what = "chart demo:collide:300 --frames 2 --size 64x40 --out c --rays 4000";
    sandbox.run_ok(&format!("{what} --backend {backend},cpu {words}"));
    let json = sandbox.json("c/points.json");
    let points = list(&json["points"]);
    assert_eq!(points.len(), 8);
    let names = "rays_tested wrong wrong_shadow aimed mixed_range";
    let counts = |p: &Value| -> Vec<Value> { names.split(' ').map(|n| p[n].clone()).collect() };
    let (ours, hosts) = points.split_at(4);
    for (ours, host) in ours.iter().zip(hosts) {
        assert!(
            ours["backend"] == backend && host["backend"] == "cpu",
            "{ours}"
        );
        assert_eq!(counts(ours), counts(host), "{ours}");
    }
}

/// Checks that a second run has the same counts. A repeated option changes nothing.
fn repeated(sandbox: &Sandbox) {
    let [first, again] = ["woop", "woop,woop"].map(|intersectors| {
        let words = format!("--quiet --update async --intersector {intersectors}");
        let points = draw(sandbox, 9000, &words).1;
        let names = "rays_tested wrong wrong_shadow aimed mixed_range";
        let counts = |p: &Value| names.split(' ').map(|n| p[n].clone()).collect();
        points.iter().map(counts).collect::<Vec<Vec<Value>>>()
    });
    assert_eq!(first.len(), 1);
    assert_eq!(first, again);
}

fn sizes(sandbox: &Sandbox) {
    let words = "bench demo:twist:300 demo:twist:1000 --backend cpu --update async,refit --frames 5 \
                 --size 16x12 --builder-threads 1 --csv b.csv --quiet";
    sandbox.run_ok(words);
    let csv = sandbox.text("b.csv");
    let rows: Vec<Vec<&str>> = csv.lines().map(|l| l.split(',').collect()).collect();
    // Two sizes, two policies, and the heading.
    assert!(rows.len() == 5, "{csv}");
    let column = |name| rows[0].iter().position(|c| *c == name).unwrap();
    let (wall, builders) = (column("wall_ms"), column("builder_threads"));
    for row in &rows[1..] {
        let is_known = row[wall].parse::<f64>().is_ok_and(|ms| ms > 0.0);
        assert!(is_known && row[builders] == "1", "{row:?}");
    }
}
