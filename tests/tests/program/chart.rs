//! `chart`: four files that say the same, and what is known of right and wrong.

use crate::sandbox::{Run, Sandbox, ensure, trial};
use libtest_mimic::{Failed, Trial};
use serde_json::Value;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("chart::four_files_hold_every_way_once", files),
        trial("chart::exact_is_right_and_the_others_are_not", judged),
        trial("chart::a_command_measures_its_point_again", command),
        trial(
            "chart::a_method_asked_for_twice_is_drawn_once_in_each_layout",
            layouts,
        ),
        trial("chart::what_cannot_be_is_refused", refused),
    ]
}

const SMALL: &str = "chart demo:collide:300 --backend cpu --frames 2 --size 64x40 --out c";

fn draw(sandbox: &Sandbox, rays: usize, more: &str) -> Result<Run, Failed> {
    sandbox
        .run(&format!("{SMALL} --rays {rays} {more}"))
        .succeeds()
}

fn points(sandbox: &Sandbox) -> Result<Vec<Value>, Failed> {
    let json: Value = serde_json::from_slice(&sandbox.read("c/points.json"))?;
    ensure(json["schema"] == 1, || json.to_string())?;
    Ok(json["points"].as_array().ok_or("no points")?.clone())
}

fn files(sandbox: &Sandbox) -> Result<(), Failed> {
    // A link in the folder is replaced: what it leads to stays.
    #[cfg(unix)]
    {
        std::fs::create_dir(sandbox.path().join("c"))?;
        std::fs::write(sandbox.path().join("mine"), b"mine")?;
        std::os::unix::fs::symlink("../mine", sandbox.path().join("c/points.csv"))?;
    }
    let run = draw(sandbox, 2000, "")?;
    #[cfg(unix)]
    {
        ensure(sandbox.read("mine") == b"mine", || {
            "a link was followed".to_owned()
        })?;
        std::fs::remove_file(sandbox.path().join("mine"))?;
    }
    let names: Vec<_> = sandbox
        .files()
        .iter()
        .map(|f| f.to_string_lossy().into_owned())
        .collect();
    let expected = [
        "c/chart.html",
        "c/chart.svg",
        "c/points.csv",
        "c/points.json",
    ];
    ensure(names == expected, || format!("{names:?}"))?;
    let points = points(sandbox)?;
    ensure(points.len() == 24, || format!("{} points", points.len()))?;
    for p in &points {
        let known = ["/ms_per_frame/median", "/mrays_per_s", "/memory_bytes"];
        let lacks = known
            .iter()
            .find(|k| p.pointer(k).is_none_or(Value::is_null));
        ensure(lacks.is_none(), || format!("no {lacks:?} in {p}"))?;
        let counts = [&p["rays_tested"], &p["aimed"]["rays"], &p["samples"]];
        let counts = counts.map(Value::as_u64);
        ensure(counts == [Some(2000), Some(500), Some(1)], || p.to_string())?;
        let name = p["intersector"].as_str().ok_or("no name")?;
        ensure(run.stdout.contains(name), || run.stdout.clone())?;
    }
    let csv = String::from_utf8(sandbox.read("c/points.csv"))?;
    ensure(csv.lines().count() == 25, || csv.clone())?;
    let commas = |line: &str| line.matches(',').count();
    let first = csv.lines().next().map(commas);
    ensure(csv.lines().all(|l| Some(commas(l)) == first), || {
        csv.clone()
    })?;
    for (name, words) in [("c/chart.svg", "none in"), ("c/chart.html", "abvh bench")] {
        let text = String::from_utf8(sandbox.read(name))?;
        ensure(text.contains(words), || format!("no {words} in {name}"))?;
        ensure(text.contains("</svg>"), || format!("{name} is cut short"))?;
    }
    Ok(())
}

fn judged(sandbox: &Sandbox) -> Result<(), Failed> {
    draw(sandbox, 20_000, "--quiet --update refit,async")?;
    for p in points(sandbox)? {
        let leaks = p["leaks"].as_array().ok_or("no leaks")?;
        let sum = |what: &str| leaks.iter().filter_map(|l| l[what].as_u64()).sum::<u64>();
        let (lost, doubled) = (sum("leaks"), sum("double_hits"));
        ensure(sum("rays") > 0, || p.to_string())?;
        let wrong = [&p["wrong"], &p["aimed"]["wrong"], &p["wrong_shadow"]];
        let wrong = wrong.map(|n| n.as_u64().unwrap_or(u64::MAX));
        let fits = match p["intersector"].as_str() {
            Some("exact") => wrong == [0; 3] && lost + sum("counted") == 0,
            // It may name a neighbour of an edge, but never loses a ray.
            Some("watertight") => {
                wrong[1] > 0 && sum("counted") > 0 && lost + doubled == 0 && wrong[0] <= 2
            }
            _ => wrong[1] > 0 && lost > 0 && doubled > 0,
        };
        ensure(fits, || p.to_string())?;
        let t = &p["t_error_ulp"];
        let ulps = ["median", "p999", "worst"].map(|k| t[k].as_f64().unwrap_or(-1.0));
        let sorted = 0.0 <= ulps[0] && ulps[0] < ulps[1] && ulps[1] <= ulps[2];
        ensure(sorted, || format!("{ulps:?}"))?;
    }
    Ok(())
}

fn command(sandbox: &Sandbox) -> Result<(), Failed> {
    draw(sandbox, 100, "--quiet --update async --intersector woop")?;
    let points = points(sandbox)?;
    let said = points[0]["command"].as_str().ok_or("no command")?;
    let words = said.strip_prefix("abvh ").ok_or("no program")?;
    let run = sandbox
        .run(&format!("{words} --quiet --json b.json"))
        .succeeds()?;
    let json: Value = serde_json::from_slice(&sandbox.read("b.json"))?;
    let row = &json["rows"][0];
    for name in ["backend", "layout", "intersector", "update", "scene"] {
        ensure(row[name] == points[0][name], || format!("{name}: {row}"))?;
    }
    let same = json["size"] == serde_json::json!([64, 40]) && row["frames"] == 2;
    ensure(same, || run.stdout.clone())
}

fn layouts(sandbox: &Sandbox) -> Result<(), Failed> {
    draw(sandbox, 100, "--update refit --intersector woop,woop")?;
    let points = points(sandbox)?;
    let layouts: Vec<_> = points.iter().map(|p| &p["layout"]).collect();
    ensure(layouts == ["bvh2", "fast"], || format!("{layouts:?}"))
}

fn refused(sandbox: &Sandbox) -> Result<(), Failed> {
    sandbox.write("file", "");
    let cases: [(&str, &[&str]); 6] = [
        ("no/such/scene", &["no/such/scene"]),
        ("--rays 0", &["--rays"]),
        ("--intersector perfect", &["perfect"]),
        ("--frames 0", &["--frames"]),
        ("--out file/below", &["file"]),
        (
            "--backend vulkan-rt --intersector woop",
            &["vulkan-rt", "nothing to chart"],
        ),
    ];
    for (words, says) in cases {
        sandbox
            .run(&format!("chart --quiet {words}"))
            .fails(2, says)?;
    }
    let files = sandbox.files();
    ensure(files.len() == 1, || format!("{files:?}"))?;
    let folder = sandbox.path().join("abvh-chart");
    ensure(!folder.exists(), || "an empty folder is left".into())
}
