//! A disk that fills up while files are written: exit 1, one line, no file under a final name.
//!
//! A tiny tmpfs in a namespace of its own, where this machine lets us have one.

use crate::sandbox::{Run, Sandbox, trial};
use integration::program::abvh;
use libtest_mimic::Trial;
use std::path::Path;
use std::process::{Command, Output};

pub(crate) fn trials() -> Vec<Trial> {
    let tried = on_full_disk(Sandbox::new().path(), Path::new("true"), "");
    let possible = tried.is_ok_and(|o| o.status.success());
    let trial = trial("disk::a_full_one_leaves_no_half_file", full);
    let lacks = trial.with_ignored_flag(!possible);
    vec![lacks.with_kind(if possible {
        ""
    } else {
        "needs leave to mount a tmpfs"
    })]
}

fn full(sandbox: &Sandbox) {
    for words in [
        "--size 640x480 --frames 1 --out full",
        "--size 160x120 --frames 2 --no-images --hits full",
        "--size 160x120 --frames 1 --no-images --rays-out full/rays.npy",
    ] {
        let words = format!("render demo:twist:500 --quiet {words}");
        let run = Run::of(
            &on_full_disk(sandbox.path(), abvh(), &words).unwrap(),
            &words,
        );
        assert_eq!(run.stdout.lines().last(), Some("left:"), "{words}");
        run.fails(1, &["full", "space"]);
    }
}

/// Runs a command where `full` is a disk of 8 kB; the last line of stdout lists what it holds then.
fn on_full_disk(folder: &Path, program: &Path, words: &str) -> std::io::Result<Output> {
    std::fs::create_dir_all(folder.join("full"))?;
    let script = "mount -t tmpfs -o size=8k none full || exit 77; \"$0\" \"$@\"; code=$?; \
                  echo left: $(ls -A full | grep -v ^abvh-run) | sed 's/ $//'; exit $code";
    let mut command = Command::new("unshare");
    command.args(["--user", "--map-root-user", "--mount", "sh", "-c", script]);
    let words = words.split_whitespace();
    command
        .arg(program)
        .args(words)
        .current_dir(folder)
        .output()
}
