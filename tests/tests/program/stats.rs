//! The statistics file: schema 1.

use crate::sandbox::{SQUARE, Sandbox, list, trial};
use libtest_mimic::Trial;
use serde_json::Value;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("stats::every_promised_field_is_there", every_field),
        trial("stats::what_cannot_be_hit_is_counted", unhittable),
        trial("stats::memory_is_counted_and_does_not_grow", memory),
    ]
}

const TOP: &str = "schema version command_line scene backend adapter driver threads summary";

pub(crate) const FRAME: &str = "frame time interpolate_ms preprocess_ms rebuild_ms refit_ms trace_primary_ms \
    trace_shadow_ms device_ms wall_ms build_wait_ms tree_generation tree_age_frames adopted rejected build_ms \
    convert_ms upload_bytes readback_bytes sah_ratio sah_cost hits blocked inactive degenerate settled host_bytes \
    device_bytes";

/// Those that every run measures: `rebuild_ms` is of trees made on a device alone, `trace_shadow_ms` of shadows that
/// are a stage of their own.
const TIMES: &str = "interpolate_ms preprocess_ms refit_ms trace_primary_ms device_ms wall_ms build_wait_ms build_ms \
    convert_ms";

/// Every one of these names is there, if only as null.
pub(crate) fn has_all(json: &Value, names: &str) {
    for name in names.split(' ') {
        assert!(json.get(name).is_some(), "no {name} in {json}");
    }
}

fn stats(sandbox: &Sandbox, options: &str) -> Value {
    let words =
        "render demo:collide:2000 --backend cpu --size 24x16 --no-images --quiet --stats s.json";
    sandbox.does(&format!("{words} {options}"));
    sandbox.json("s.json")
}

/// One number of each frame.
fn column(stats: &Value, name: &str) -> Vec<Option<f64>> {
    list(&stats["frames"])
        .iter()
        .map(|f| f[name].as_f64())
        .collect()
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

/// Triangles of vertices that are nowhere are counted, and the rest is seen.
fn unhittable(sandbox: &Sandbox) {
    for (i, fourth) in ["nan 1 0", "0 inf 0", "0 1 1e39", "0.5 0.5 0"]
        .into_iter()
        .enumerate()
    {
        sandbox.write(&format!("{i}.obj"), SQUARE.replace("0 1 0", fourth));
    }
    sandbox.write("gone.obj", "v nan 0 0\nv nan 1 0\nv nan 1 1\nf 1 2 3\n");
    for (scene, inactive, degenerate, seen) in [
        ("0.obj+1.obj@2,0,0+2.obj@2,2,0", 3, 0, true),
        ("3.obj", 0, 1, true),
        ("gone.obj", 1, 0, false),
    ] {
        let words = format!(
            "render {scene} --size 32x24 --stats s.json --quiet --out {inactive}{degenerate}"
        );
        sandbox.does(&words);
        let frame = &sandbox.json("s.json")["frames"][0];
        let counted = frame["inactive"] == inactive && frame["degenerate"] == degenerate;
        let is_seen = frame["hits"].as_u64() > Some(0);
        assert!(counted && is_seen == seen, "{scene}: {frame}");
    }
}

/// Frames after the first hundreds take no more memory than those before them.
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
    // The rows themselves take 0.4 kB a frame.
    assert!(growth < 2e6, "{growth} bytes in 600 frames");
}

/// Elsewhere nobody counts.
#[cfg(not(target_os = "linux"))]
fn memory(sandbox: &Sandbox) {
    let stats = stats(sandbox, "--frames 3 --update async");
    assert!(stats["summary"]["host_bytes"].is_null(), "{stats}");
}
