//! A run that is killed or asked to end at any moment leaves whole files only, and can be taken up again.

use crate::runs::bytes;
use crate::sandbox::{Sandbox, ensure, trial};
use fastrand::Rng;
use libtest_mimic::{Failed, Trial};
use npyz::npz::NpzArchive;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial(
            "killed::whatever_has_its_final_name_is_whole",
            whole_or_absent,
        ),
        trial("killed::shards_resume_to_the_bytes_of_one_run", shards),
        trial("killed::signals_end_with_their_codes", signals),
        trial("killed::a_signal_leaves_no_half_file", signal_while_writing),
    ]
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
    let mut child = spawn(sandbox, WORDS)?;
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

fn spawn(sandbox: &Sandbox, words: &str) -> Result<Child, Failed> {
    let program = Command::new(integration::program::abvh())
        .args(words.split_whitespace())
        .current_dir(sandbox.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()?;
    Ok(program)
}

/// Runs that are killed.
fn kills() -> u32 {
    if integration::is_full() { 100 } else { 6 }
}

fn shards(sandbox: &Sandbox) -> Result<(), Failed> {
    const WORDS: &str = "render demo:collide:3000 --backend cpu --size 160x120 --frames 10 --quiet --hits o --out o";
    let whole = WORDS
        .replace("--out o", "--out all")
        .replace("--hits o", "--hits all");
    sandbox.run(&whole).succeeds()?;
    let all = bytes(sandbox, "all");
    let mut rng = Rng::with_seed(7);
    for round in 0..kills().div_ceil(2) {
        let mut running = Vec::new();
        for i in 1..=2 {
            running.push(spawn(sandbox, &format!("{WORDS} --shard {i}/2 --resume"))?);
        }
        for child in &mut running {
            std::thread::sleep(Duration::from_millis(rng.u64(5..160)));
            child.kill()?;
            child.wait()?;
        }
        if round % 4 == 3 {
            resumed(sandbox, WORDS, &all)?;
            std::fs::remove_dir_all(sandbox.path().join("o"))?;
        }
    }
    resumed(sandbox, WORDS, &all)
}

fn resumed(sandbox: &Sandbox, words: &str, all: &BTreeMap<PathBuf, Vec<u8>>) -> Result<(), Failed> {
    for i in 1..=2 {
        sandbox
            .run(&format!("{words} --shard {i}/2 --resume"))
            .succeeds()?;
    }
    sandbox.run("merge o").succeeds()?;
    ensure(bytes(sandbox, "o") == *all, || {
        format!("{:?}", sandbox.all_files())
    })
}

#[cfg(unix)]
fn signals(sandbox: &Sandbox) -> Result<(), Failed> {
    for (signal, code) in [("INT", 130), ("TERM", 143)] {
        let mut child = spawn(
            sandbox,
            "render demo:collide:20000 --backend cpu --frames 4000 --size 320x240 --quiet",
        )?;
        let first = sandbox.path().join("abvh-out/frame_0001.png");
        for _ in 0..600 {
            if first.exists() {
                break;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        Command::new("kill")
            .args(["-s", signal, &child.id().to_string()])
            .status()?;
        let status = child.wait()?;
        ensure(status.code() == Some(code), || {
            format!("{signal}: {status:?}")
        })?;
        let left = sandbox.all_files();
        let part = left
            .iter()
            .any(|f| f.extension().is_some_and(|e| e == "part"));
        ensure(!part, || format!("{left:?}"))?;
        std::fs::remove_dir_all(sandbox.path().join("abvh-out"))?;
    }
    Ok(())
}

/// Before the first frame, where nobody looks out for signals.
#[cfg(unix)]
fn signal_while_writing(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = "render demo:twist:100 --backend cpu --frames 1 --size 2048x2048 --quiet --rays-out r/rays.npy";
    std::fs::create_dir(sandbox.path().join("r"))?;
    let half = || -> bool {
        let all = sandbox.all_files();
        let mut all = all.iter().filter(|f| f.starts_with("r"));
        all.any(|f| std::fs::metadata(sandbox.path().join(f)).is_ok_and(|m| m.len() > 1 << 20))
    };
    for _ in 0..3 {
        let mut child = spawn(sandbox, words)?;
        while !half() && child.try_wait()?.is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        let pid = child.id().to_string();
        Command::new("kill").args(["-s", "INT", &pid]).status()?;
        let code = child.wait()?.code();
        ensure(code == Some(130), || format!("{code:?}"))?;
        if !sandbox.path().join("r/rays.npy").exists() {
            let left = sandbox.all_files();
            return ensure(left.is_empty(), || format!("{left:?}"));
        }
        std::fs::remove_file(sandbox.path().join("r/rays.npy"))?;
    }
    Err("the file was whole before the signal came, three times".into())
}

#[cfg(not(unix))]
fn signals(_: &Sandbox) -> Result<(), Failed> {
    Ok(())
}

#[cfg(not(unix))]
fn signal_while_writing(_: &Sandbox) -> Result<(), Failed> {
    Ok(())
}
