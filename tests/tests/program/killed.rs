//! A run that is killed at any moment leaves whole files only, and can be taken up again.

use crate::sandbox::{Sandbox, ensure, trial};
use fastrand::Rng;
use libtest_mimic::{Failed, Trial};
use npyz::npz::NpzArchive;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

pub(crate) fn trials() -> Vec<Trial> {
    vec![trial(
        "killed::whatever_has_its_final_name_is_whole",
        whole_or_absent,
    )]
}

/// Runs that are killed.
const RUNS: u32 = 14;

const WORDS: &str = "render demo:twist:3000 --backend cpu --frames 12 --size 96x64 --quiet --out out --hits hits \
                     --stats stats.json --timeline timeline.json --rays-out rays.npy";

fn whole_or_absent(_: &Sandbox) -> Result<(), Failed> {
    let mut rng = Rng::with_seed(9);
    let undisturbed = Sandbox::new();
    // The first call builds the program: that is no part of a run.
    let _ = integration::program::abvh();
    let start = Instant::now();
    undisturbed.run(WORDS).succeeds()?;
    let whole_run = start.elapsed();
    let all = whole_files(&undisturbed)?;
    ensure(all.len() == 27, || format!("{all:?}"))?;
    let mut cut_short = 0;
    for _ in 0..RUNS {
        let sandbox = Sandbox::new();
        kill_after(&sandbox, whole_run.mul_f64(rng.f64()))?;
        let left = whole_files(&sandbox)?;
        cut_short += u32::from(!left.is_empty() && left.len() < all.len());
        sandbox.run(&format!("{WORDS} --resume")).succeeds()?;
        let resumed = whole_files(&sandbox)?;
        ensure(!sandbox.all_files().iter().any(|f| is_temporary(f)), || {
            format!("left behind: {:?}", sandbox.all_files())
        })?;
        ensure(resumed == all, || format!("resumed: {resumed:?}"))?;
        for file in all.iter().filter(|f| is_repeatable(f)) {
            let [a, b] = [&undisturbed, &sandbox].map(|s| s.read(&file.to_string_lossy()));
            ensure(a == b, || format!("{} differs", file.display()))?;
        }
    }
    // Otherwise nothing was put to the test.
    ensure(cut_short > 0, || "no run was killed midway".into())
}

/// Starts the program and kills it, without leave to clean up.
fn kill_after(sandbox: &Sandbox, delay: Duration) -> Result<(), Failed> {
    let mut child = Command::new(integration::program::abvh())
        .args(WORDS.split_whitespace())
        .current_dir(sandbox.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()?;
    std::thread::sleep(delay);
    child.kill()?;
    child.wait()?;
    Ok(())
}

/// Files under final names, each of which must read back whole.
fn whole_files(sandbox: &Sandbox) -> Result<Vec<PathBuf>, Failed> {
    let mut files = sandbox.files();
    files.retain(|f| !is_temporary(f));
    for file in &files {
        read_whole(&sandbox.path().join(file))
            .map_err(|e| format!("{} is no whole file: {e:?}", file.display()))?;
    }
    Ok(files)
}

fn is_temporary(file: &Path) -> bool {
    file.extension().is_some_and(|e| e == "part")
}

/// Whether the same run writes the same bytes.
fn is_repeatable(file: &Path) -> bool {
    file.extension().is_some_and(|e| e != "json")
}

fn read_whole(path: &Path) -> Result<(), Failed> {
    match path.extension().and_then(|e| e.to_str()) {
        Some("png") => {
            image::open(path)?;
        }
        Some("npz") => {
            let mut archive = NpzArchive::open(path)?;
            for name in ["t", "u", "v"] {
                let array = archive.by_name(name)?.ok_or("an array is missing")?;
                array.into_vec::<f32>()?;
            }
            let array = archive.by_name("triangle")?.ok_or("no triangles")?;
            array.into_vec::<u32>()?;
            let array = archive.by_name("shadow")?.ok_or("no shadows")?;
            array.into_vec::<u8>()?;
        }
        Some("npy") => {
            let file = std::fs::File::open(path)?;
            npyz::NpyFile::new(std::io::BufReader::new(file))?.into_vec::<f32>()?;
        }
        Some("json") => {
            serde_json::from_slice::<serde_json::Value>(&std::fs::read(path)?)?;
        }
        other => return Err(format!("what is {other:?}?").into()),
    }
    Ok(())
}
