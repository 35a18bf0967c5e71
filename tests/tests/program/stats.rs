//! The statistics file: schema 1.

use crate::sandbox::{Sandbox, list, trial};
use libtest_mimic::Trial;
use serde_json::Value;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("stats::every_promised_field_is_there", every_field),
        trial("stats::generations_and_ages_follow_the_lockstep", lockstep),
        trial("stats::rebuilt_trees_are_fresh_and_only_they_wait", waits),
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

/// Each tree is adopted exactly two frames after it was asked for.
fn lockstep(sandbox: &Sandbox) {
    let stats = stats(sandbox, "--frames 8 --update async --lockstep 2");
    let ages = column(&stats, "tree_age_frames");
    let generations = column(&stats, "tree_generation");
    let expect = |xs: [f64; 8]| xs.map(Some).to_vec();
    assert_eq!(ages, expect([0.0, 1.0, 2.0, 2.0, 3.0, 2.0, 3.0, 2.0]));
    assert_eq!(
        generations,
        expect([1.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0])
    );
}

/// Trees rebuilt for each frame are of that frame, and only frames with such trees wait for builds.
fn waits(sandbox: &Sandbox) {
    for policy in ["rebuild", "async --lockstep 0", "refit", "t-sah", "async"] {
        let stats = stats(sandbox, &format!("--frames 8 --update {policy}"));
        let is_rebuilt = policy == "rebuild";
        if is_rebuilt || policy.ends_with('0') {
            let fresh = [("tree_age_frames", 0.0), ("sah_ratio", 1.0)];
            let is_fresh = |(name, x)| column(&stats, name) == [Some(x); 8];
            assert!(fresh.into_iter().all(is_fresh), "{policy}: {stats}");
        }
        let waited = column(&stats, "build_wait_ms");
        let as_promised = |ms: &Option<f64>| (*ms > Some(0.0)) == is_rebuilt && ms.is_some();
        let is_free = policy.ends_with('0') || waited[1..].iter().all(as_promised);
        assert!(waited[0] > Some(0.0) && is_free, "{policy}: {waited:?}");
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
