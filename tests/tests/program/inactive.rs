//! Vertices that are nowhere: their triangles are inactive, counted, and the rest is rendered.

use crate::sandbox::{Sandbox, ensure, trial};
use libtest_mimic::{Failed, Trial};

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("inactive::they_are_counted_and_the_rest_is_seen", some),
        trial("inactive::a_scene_of_nothing_else_is_an_empty_picture", all),
        trial("inactive::who_comes_back_is_seen_again", coming_back),
        trial("degenerate::they_are_counted_and_never_seen", degenerate),
    ]
}

/// Renders `scene` and gives the counts of each frame: inactive, degenerate, hits.
fn counts(sandbox: &Sandbox, scene: &str, options: &str) -> Result<Vec<[u64; 3]>, Failed> {
    let words = format!("render {scene} --size 32x24 --stats s.json --overwrite --quiet {options}");
    sandbox.run(&words).succeeds()?;
    let stats = sandbox.json("s.json")?;
    let frames = stats["frames"].as_array().ok_or("no frames")?;
    let count = |frame: &serde_json::Value, name| frame[name].as_u64().unwrap_or(u64::MAX);
    let names = ["inactive", "degenerate", "hits"];
    Ok(frames.iter().map(|f| names.map(|n| count(f, n))).collect())
}

fn square(fourth: &str) -> String {
    format!("v 0 0 0\nv 1 0 0\nv 1 1 0\nv {fourth}\nf 1 2 3\nf 1 3 4\n")
}

fn some(sandbox: &Sandbox) -> Result<(), Failed> {
    for (i, fourth) in ["nan 1 0", "0 inf 0", "0 1 -inf", "0 1 1e39"]
        .iter()
        .enumerate()
    {
        sandbox.write(&format!("{i}.obj"), square(fourth));
    }
    let found = counts(sandbox, "0.obj+1.obj@2,0,0+2.obj@0,2,0+3.obj@2,2,0", "")?;
    let [inactive, degenerate, hits] = found[0];
    ensure((inactive, degenerate) == (4, 0) && hits > 0, || {
        format!("{found:?}")
    })
}

fn all(sandbox: &Sandbox) -> Result<(), Failed> {
    sandbox.write("a.obj", "v nan 0 0\nv nan 1 0\nv nan 1 1\nf 1 2 3\n");
    let found = counts(sandbox, "a.obj", "--hits .")?;
    ensure(found == [[1, 0, 0]], || format!("{found:?}"))?;
    let picture = image::open(sandbox.path().join("abvh-out/frame_0000.png"))?;
    ensure(picture.width() == 32, || "no picture".into())
}

fn coming_back(sandbox: &Sandbox) -> Result<(), Failed> {
    sandbox.write("d/1.obj", square("nan nan nan"));
    sandbox.write("d/2.obj", square("0 1 0"));
    sandbox.write("d/3.obj", square("0 1 0"));
    for update in ["rebuild", "refit", "async --lockstep 1"] {
        let found = counts(sandbox, "d", &format!("--frames 3 --update {update}"))?;
        let inactive: Vec<_> = found.iter().map(|f| f[0]).collect();
        ensure(inactive == [1, 0, 0] && found[2][2] > found[0][2], || {
            format!("{update}: {found:?}")
        })?;
    }
    Ok(())
}

fn degenerate(sandbox: &Sandbox) -> Result<(), Failed> {
    sandbox.write("a.obj", square("0.5 0.5 0"));
    let found = counts(sandbox, "a.obj", "")?;
    ensure(found[0][..2] == [0, 1] && found[0][2] > 0, || {
        format!("{found:?}")
    })
}
