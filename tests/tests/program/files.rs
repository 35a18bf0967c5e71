//! What is written, and what is said, when all goes well.

use crate::devices::{BACKENDS, HOST, Subject};
use crate::sandbox::{Sandbox, picture, says, trial};
use libtest_mimic::Trial;
use std::ffi::OsStr;
use std::path::PathBuf;

pub(crate) fn trials() -> Vec<Trial> {
    let memory = |on: Subject| on.trial("files::memory_is_foreseen", memory_is_foreseen);
    let mut all: Vec<_> = BACKENDS.into_iter().chain([HOST]).map(memory).collect();
    all.extend([
        trial("files::a_render_writes_its_frames_and_a_table", table),
        trial("files::help_and_version_succeed", help),
        trial("files::a_reader_that_goes_away_is_no_crash", broken_pipe),
    ]);
    all
}

const SMALL: &str = "render demo:twist:500 --size 32x24";

fn table(sandbox: &Sandbox) {
    let run = sandbox.does(&format!("{SMALL} --frames 3"));
    let expected = [0, 1, 2].map(|i| PathBuf::from(format!("abvh-out/frame_000{i}.png")));
    assert_eq!(sandbox.files(), expected);
    for path in expected {
        let (size, _) = picture(&sandbox.read(&path.to_string_lossy()));
        assert_eq!(size, [32, 24], "{path:?}");
    }
    says(&run.stdout, "interpolate|preprocess|refit|trace|median|p95");
}

/// What a run is expected to take is what it takes, or up to half as much again.
fn memory_is_foreseen(sandbox: &Sandbox, backend: &str) {
    let words = format!("render demo:twist:100000 --backend {backend} --frames 3 --quiet");
    // The host's memory holds a driver too, where there is one.
    let of = match backend {
        "cpu" => "host_bytes",
        _ => "device_bytes",
    };
    for how in [
        "--size 64x48 --layout bvh2 --update async",
        "--size 640x480 --layout fast --update rebuild",
    ] {
        sandbox.does(&format!("{words} {how} --no-images --stats s.json"));
        let stats = sandbox.json("s.json");
        let expected = stats["expected_memory"][of].as_u64().unwrap();
        let taken = stats["summary"][of]["worst"].as_f64().unwrap() as u64;
        let foreseen = (taken..=taken * 3 / 2).contains(&expected);
        assert!(foreseen, "{how}: {expected} bytes expected, {taken} taken");
    }
}

fn help(sandbox: &Sandbox) {
    // How wide a terminal is, is no matter to a pipe.
    let narrow = [("COLUMNS", OsStr::new("20"))];
    for words in ["--help", "render --help", "trace --help", "info"] {
        let run = sandbox.does(words);
        let is_help = words == "info" || run.stdout.contains("Usage");
        assert!(is_help && run.stderr.is_empty(), "{words}");
        assert_eq!(sandbox.run_where(words, &narrow).stdout, run.stdout);
    }
    assert!(sandbox.does("--version").stdout.starts_with("abvh "));
}

/// The pipe's reading end is closed before the program writes.
fn broken_pipe(sandbox: &Sandbox) {
    for words in ["info", "--help", "inspect demo:twist:200"] {
        let mut child = sandbox.piped(words);
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        let crashed = stderr.contains("panicked") || output.status.code() == Some(101);
        assert!(!crashed, "abvh {words}: {output:?}");
    }
}
