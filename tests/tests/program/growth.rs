//! `growth`: a picture and tables over the number of triangles.

use crate::sandbox::{Sandbox, ensure, trial};
use libtest_mimic::{Failed, Trial};
use serde_json::Value;

pub(crate) fn trials() -> Vec<Trial> {
    vec![trial(
        "growth::every_size_has_its_points_and_the_rest_a_reason",
        files,
    )]
}

fn files(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = "growth --backend cpu --triangles 300..1K --update t-sah,async,device-rebuild --layout bvh2 --frames 5 \
                 --size 16x12 --longest-build 0 --out g --quiet";
    // A link in the folder is replaced: what it leads to stays.
    #[cfg(unix)]
    {
        std::fs::create_dir(sandbox.path().join("g"))?;
        std::fs::write(sandbox.path().join("mine"), b"mine")?;
        std::os::unix::fs::symlink(
            sandbox.path().join("mine"),
            sandbox.path().join("g/growth.csv"),
        )?;
    }
    let run = sandbox.run(words).succeeds()?;
    #[cfg(unix)]
    ensure(sandbox.read("mine") == b"mine", || {
        "a link was followed".to_owned()
    })?;
    for text in [
        "| triangles | scene, s | async bvh2 |",
        "Left out:",
        "growth.svg",
    ] {
        ensure(run.stdout.contains(text), || run.stdout.clone())?;
    }
    let json: Value = serde_json::from_slice(&sandbox.read("g/growth.json"))?;
    let points = json["points"].as_array().ok_or("no points")?;
    // 300, 500 and 1000 triangles; no tree may take so long as t-sah's, and none is made on this device.
    ensure(points.len() == 3, || format!("{points:?}"))?;
    for p in points {
        let known = p["frame_ms"].is_number() && p["build_ms"].is_number() && p["frames"] == 5;
        ensure(known && p["update"] == "async", || p.to_string())?;
    }
    let left_out = json["left_out"].as_array().ok_or("nothing left out")?;
    let about = |what: &str| {
        left_out
            .iter()
            .filter(|l| l.to_string().contains(what))
            .count()
    };
    ensure(about("t-sah") == 3 && about("device-rebuild") == 3, || {
        format!("{left_out:?}")
    })?;
    let csv = String::from_utf8(sandbox.read("g/growth.csv"))?;
    ensure(csv.lines().count() == 4, || csv)?;
    let svg = String::from_utf8(sandbox.read("g/growth.svg"))?;
    ensure(
        svg.contains("<svg") && svg.contains("Growth of demo:twist"),
        || svg,
    )
}
