//! Damaged files of each format: loaded or refused in words, in bounded time and memory.
//!
//! `ABVH_FULL=1` tries 20,000 files of each format, and 1,000 of each by the program; and 2,000 command lines.
//! A case that fails stays in the target directory; its path is told.

use cap::Cap;
#[cfg(target_os = "linux")]
use integration::fuzz::is_refusal;
use integration::fuzz::{COMMAND, Format, GLB, GLTF, Mutator, NPY, OBJ, PLY, TOPOLOGY};
use std::alloc::System;
use std::panic;
use std::path::Path;
#[cfg(target_os = "linux")]
use std::process::{Command, Output};
use std::time::{Duration, Instant};

/// What loading may take. An allocation beyond fails, as it does on a machine of so much memory.
#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, 1 << 30);

/// What loading one file may last.
const PATIENCE: Duration = Duration::from_secs(2);

/// Files of each format in the full tier.
const FILES: usize = 20_000;

/// Cases in all, without the seeds.
fn count(short: usize, full: usize) -> usize {
    if integration::is_full() { full } else { short }
}

/// Seeds, and files made from them.
fn cases(format: Format, count: usize) -> impl Iterator<Item = Vec<u8>> {
    let seeds: Vec<_> = format.seeds().into_iter().map(|(_, bytes)| bytes).collect();
    let mut mutator = Mutator::new(seeds.clone(), 0x5eed);
    let mutated = std::iter::repeat_with(move || mutator.case());
    seeds.into_iter().chain(mutated.take(count))
}

/// What is read without a process.
const READ: [Format; 6] = [OBJ, PLY, GLTF, GLB, NPY, TOPOLOGY];

fn attack(format: Format, full: usize) {
    let name = format!("{}-failed.{}", format.name, format.extension);
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    for bytes in cases(format, count(500.min(full / 40), full)) {
        let start = Instant::now();
        std::fs::write(&path, bytes).unwrap();
        let whole = panic::catch_unwind(|| format.load(&path)).is_ok();
        assert!(whole, "a panic over {}", path.display());
        let took = start.elapsed();
        assert!(took < PATIENCE, "{took:?} over {}", path.display());
    }
    std::fs::remove_file(path).expect("the last case is there");
}

#[test]
fn seeds_are_whole() {
    for format in READ.into_iter().chain([COMMAND]) {
        for (path, _) in format.seeds() {
            let found = format.load(&path);
            let is_whole = !path.to_string_lossy().contains("regression");
            assert_eq!(found.is_ok(), is_whole, "{}: {found:?}", path.display());
        }
    }
}

#[test]
fn mutations_reach_beyond_the_head() {
    for format in READ {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("case").with_extension(format.extension);
        let taken = cases(format, 300).filter(|bytes| {
            std::fs::write(&path, bytes).unwrap();
            format.load(&path).is_ok()
        });
        let taken = taken.count();
        assert!((10..=280).contains(&taken), "{}: {taken}", format.name);
    }
}

#[test]
fn damaged_files_are_loaded_or_refused() {
    READ.into_iter().for_each(|format| attack(format, FILES));
}

/// Each case starts a process.
#[test]
fn damaged_command_lines_are_answered_or_refused() {
    // Before the clock starts, it is built.
    let _program = integration::program::abvh();
    attack(COMMAND, 2_000);
}

/// Exit code 0 or 2, one line, nothing left behind.
#[cfg(target_os = "linux")]
#[test]
fn the_program_survives_damaged_files() {
    // Built before the clock runs.
    let _program = integration::program::abvh();
    for format in [OBJ, PLY, GLTF, GLB, NPY] {
        let case = format!("case.{}", format.extension);
        let words = match format.name {
            "npy" => format!("trace square.obj --time 0 --rays {case} --out made.npz"),
            _ => format!("render {case} --frames 2 --size 8x8 --no-images --hits made"),
        };
        for bytes in cases(format, count(8, 1_000)) {
            let folder = tempfile::tempdir().unwrap();
            let square = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
            std::fs::write(folder.path().join("square.obj"), square).unwrap();
            std::fs::write(folder.path().join(&case), &bytes).unwrap();
            let start = Instant::now();
            let output = run(folder.path(), &words);
            let slow = (start.elapsed() > PATIENCE).then_some("too slow");
            if let Some(fault) = slow.or(fault(folder.path(), &output)) {
                let kept = folder.keep();
                panic!("{fault}: {words} in {}: {output:?}", kept.display());
            }
        }
    }
}

/// Runs the program with a gigabyte of addresses.
#[cfg(target_os = "linux")]
fn run(folder: &Path, words: &str) -> Output {
    let limited = "ulimit -v 1048576; exec \"$0\" \"$@\"";
    let all = format!("{words} --backend cpu --threads 1 --builder-threads 1 --quiet");
    let mut command = Command::new("sh");
    command
        .args(["-c", limited])
        .arg(integration::program::abvh());
    command.args(all.split(' ')).current_dir(folder);
    command.output().expect("a shell starts")
}

/// Why `output` is no good end.
#[cfg(target_os = "linux")]
fn fault(folder: &Path, output: &Output) -> Option<&'static str> {
    let made = ["made", "made.npz"].map(|name| folder.join(name).exists());
    match output.status.code() {
        Some(0) => None,
        Some(2) if made != [false; 2] => Some("output is left"),
        Some(2) => (!is_refusal(output)).then_some("not one line of plain text"),
        _ => Some("neither done nor refused"),
    }
}
