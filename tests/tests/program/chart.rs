//! `chart`: four files that say the same, and what is known of right and wrong. `bench --csv`: a table over sizes.

use crate::sandbox::{Run, Sandbox, ensure, trial};
use libtest_mimic::{Failed, Trial};
use serde_json::Value;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("chart::four_files_hold_every_way_once", files),
        trial("chart::exact_is_right_and_the_others_are_not", judged),
        trial("chart::a_command_measures_its_point_again", command),
        trial("chart::what_cannot_be_is_refused", refused),
        trial("bench::sizes_have_their_rows", sizes),
    ]
}

const SMALL: &str = "chart demo:collide:300 --backend cpu --frames 2 --size 64x40 --out c";

fn draw(sandbox: &Sandbox, rays: usize, more: &str) -> Result<(Run, Vec<Value>), Failed> {
    let run = sandbox.run(&format!("{SMALL} --rays {rays} {more}"));
    let run = run.succeeds()?;
    let json: Value = serde_json::from_slice(&sandbox.read("c/points.json"))?;
    ensure(json["schema"] == 1, || json.to_string())?;
    let points = json["points"].as_array().ok_or("no points")?;
    Ok((run, points.clone()))
}

fn files(sandbox: &Sandbox) -> Result<(), Failed> {
    // A link in the folder is replaced: what it leads to stays.
    #[cfg(unix)]
    {
        sandbox.write("c/mine", b"mine");
        std::os::unix::fs::symlink("mine", sandbox.path().join("c/points.csv"))?;
    }
    let (run, points) = draw(sandbox, 2000, "")?;
    #[cfg(unix)]
    {
        ensure(sandbox.read("c/mine") == b"mine", || {
            "a link was followed".into()
        })?;
        std::fs::remove_file(sandbox.path().join("c/mine"))?;
    }
    let names = sandbox.files();
    let expected = ["chart.html", "chart.svg", "points.csv", "points.json"];
    let expected = expected.map(|name| std::path::Path::new("c").join(name));
    ensure(names == expected, || format!("{names:?}"))?;
    ensure(points.len() == 24, || format!("{} points", points.len()))?;
    for p in &points {
        let known = ["/ms_per_frame/median", "/mrays_per_s", "/memory_bytes"];
        let is_known = |k: &&str| p.pointer(k).is_some_and(Value::is_number);
        ensure(known.iter().all(is_known), || p.to_string())?;
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
    for (name, words) in [
        ("c/chart.svg", "extreme-keys"),
        ("c/chart.html", "abvh bench"),
    ] {
        let text = String::from_utf8(sandbox.read(name))?;
        ensure(text.contains(words), || format!("no {words} in {name}"))?;
        ensure(text.contains("</svg>"), || format!("{name} is cut short"))?;
    }
    Ok(())
}

fn judged(sandbox: &Sandbox) -> Result<(), Failed> {
    for p in draw(sandbox, 20_000, "--quiet --update refit,async")?.1 {
        let sum = |list: &str, what: &str| -> u64 {
            let all = p[list].as_array().map_or(&[][..], Vec::as_slice);
            all.iter().filter_map(|l| l[what].as_u64()).sum()
        };
        let (lost, doubled) = (sum("leaks", "leaks"), sum("leaks", "double_hits"));
        let (counted, mixed) = (sum("leaks", "counted"), sum("mixed_range", "wrong"));
        ensure(sum("leaks", "rays") > 0, || p.to_string())?;
        ensure(sum("mixed_range", "rays") == 3 * 2048, || p.to_string())?;
        let wrong = [&p["wrong"], &p["aimed"]["wrong"], &p["wrong_shadow"]];
        let wrong = wrong.map(|n| n.as_u64().unwrap_or(u64::MAX));
        let fits = match p["intersector"].as_str() {
            Some("exact") => wrong == [0; 3] && lost + counted + mixed == 0,
            // It may name a neighbour of an edge, but never loses a ray.
            Some("watertight") => {
                wrong[1] > 0 && counted > 0 && lost + doubled == 0 && wrong[0] <= 2
            }
            _ => wrong[1] > 0 && lost > 0 && doubled > 0 && mixed > 0,
        };
        ensure(fits, || p.to_string())?;
        let t = &p["t_error_ulp"];
        let ulps = ["median", "p999", "worst"].map(|k| t[k].as_f64().unwrap_or(-1.0));
        let sorted = 0.0 <= ulps[0] && ulps[0] < ulps[1] && ulps[1] <= ulps[2];
        ensure(sorted, || format!("{ulps:?}"))?;
    }
    Ok(())
}

/// A method named twice is drawn once in each layout, with what measures it again.
fn command(sandbox: &Sandbox) -> Result<(), Failed> {
    let points = draw(
        sandbox,
        100,
        "--quiet --update async --intersector woop,woop",
    )?
    .1;
    let layouts: Vec<_> = points.iter().map(|p| &p["layout"]).collect();
    ensure(layouts == ["bvh2", "fast"], || format!("{layouts:?}"))?;
    let command = points[0]["command"].as_str().ok_or("no command")?;
    let words = command.strip_prefix("abvh ").ok_or("no program")?;
    let run = sandbox.run(&format!("{words} --quiet --json b.json"));
    let run = run.succeeds()?;
    let json: Value = serde_json::from_slice(&sandbox.read("b.json"))?;
    let row = &json["rows"][0];
    for name in ["backend", "layout", "intersector", "update", "scene"] {
        ensure(row[name] == points[0][name], || format!("{name}: {row}"))?;
    }
    let same = json["size"] == serde_json::json!([64, 40]) && row["frames"] == 2;
    ensure(same, || run.stdout.clone())
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
        let run = sandbox.run(&format!("chart --quiet {words}"));
        run.fails(2, says)?;
    }
    let files = sandbox.files();
    ensure(files.len() == 1, || format!("{files:?}"))?;
    let folder = sandbox.path().join("abvh-chart");
    ensure(!folder.exists(), || "an empty folder is left".into())
}

fn sizes(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = "bench demo:twist:300 demo:twist:1000 --backend cpu --update async,refit --layout bvh2 --frames 5 \
                 --size 16x12 --builder-threads 1,2 --csv b.csv --quiet";
    sandbox.run(words).succeeds()?;
    let csv = String::from_utf8(sandbox.read("b.csv"))?;
    let rows: Vec<Vec<&str>> = csv.lines().map(|l| l.split(',').collect()).collect();
    // Two sizes, two policies, two numbers of threads, and the heading.
    ensure(rows.len() == 9, || csv.clone())?;
    let column = |name: &str| {
        rows[0]
            .iter()
            .position(|c| *c == name)
            .ok_or("a column is missing")
    };
    let (wall, builders) = (column("wall_ms")?, column("builder_threads")?);
    for row in &rows[1..] {
        let is_known = row[wall].parse::<f64>().is_ok_and(|ms| ms > 0.0);
        ensure(is_known && ["1", "2"].contains(&row[builders]), || {
            row.join(",")
        })?;
    }
    Ok(())
}
