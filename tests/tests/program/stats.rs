//! The statistics file (schema 1), and the timeline, which must be a valid trace and agree with the statistics.

use crate::sandbox::{SQUARE, Sandbox, list, trial};
use libtest_mimic::Trial;
use serde_json::{Value, json};

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("stats::documented_fields_are_present", every_field),
        trial("stats::counts_unhittable_triangles", unhittable),
        trial("stats::memory_does_not_grow", memory),
        trial("timeline::timeline_agrees_with_statistics", |sandbox| {
            agrees(sandbox, "on", 1);
            agrees(sandbox, "off", usize::MAX);
        }),
    ]
}

const TOP: &str = "schema version command_line scene backend adapter driver threads summary";

pub(crate) const FRAME: &str = "frame time interpolate_ms preprocess_ms rebuild_ms refit_ms trace_primary_ms \
    trace_shadow_ms device_ms wall_ms build_wait_ms tree_generation tree_age_frames adopted rejected build_ms \
    convert_ms upload_bytes readback_bytes sah_ratio sah_cost hits blocked inactive degenerate settled host_bytes \
    device_bytes";

/// Times that every run measures. Only trees made on a device have `rebuild_ms`, and only shadows that are a separate
/// stage have `trace_shadow_ms`.
const TIMES: &str = "interpolate_ms preprocess_ms refit_ms trace_primary_ms device_ms wall_ms build_wait_ms build_ms \
    convert_ms";

/// Asserts that every one of these names exists, even if null.
pub(crate) fn has_all(json: &Value, names: &str) {
    for name in names.split(' ') {
        assert!(json.get(name).is_some(), "no {name} in {json}");
    }
}

fn stats(sandbox: &Sandbox, options: &str) -> Value {
    let words = "render demo:collide:2000 --backend cpu --size 24x16 --no-images --quiet";
    sandbox.tells(&format!("{words} {options}"), "--stats").1
}

/// Returns one number per frame.
fn column(stats: &Value, name: &str) -> Vec<Option<f64>> {
    let frames = list(&stats["frames"]).iter();
    frames.map(|f| f[name].as_f64()).collect()
}

fn every_field(sandbox: &Sandbox) {
    let stats = stats(sandbox, "--frames 4 --update async --lockstep 1");
    has_all(&stats, TOP);
    has_all(&stats["summary"], TIMES);
    for frame in list(&stats["frames"]) {
        has_all(frame, FRAME);
    }
    for time in TIMES.split(' ') {
        has_all(&stats["summary"][time], "median p95 worst");
    }
    assert!(stats["schema"] == 1 && stats["backend"] == "cpu", "{stats}");
}

/// Checks that triangles with non-finite vertices are counted, and that the other triangles are hit.
fn unhittable(sandbox: &Sandbox) {
    let fourths = ["nan 1 0", "0 inf 0", "0 1 1e39", "0.5 0.5 0"];
    for (i, fourth) in fourths.into_iter().enumerate() {
        sandbox.write(&format!("{i}.obj"), SQUARE.replace("0 1 0", fourth));
    }
    sandbox.write("gone.obj", "v nan 0 0\nv nan 1 0\nv nan 1 1\nf 1 2 3\n");
    for (scene, inactive, degenerate, seen) in [
        ("0.obj+1.obj@2,0,0+2.obj@2,2,0", 3, 0, true),
        ("3.obj", 0, 1, true),
        ("gone.obj", 1, 0, false),
    ] {
        let words = format!("render {scene} --size 32x24 --quiet --out {inactive}{degenerate}");
        let frame = &sandbox.tells(&words, "--stats").1["frames"][0];
        let counted = frame["inactive"] == inactive && frame["degenerate"] == degenerate;
        let is_seen = frame["hits"].as_u64() > Some(0);
        assert!(counted && is_seen == seen, "{scene}: {frame}");
    }
}

/// Checks that later frames use no more memory than earlier ones.
#[cfg(target_os = "linux")]
fn memory(sandbox: &Sandbox) {
    let stats = stats(sandbox, "--frames 1200 --update async");
    let bytes = column(&stats, "host_bytes");
    let known: Vec<f64> = bytes.iter().copied().flatten().collect();
    assert!(known.len() == 1200, "frames without a count");
    let course = &stats["summary"]["host_bytes"];
    let peak = known.iter().copied().fold(0.0, f64::max);
    assert!(course["worst"].as_f64() == Some(peak), "{course}");
    let most = |frames: &[f64]| frames.iter().copied().fold(0.0, f64::max);
    let growth = most(&known[900..]) - most(&known[300..600]);
    // The rows themselves take 0.4 kB per frame.
    assert!(growth < 2e6, "{growth} bytes in 600 frames");
}

