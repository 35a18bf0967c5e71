//! `bench`: a table for people, and a file with every frame of every run for programs.

use crate::devices::{BACKENDS, HOST, backend_trial};
use crate::sandbox::{Sandbox, assert_contains, list, trial};
use crate::stats::{FRAME, has_all};
use libtest_mimic::Trial;
use serde_json::Value;

pub(crate) fn trials() -> Vec<Trial> {
    let warm = |b| backend_trial("bench::warm_up_does_not_affect_frames", b, warm_up);
    let memory = |b| backend_trial("bench::memory_is_listed_by_purpose", b, memory);
    let mut all = vec![
        trial("bench::file_describes_frames_and_machine", file),
        trial("bench::counts_moving_triangles_of_joined_inputs", moving),
        trial("bench::failed_run_reports_its_reason", failed),
        trial("bench::random_rays_have_separate_rows", random_rays),
        trial("bench::camera_options_select_the_view_as_in_render", camera),
        warm(HOST),
    ];
    all.extend(BACKENDS.into_iter().flat_map(|b| [warm(b), memory(b)]));
    all
}

/// Checks that frames are the same whether or not the device was warmed up.
fn warm_up(sandbox: &Sandbox, backend: &str) {
    let updates = match backend {
        "cpu" => "refit",
        _ => "refit,device-rebuild",
    };
    let rows = |seconds: &str| -> Vec<Value> {
        let what = format!("bench demo:collide:600 --backend {backend} --update {updates}");
        let how = format!("--frames 4 --size 16x12 --warm-up {seconds}");
        let json = sandbox
            .run_json(&format!("{what} {how} --quiet"), "--json")
            .1;
        list(&json["rows"]).to_vec()
    };
    let facts = |row: &Value| -> Vec<Vec<Value>> {
        let names = "time hits blocked tree_generation tree_age_frames adopted";
        let of = |f: &Value| names.split(' ').map(|n| f[n].clone()).collect();
        list(&row["per_frame"]).iter().map(of).collect()
    };
    let (cold, warm) = (rows("0"), rows("0.2"));
    for (cold, warm) in cold.iter().zip(&warm) {
        let same = facts(cold) == facts(warm) && facts(warm).len() == 4;
        assert!(same, "{cold:#} {warm:#}");
        assert!(cold.get("warm_up").is_none(), "unasked");
        let told = &warm["warm_up"];
        let (seconds, frames) = (told["seconds"].as_f64(), told["frames"].as_u64());
        let right = match backend {
            "cpu" => told.is_null(),
            _ => seconds >= Some(0.2) && frames >= Some(2) && told["steady"].is_boolean(),
        };
        assert!(right, "{told}");
    }
}

/// Checks that `bench` traces the camera rays that `render` traces with the same options.
fn camera(sandbox: &Sandbox) {
    let common = "demo:collide:600 --backend cpu --update refit --frames 2 --size 16x12 --quiet";
    let hits = |json: &Value, rows: &str| -> Vec<Value> {
        let hits = |frame: &Value| frame["hits"].clone();
        list(&json[rows]).iter().map(hits).collect()
    };
    let counts = |camera: &str| {
        let (_, bench) = sandbox.run_json(&format!("bench {common} {camera}"), "--json");
        let render = format!("render {common} {camera} --no-images");
        let (_, render) = sandbox.run_json(&render, "--stats");
        let ours = hits(&bench["rows"][0], "per_frame");
        assert_eq!(ours, hits(&render, "frames"), "{camera}");
        ours
    };
    let framed = counts("");
    let close = counts("--eye 0,3,9 --look-at 0,0,0 --fov 25 --light 1,9,1");
    let away = counts("--eye 0,900,0 --look-at 0,999,0 --up 1,0,0");
    assert!(framed != close, "{framed:?}");
    assert_eq!(away, [0, 0].map(Value::from));
}

/// Checks the memory per triangle: 80 to 160 bytes for the tree with the triangle records, wherever it is built, and
/// limits for the other purposes.
fn memory(sandbox: &Sandbox, backend: &str) {
    let words = "--update refit,device-rebuild --frames 3 --size 16x12 --quiet";
    let what = format!("bench demo:twist:20000 --backend {backend} {words}");
    let (_, json) = sandbox.run_json(&what, "--json");
    let part = |row: usize, name: &str| {
        let each = &json["rows"][row]["memory"]["bytes_per_triangle"];
        each[name].as_f64().unwrap_or(f64::NAN)
    };
    for (row, scratch) in [(0, 0.0..20.0), (1, 40.0..80.0)] {
        let known = [
            (80.0..160.0).contains(&part(row, "tree")),
            scratch.contains(&part(row, "scratch")),
            // Key frames and two position buffers. There are half as many vertices as triangles.
            (100.0..200.0).contains(&part(row, "scene")),
            (0.0..100.0).contains(&part(row, "frames")),
        ];
        assert!(known == [true; 4], "{}", json["rows"][row]["memory"]);
    }
}

