//! The statistics file (schema 1).

use crate::sandbox::{SQUARE, Sandbox, list, trial};
use libtest_mimic::Trial;
use serde_json::Value;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("stats::documented_fields_are_present", every_field),
        trial("stats::counts_unhittable_triangles", unhittable),
        trial("stats::memory_does_not_grow", memory),
        trial("stats::predicted_trees_read_no_vertices_back", read_back),
    ]
}

const TOP: &str = "schema version command_line scene backend adapter driver threads summary";

pub(crate) const FRAME: &str = "frame time interpolate_ms preprocess_ms rebuild_ms refit_ms trace_primary_ms \
    trace_shadow_ms device_ms wall_ms build_wait_ms tree_generation tree_age_frames adopted rejected build_ms \
    convert_ms upload_bytes readback_bytes sah_ratio sah_cost hits blocked inactive degenerate exact_rays host_bytes \
    device_bytes";

/// Times that every run on backend `cpu` measures. Only trees built on a device have `rebuild_ms`, and only shadows
/// that are a separate stage have `trace_shadow_ms`.
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
    sandbox.run_json(&format!("{words} {options}"), "--stats").1
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
        let frame = &sandbox.run_json(&words, "--stats").1["frames"][0];
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

/// Checks that vertices are read back for at most one tree with `--predict on`, and for almost every tree with
/// `--predict off`.
fn read_back(sandbox: &Sandbox) {
    for (predict, needs_vertices) in [("on", false), ("off", true)] {
        let options = format!("--frames 12 --update async --lockstep 2 --predict {predict}");
        let stats = stats(sandbox, &options);
        let is_read = |bytes: &Option<f64>| bytes.is_some_and(|bytes| bytes > 0.0);
        let read = column(&stats, "readback_bytes")
            .iter()
            .filter(|b| is_read(b))
            .count();
        let frames = list(&stats["frames"]).iter();
        let adopted = frames.filter(|f| f["adopted"] == true).count();
        assert!(
            adopted > 4 && (read >= adopted - 1) == needs_vertices && (read <= 1) != needs_vertices,
            "{predict}: {read} of {adopted}"
        );
    }
}