/// Checks that memory is null on other systems, where it is not measured.
#[cfg(not(target_os = "linux"))]
fn memory(sandbox: &Sandbox) {
    let stats = stats(sandbox, "--frames 3 --update async");
    assert!(stats["summary"]["host_bytes"].is_null(), "{stats}");
}

/// Rounding tolerance in microseconds: start and end are whole nanoseconds.
const ROUNDING: f64 = 2e-3;

/// Checks that the timeline agrees with the statistics, and that at most `read_back` builds read vertices back.
fn agrees(sandbox: &Sandbox, predict: &str, read_back: usize) {
    let words = "render demo:collide:2000 --frames 12 --size 24x16 --out out --overwrite --quiet";
    let files = "--stats s.json --timeline t.json --update async --lockstep 2";
    sandbox.does(&format!("{words} {files} --predict {predict}"));
    let (stats, timeline) = (sandbox.json("s.json"), sandbox.json("t.json"));
    let (frames, events) = (list(&stats["frames"]), list(&timeline["traceEvents"]));
    let trees = marks_agree(events, frames);
    let spans = |track: &str| -> Vec<&Value> {
        let is_name = |e: &&Value| e["name"] == "thread_name" && e["args"]["name"] == track;
        let tid = &events.iter().find(is_name).unwrap()["tid"];
        let is_span = |e: &&Value| e["ph"] == "X" && e["tid"] == *tid;
        events.iter().filter(is_span).collect()
    };
    for (track, name, wanted) in [
        ("start-up", "read the scene", 1),
        ("frame loop", "begin", 12),
        ("device", "trace primary", 12),
        ("read-back", "vertices", trees.min(read_back)),
        ("builder", "build", trees),
        ("upload", "tree", trees),
    ] {
        let mut spans = spans(track);
        spans.sort_by(|a, b| begin(a).total_cmp(&begin(b)));
        in_turn(&spans);
        let found = spans.iter().filter(|s| s["name"] == name).count();
        assert_eq!(found, wanted, "{track}");
        if track == "device" {
            frames.iter().for_each(|f| lasts(&spans, f));
        }
    }
}

/// Checks that trees are requested and adopted in the frames that the statistics name. Returns the number of trees.
fn marks_agree(events: &[Value], frames: &[Value]) -> usize {
    let args = |ph: &str, name: &str| -> Vec<&Value> {
        let named = events.iter().filter(|e| e["ph"] == ph && e["name"] == name);
        named.map(|e| &e["args"]).collect()
    };
    let ages = frames.iter().map(|f| f["tree_age_frames"].as_f64());
    let drawn = args("C", "tree age").into_iter();
    assert!(ages.eq(drawn.map(|args| args["value"].as_f64())));
    assert_eq!(args("C", "SAH ratio").len(), frames.len());
    let marks = args("i", "adopt");
    let adopted = frames.iter().filter(|f| f["adopted"] == true);
    for (mark, f) in marks.iter().zip(adopted.clone()) {
        let (frame, age) = (&f["frame"], &f["tree_age_frames"]);
        let generation = &f["tree_generation"];
        let told = json!({ "frame": frame, "generation": generation, "age_frames": age });
        assert_eq!(**mark, told);
        let asking = frame.as_u64().unwrap() - age.as_u64().unwrap();
        let asked = json!({ "frame": asking, "generation": generation });
        assert!(args("i", "ask").contains(&&asked), "{asked}");
        let way = events.iter();
        let way = way.filter(|e| e["args"]["generation"] == *generation);
        in_turn(&way.collect::<Vec<_>>());
    }
    assert!(marks.len() > 4 && marks.len() == adopted.count());
    marks.len()
}

/// Asserts that each span ends before the next one starts.
fn in_turn(spans: &[&Value]) {
    for pair in spans.windows(2) {
        let end = begin(pair[0]) + pair[0]["dur"].as_f64().unwrap_or(0.0);
        assert!(end <= begin(pair[1]) + ROUNDING, "{pair:?}");
    }
}

fn begin(event: &Value) -> f64 {
    event["ts"].as_f64().unwrap()
}

/// Checks that stages have the durations in the statistics.
fn lasts(device: &[&Value], frame: &Value) {
    for name in "interpolate|rebuild|preprocess|refit|trace primary|trace shadow".split('|') {
        let is_of = |s: &&&Value| s["name"] == name && s["args"]["frame"] == frame["frame"];
        let spans = device.iter().filter(is_of);
        let drawn: f64 = spans.map(|s| s["dur"].as_f64().unwrap()).sum();
        let said = &frame[format!("{}_ms", name.replace(' ', "_"))];
        let same = (drawn - said.as_f64().unwrap_or(0.0) * 1e3).abs() < 0.01;
        assert!(same, "{frame}: {name} {drawn}, not {said}");
    }
}