/// Checks that a scene of two halls has twice the triangles, and twice the moving triangles, of one hall.
fn moving(sandbox: &Sandbox) {
    let words = "--backend cpu --update refit --frames 2 --size 8x8 --quiet";
    let two = "demo:hall:2000+demo:hall:2000@0,0,9.5*0.5";
    let (_, json) = sandbox.run_json(&format!("bench {two} {words}"), "--json");
    let row = &json["rows"][0];
    let one = scene::open("demo:hall:2000", &scene::SceneOptions::default()).unwrap();
    let [moving, all] = [one.animation.moving_count(), one.animation.triangle_count()];
    let twice = row["moving"] == 2 * moving && row["triangles"] == 2 * all;
    assert!(moving > 0 && moving * 10 < all && twice, "{row}");
}

const SMALL: &str = "bench demo:twist:500 --backend cpu --size 16x12 --quiet";

fn file(sandbox: &Sandbox) {
    let words = "--frames 0..5 --update refit,async";
    let (run, json) = sandbox.run_json(&format!("{SMALL} {words}"), "--json");
    let told = "geometry|wall|age|SAH|cpu: ";
    assert_contains(&run.stdout, told);
    let here = json["command_line"][1] == "bench" && json["cores"].as_u64() > Some(0);
    assert!(here, "no machine");
    let rows = list(&json["rows"]);
    assert_eq!(rows.len(), 2);
    for row in rows {
        for name in "backend adapter threads device_ms geometry_ms sah_ratio".split(' ') {
            assert!(!row[name].is_null(), "no {name}");
        }
        assert!(row.get("driver").is_some(), "no driver");
        let frames = list(&row["per_frame"]);
        let times: Vec<_> = frames.iter().filter_map(|f| f["time"].as_f64()).collect();
        assert!(times == [0.0, 1.0, 2.0, 3.0, 4.0], "{times:?}");
        frames.iter().for_each(|f| has_all(f, FRAME));
        let device = frames.iter().filter_map(|f| f["device_ms"].as_f64());
        let mut device: Vec<_> = device.collect();
        device.sort_by(f64::total_cmp);
        let median = row["device_ms"].as_f64().unwrap();
        assert!((median - device[2]).abs() < 1e-5, "{median} of {device:?}");
    }
}

fn random_rays(sandbox: &Sandbox) {
    let words = "--frames 17 --update refit,auto --rays camera,random";
    let (run, json) = sandbox.run_json(&format!("{SMALL} {words}"), "--json");
    assert!(
        run.stdout.contains("watertight, random rays"),
        "{}",
        run.stdout
    );
    let rows = list(&json["rows"]);
    let kinds: Vec<_> = rows.iter().map(|r| r["rays"].as_str()).collect();
    let random = Some("random");
    assert!(kinds == [None, None, random, random], "{kinds:?}");
    for row in &rows[2..] {
        let hits = row["per_frame"][3]["hits"].as_u64();
        let some = hits.is_some_and(|h| h > 0 && h < 16 * 12);
        assert!(some, "{hits:?} of 192 rays hit");
        let only = row["trace_shadow_ms"].is_null() && row["mrays_per_s"].is_number();
        assert!(only, "rays to the light were traced");
    }
}

/// Checks that other runs keep their rows when some fail. One scene is missing, and only the host has an adapter named
/// `host`. The files of an incomplete scene are not overwritten.
fn failed(sandbox: &Sandbox) {
    sandbox.write("bad.obj", "f 1 2 3");
    sandbox.write("in/bad.obj", "f 1 2 3");
    sandbox.write("lfs.obj", "version https://git-lfs.github.com/spec/v1\n");
    for (scene, output) in [
        ("bad.obj+gone.obj", "bad.obj"),
        ("bad.obj@1,2,3+gone.obj", "bad.obj"),
        ("in+gone.obj", "in/bad.obj"),
        ("bad.obj@1e+2,0,0+gone.obj", "bad.obj"),
        ("lfs.obj", "lfs.obj"),
    ] {
        let overwriting = format!("bench {scene} --backend cpu --json {output}");
        sandbox.assert_refused(&overwriting, &["would overwrite", "SCENE"]);
    }
    let words = "bench gone.obj demo:twist:500 --backend wgpu,cpu --adapter host --update refit \
                 --size 16x12 --frames 2 --quiet --json b.json --csv b.csv";
    let run = sandbox.run(words);
    assert_contains(
        &run.stdout,
        "cpu: |wgpu|gone.obj wgpu watertight refit failed: ",
    );
    run.fails(1, &["3 of 4 runs failed"]);
    let json = sandbox.json("b.json");
    let rows = list(&json["rows"]);
    let text = |row: &Value, key: &str| row[key].as_str().unwrap_or_default().to_owned();
    let names = |row: &Value| [text(row, "scene"), text(row, "backend")].join(" ");
    let named: Vec<_> = rows.iter().map(names).collect();
    let failed = ["gone.obj wgpu", "gone.obj cpu", "demo:twist:500 wgpu"];
    assert_eq!(named, [&["demo:twist:500 cpu"][..], &failed].concat());
    assert!(rows[0]["wall_ms"].is_number() && rows[0]["error"].is_null());
    assert!(text(&rows[1], "error").contains("gone.obj"), "{}", rows[1]);
    assert!(text(&rows[3], "error").contains("wgpu"), "{}", rows[3]);
    let csv = sandbox.text("b.csv");
    assert!(csv.lines().count() == 5 && csv.contains(",error"), "{csv}");
}
