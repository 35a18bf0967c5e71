//! Vertices that are nowhere: their triangles are inactive, counted, and the rest is rendered.

use crate::sandbox::{Sandbox, list, trial};
use libtest_mimic::Trial;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial(
            "inactive::triangles_are_counted_and_the_rest_is_seen",
            counted,
        ),
        trial("inactive::who_comes_back_is_seen_again", coming_back),
    ]
}

/// Renders `scene` and gives the counts of each frame: inactive, degenerate, hits.
fn counts(sandbox: &Sandbox, scene: &str, options: &str) -> Vec<[u64; 3]> {
    sandbox.does(&format!(
        "render {scene} --size 32x24 --stats s.json --overwrite --quiet {options}"
    ));
    let names = ["inactive", "degenerate", "hits"];
    let of = |frame: &serde_json::Value| names.map(|n| frame[n].as_u64().unwrap());
    list(&sandbox.json("s.json")["frames"])
        .iter()
        .map(of)
        .collect()
}

fn square(fourth: &str) -> String {
    format!("v 0 0 0\nv 1 0 0\nv 1 1 0\nv {fourth}\nf 1 2 3\nf 1 3 4\n")
}

fn counted(sandbox: &Sandbox) {
    let fourths = ["nan 1 0", "0 inf 0", "0 1 -inf", "0 1 1e39", "0.5 0.5 0"];
    for (i, fourth) in fourths.iter().enumerate() {
        sandbox.write(&format!("{i}.obj"), square(fourth));
    }
    sandbox.write("gone.obj", "v nan 0 0\nv nan 1 0\nv nan 1 1\nf 1 2 3\n");
    for (scene, expected, seen) in [
        ("0.obj+1.obj@2,0,0+2.obj@0,2,0+3.obj@2,2,0", [4, 0], true),
        ("4.obj", [0, 1], true),
        ("gone.obj", [1, 0], false),
    ] {
        let found = counts(sandbox, scene, "--hits .");
        let [inactive, degenerate, hits] = found[0];
        assert_eq!(
            ([inactive, degenerate], hits > 0),
            (expected, seen),
            "{scene}"
        );
        let picture = image::open(sandbox.path().join("abvh-out/frame_0000.png"));
        assert_eq!(picture.unwrap().width(), 32);
    }
}

fn coming_back(sandbox: &Sandbox) {
    sandbox.write("d/1.obj", square("nan nan nan"));
    sandbox.write("d/2.obj", square("0 1 0"));
    sandbox.write("d/3.obj", square("0 1 0"));
    for update in ["rebuild", "refit", "async --lockstep 1"] {
        let found = counts(sandbox, "d", &format!("--frames 3 --update {update}"));
        let inactive: Vec<_> = found.iter().map(|f| f[0]).collect();
        assert!(
            inactive == [1, 0, 0] && found[2][2] > found[0][2],
            "{update}: {found:?}"
        );
    }
}
