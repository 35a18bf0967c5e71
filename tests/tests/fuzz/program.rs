//! Damaged files before the program itself: exit code 0 or 2, one line, nothing left behind.

use crate::{PATIENCE, cases, count};
use integration::fuzz::{Format, GLB, GLTF, NPY, OBJ, PLY};
use integration::program::abvh;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::time::Instant;

/// Gives the program a gigabyte of addresses.
const LIMITED: &str = "ulimit -v 1048576; exec \"$0\" \"$@\"";

/// What is asked of a file, without a device.
fn words(format: Format, case: &str) -> String {
    match format.name {
        "npy" => format!("trace square.obj --time 0 --rays {case} --out made.npz"),
        _ => format!("render {case} --frames 2 --size 8x8 --no-images --hits made"),
    }
}

fn run(folder: &Path, words: &str) -> Output {
    let all = format!("{words} --backend cpu --threads 1 --builder-threads 1 --quiet");
    let mut command = Command::new("sh");
    command.args(["-c", LIMITED]).arg(abvh());
    command.args(all.split(' ')).current_dir(folder);
    command.output().expect("a shell starts")
}

/// Why `output` is no good end.
fn fault(folder: &Path, output: &Output) -> Option<&'static str> {
    let made = ["made", "made.npz"].map(|name| folder.join(name).exists());
    match output.status.code() {
        Some(0) => None,
        Some(2) if made != [false; 2] => Some("output is left"),
        Some(2) => {
            let line = output.stderr.strip_suffix(b"\n").unwrap_or_default();
            let text = std::str::from_utf8(line).unwrap_or_default();
            let is_line = text.starts_with("abvh: ") && !text.contains(char::is_control);
            (!is_line).then_some("not one line of plain text")
        }
        _ => Some("neither done nor refused"),
    }
}

fn attack(format: Format) {
    let case = format!("case.{}", format.extension);
    let words = words(format, &case);
    // Built before the clock runs.
    let _ = abvh();
    for bytes in cases(format, count(20, 1_000)) {
        let folder = tempfile::tempdir().unwrap();
        let square = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        fs::write(folder.path().join("square.obj"), square).unwrap();
        fs::write(folder.path().join(&case), &bytes).unwrap();
        let start = Instant::now();
        let output = run(folder.path(), &words);
        let slow = (start.elapsed() > PATIENCE).then_some("too slow");
        if let Some(fault) = slow.or(fault(folder.path(), &output)) {
            let kept = folder.keep();
            panic!("{fault}: {words} in {}: {output:?}", kept.display());
        }
    }
}

#[test]
fn obj() {
    attack(OBJ);
}

#[test]
fn ply() {
    attack(PLY);
}

#[test]
fn gltf() {
    attack(GLTF);
}

#[test]
fn glb() {
    attack(GLB);
}

#[test]
fn npy() {
    attack(NPY);
}
