//! Loads damaged files of each format. Each is loaded or refused with a message, in bounded time and memory.
//!
//! `ABVH_FULL=1` tests 20,000 files of each format, and 2,000 command lines.
//! A damaged file that fails stays in the target directory. Its path is printed, unless an allocation failed.

use cap::Cap;
use integration::fuzz::{COMMAND, Format, GLB, GLTF, Mutator, NPY, OBJ, PLY};
use integration::is_full;
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

/// Returns the seeds, then `count` files generated from them.
fn cases(format: Format, count: usize) -> impl Iterator<Item = Vec<u8>> {
    let read = |path| std::fs::read(path).expect("seeds can be read");
    let seeds: Vec<_> = format.seeds().into_iter().map(read).collect();
    let mut mutator = Mutator::new(seeds.clone(), 0x5eed);
    let mutated = std::iter::repeat_with(move || mutator.case());
    seeds.into_iter().chain(mutated.take(count))
}

/// Formats that are read without starting a process.
const READ: [Format; 5] = [OBJ, PLY, GLTF, GLB, NPY];

/// Loads the seeds and files generated from them: `full` in the full tier, else `full / 40`. Returns the share of files
/// that are valid.
fn load_mutated(format: Format, full: usize) -> f64 {
    let name = format!("{}-failed.{}", format.name, format.extension);
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let count = if is_full() { full } else { full / 40 };
    let (mut valid, mut all) = (0_u32, 0_u32);
    for bytes in cases(format, count) {
        let start = Instant::now();
        std::fs::write(&path, bytes).unwrap();
        let returned = panic::catch_unwind(|| format.load(&path));
        let loaded = returned.unwrap_or_else(|_| panic!("a panic over {}", path.display()));
        valid += u32::from(loaded.is_ok());
        all += 1;
        let took = start.elapsed();
        assert!(took < TIME_LIMIT, "{took:?} over {}", path.display());
    }
    std::fs::remove_file(path).expect("the last case is there");
    f64::from(valid) / f64::from(all)
}

/// Regressions are loaded or refused with a message. All other seeds are loaded.
#[test]
fn seeds_are_valid() {
    for format in READ.into_iter().chain([COMMAND]) {
        for path in format.seeds() {
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

/// Also checks that some damaged files are valid and some are not.
#[test]
fn damaged_files_do_not_panic() {
    for format in READ {
        let valid = load_mutated(format, FILES);
        assert!((0.02..0.96).contains(&valid), "{}: {valid}", format.name);
    }
}

/// Tests command lines. Each case starts a process, unless it contains NUL or the word `--`.
#[test]
fn damaged_command_lines_do_not_panic() {
    // Builds the program before time is measured.
    let _program = integration::program::abvh();
    load_mutated(COMMAND, 2_000);
}
