//! A disk that fills up while files are written: exit 1, one line, no file under a final name.
//!
//! A tiny tmpfs in a namespace of its own, where this machine lets us have one.

use crate::sandbox::{Run, Sandbox, ensure};
use integration::program::abvh;
use libtest_mimic::{Failed, Trial};
use std::path::Path;
use std::process::{Command, Output};

pub(crate) fn trials() -> Vec<Trial> {
    let cases = [
        (
            "pictures",
            "render demo:twist:500 --size 640x480 --frames 1 --quiet --out full",
        ),
        (
            "hits",
            "render demo:twist:500 --size 160x120 --frames 2 --no-images --quiet --hits full",
        ),
        (
            "rays",
            "render demo:twist:500 --size 160x120 --frames 1 --no-images --quiet --rays-out full/rays.npy",
        ),
    ];
    let possible =
        on_full_disk(Sandbox::new().path(), "true", &[]).is_ok_and(|o| o.status.success());
    let trial = |(name, words): (&str, &'static str)| {
        let trial = Trial::test(
            format!("disk::a_full_one_leaves_no_half_file::{name}"),
            move || full(words),
        );
        if possible {
            return trial;
        }
        trial
            .with_ignored_flag(true)
            .with_kind("needs leave to mount a tmpfs")
    };
    cases.into_iter().map(trial).collect()
}

fn full(words: &'static str) -> Result<(), Failed> {
    let sandbox = Sandbox::new();
    let program = abvh().to_string_lossy();
    let args: Vec<&str> = words.split(' ').collect();
    let output = on_full_disk(sandbox.path(), &program, &args)?;
    let run = Run::of(&output, words);
    let left = run.stdout.lines().last().unwrap_or_default().to_owned();
    run.fails(1, &["full", "space"])?;
    ensure(left == "left:", || left)
}

/// Runs a command where `full` is a disk of 8 kB; the last line of stdout lists what it holds then.
fn on_full_disk(folder: &Path, program: &str, args: &[&str]) -> std::io::Result<Output> {
    std::fs::create_dir_all(folder.join("full"))?;
    let script = "mount -t tmpfs -o size=8k none full || exit 77; \"$@\"; code=$?; \
                  echo left: $(ls -A full | grep -v ^abvh-run) | sed 's/ $//'; exit $code";
    Command::new("unshare")
        .args([
            "--user",
            "--map-root-user",
            "--mount",
            "sh",
            "-c",
            script,
            "sh",
            program,
        ])
        .args(args)
        .current_dir(folder)
        .output()
}
