//! Loads damaged files of each format. Each is loaded or refused with a message, in bounded time and memory.
//!
//! `ABVH_FULL=1` tests 20,000 files of each format, and 2,000 command lines.
//! A case that fails stays in the target directory, and its path is printed.

use cap::Cap;
use integration::fuzz::{COMMAND, Format, GLB, GLTF, Mutator, NPY, OBJ, PLY};
use std::alloc::System;
use std::panic;
use std::path::Path;
use std::time::{Duration, Instant};

/// Limits the memory of loading. Allocations beyond the limit fail.
#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, 1 << 30);

/// Time limit of loading one file.
const TIME_LIMIT: Duration = Duration::from_secs(2);

/// Files of each format in the full tier.
const FILES: usize = 20_000;

/// Returns the number of cases, not counting the seeds.
fn count(short: usize, full: usize) -> usize {
    if integration::is_full() { full } else { short }
}

/// Returns the seeds, then files generated from them.
fn cases(format: Format, count: usize) -> impl Iterator<Item = Vec<u8>> {
    let seeds: Vec<_> = format.seeds().into_iter().map(|(_, bytes)| bytes).collect();
    let mut mutator = Mutator::new(seeds.clone(), 0x5eed);
    let mutated = std::iter::repeat_with(move || mutator.case());
    seeds.into_iter().chain(mutated.take(count))
}

/// Formats that are read without starting a process.
const READ: [Format; 5] = [OBJ, PLY, GLTF, GLB, NPY];

fn load_mutated(format: Format, full: usize) {
    let name = format!("{}-failed.{}", format.name, format.extension);
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    for bytes in cases(format, count(500.min(full / 40), full)) {
        let start = Instant::now();
        std::fs::write(&path, bytes).unwrap();
        let returned = panic::catch_unwind(|| format.load(&path)).is_ok();
        assert!(returned, "a panic over {}", path.display());
        let took = start.elapsed();
        assert!(took < TIME_LIMIT, "{took:?} over {}", path.display());
    }
    std::fs::remove_file(path).expect("the last case is there");
}

/// Regressions are loaded or refused with a message. All other seeds are loaded.
#[test]
fn seeds_are_valid() {
    for format in READ.into_iter().chain([COMMAND]) {
        for (path, _) in format.seeds() {
            let shown = path.display();
            // A file with another extension would be refused before it is parsed.
            let is_of_format = path.extension().is_some_and(|e| e == format.extension);
            assert!(is_of_format, "{shown} must end with .{}", format.extension);
            let found = format.load(&path);
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let may_be_refused = name.starts_with("regression-");
            assert!(found.is_ok() || may_be_refused, "{shown}: {found:?}");
        }
    }
}

#[test]
fn some_mutations_remain_loadable() {
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
fn damaged_files_do_not_panic() {
    READ.into_iter()
        .for_each(|format| load_mutated(format, FILES));
}

/// Tests command lines. Each case starts a process.
#[test]
fn damaged_command_lines_do_not_panic() {
    // Builds the program before time is measured.
    let _program = integration::program::abvh();
    load_mutated(COMMAND, 2_000);
}
