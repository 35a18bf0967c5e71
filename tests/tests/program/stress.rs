//! `stress`: streamed steps of every backend have the same hits as the host.

use crate::devices::{BACKENDS, HOST, backend_trial};
use crate::sandbox::{Sandbox, list};
use integration::is_full;
use libtest_mimic::Trial;

pub(crate) fn trials() -> Vec<Trial> {
    let equal = |b| backend_trial("stress::streamed_steps_match_host_hits", b, streamed);
    [HOST].into_iter().chain(BACKENDS).map(equal).collect()
}

fn streamed(sandbox: &Sandbox, backend: &str) {
    // The tests in `facade` compare the other policies on GPUs.
    let updates = if backend == HOST || is_full() {
        "async,refit,rebuild"
    } else {
        "async"
    };
    let what = format!("stress demo:collide:600 --backend {backend} --update {updates}");
    let how = "--steps 20 --poses 12 --size 24x16 --rays random --quiet";
    let json = sandbox.run_json(&format!("{what} {how}"), "--json").1;
    let rows = list(&json["rows"]);
    let policies = updates.split(',').count();
    assert_eq!(rows.len(), 2 * policies, "two sources: {json:#}");
    for row in rows {
        let checked = row["checked"].as_u64().expect("a count");
        assert_eq!(
            (row["wrong"].as_u64(), checked % (24 * 16)),
            (Some(0), 0),
            "{row:#}"
        );
        assert!(checked >= 4 * 24 * 16, "{row:#}");
        let times = ["median_ms", "p99_ms", "worst_ms"].map(|name| row[name].as_f64());
        assert!(times.iter().all(|ms| ms > &Some(0.0)), "{row:#}");
    }
}
