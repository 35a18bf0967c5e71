//! What is written, and what is said, when all goes well.

use crate::sandbox::{Sandbox, ensure, trial};
use libtest_mimic::{Failed, Trial};
use std::path::PathBuf;
use std::process::{Command, Stdio};

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial(
            "files::a_render_writes_its_frames_and_a_table",
            frames_and_table,
        ),
        trial(
            "files::frames_of_a_range_are_numbered_by_their_key_times",
            range,
        ),
        trial("files::quiet_is_silent_on_stderr", quiet),
        trial("files::resume_keeps_whole_frames_alone", resume),
        trial("files::the_same_run_writes_the_same_bytes", same_bytes),
        trial("files::help_and_version_succeed", help),
        trial("files::info_and_inspect_speak_json", json),
        trial("files::a_reader_that_goes_away_is_no_crash", broken_pipe),
    ]
}

const SMALL: &str = "render demo:twist:500 --size 32x24";

fn frames_and_table(sandbox: &Sandbox) -> Result<(), Failed> {
    let run = sandbox.run(&format!("{SMALL} --frames 3")).succeeds()?;
    let expected: Vec<PathBuf> = (0..3)
        .map(|i| format!("abvh-out/frame_000{i}.png").into())
        .collect();
    ensure(sandbox.files() == expected, || {
        format!("{:?}", sandbox.files())
    })?;
    for path in expected {
        let picture = image::open(sandbox.path().join(&path))?;
        ensure((picture.width(), picture.height()) == (32, 24), || {
            format!("{path:?}")
        })?;
    }
    let stages = [
        "interpolate",
        "preprocess",
        "refit",
        "trace",
        "median",
        "p95",
    ];
    let missing: Vec<_> = stages
        .iter()
        .filter(|&&s| !run.stdout.contains(s))
        .collect();
    ensure(missing.is_empty(), || {
        format!("no {missing:?} in the table:\n{}", run.stdout)
    })
}

fn range(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = format!("{SMALL} --frames 2..4 --out here --stats s.json --quiet");
    sandbox.run(&words).succeeds()?;
    let files = ["here/frame_0002.png", "here/frame_0003.png", "s.json"].map(PathBuf::from);
    ensure(sandbox.files() == files, || {
        format!("{:?}", sandbox.files())
    })?;
    let stats: serde_json::Value = serde_json::from_slice(&sandbox.read("s.json"))?;
    let times: Vec<_> = (0..2)
        .map(|i| stats["frames"][i]["time"].as_f64())
        .collect();
    ensure(times == [Some(2.0), Some(3.0)], || format!("{times:?}"))
}

fn quiet(sandbox: &Sandbox) -> Result<(), Failed> {
    let run = sandbox
        .run(&format!("{SMALL} --frames 2 --quiet"))
        .succeeds()?;
    ensure(run.stderr.is_empty(), || run.stderr)
}

fn resume(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = format!("{SMALL} --frames 3 --out out --hits out --quiet");
    sandbox.run(&words).succeeds()?;
    let whole = sandbox.read("out/frame_0002.png");
    let first = std::fs::metadata(sandbox.path().join("out/frame_0001.png"))?.modified()?;
    std::fs::remove_file(sandbox.path().join("out/hits_0002.npz"))?;
    sandbox.write("out/frame_0002.png", "made again");
    sandbox.run(&format!("{words} --resume")).succeeds()?;
    let again = std::fs::metadata(sandbox.path().join("out/frame_0001.png"))?.modified()?;
    ensure(again == first, || "a whole frame was made again".into())?;
    ensure(sandbox.read("out/frame_0002.png") == whole, || {
        "half a frame was not made again".into()
    })?;
    ensure(sandbox.files().len() == 6, || {
        format!("{:?}", sandbox.files())
    })
}

fn same_bytes(sandbox: &Sandbox) -> Result<(), Failed> {
    for out in ["a", "b"] {
        let words =
            format!("{SMALL} --frames 2 --out {out} --hits {out} --rays-out {out}.npy --quiet");
        sandbox.run(&words).succeeds()?;
    }
    for name in ["/frame_0001.png", "/hits_0001.npz", ".npy"] {
        let [a, b] = ["a", "b"].map(|out| sandbox.read(&format!("{out}{name}")));
        ensure(a == b, || format!("{name} differs"))?;
    }
    Ok(())
}

fn help(sandbox: &Sandbox) -> Result<(), Failed> {
    for words in ["--help", "render --help", "trace --help"] {
        let run = sandbox.run(words).succeeds()?;
        ensure(
            run.stdout.contains("Usage") && run.stderr.is_empty(),
            || words.into(),
        )?;
    }
    let run = sandbox.run("--version").succeeds()?;
    ensure(run.stdout.starts_with("abvh "), || run.stdout)
}

fn json(sandbox: &Sandbox) -> Result<(), Failed> {
    for words in ["info --json", "inspect demo:collide:500 --json"] {
        let run = sandbox.run(words).succeeds()?;
        let value: serde_json::Value = serde_json::from_str(&run.stdout)?;
        ensure(value.is_object(), || run.stdout)?;
    }
    Ok(())
}

/// The pipe's reading end is closed before the program writes.
fn broken_pipe(sandbox: &Sandbox) -> Result<(), Failed> {
    for words in ["info", "--help", "inspect demo:twist:200"] {
        let mut child = Command::new(integration::program::abvh())
            .args(words.split(' '))
            .current_dir(sandbox.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()?;
        drop(child.stdout.take());
        let output = child.wait_with_output()?;
        let stderr = String::from_utf8_lossy(&output.stderr);
        ensure(!stderr.contains("panicked"), || {
            format!("abvh {words}: {stderr}")
        })?;
        ensure(output.status.code() != Some(101), || {
            format!("abvh {words}: {:?}", output.status)
        })?;
    }
    Ok(())
}
