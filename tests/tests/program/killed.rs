//! Runs are killed, terminated, run out of disk space or lose their input. They leave only complete files under final
//! names, and can be resumed.

use crate::files::array;
use crate::runs::bytes;
use crate::sandbox::{Run, SQUARE, Sandbox, trial};
use fastrand::Rng;
use integration::program::abvh;
use libtest_mimic::Trial;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

pub(crate) fn trials() -> Vec<Trial> {
    let mut all = vec![
        trial("killed::final_files_are_complete", whole_or_absent),
        trial("killed::resumed_shards_match_one_run", shards),
        trial("paged::changed_key_frame_file_ends_run", vanishes),
    ];
    if cfg!(unix) {
        all.push(trial("killed::signals_set_exit_codes", signals));
        let name = "killed::signal_leaves_no_partial_file";
        all.push(trial(name, signal_while_writing));
        #[cfg(unix)]
        all.push(trial("killed::signal_ends_a_blocked_run", blocked));
    }
    all.push(on_disk());
    all
}

/// Number of runs to kill.
const RUNS: u32 = 14;

const WORDS: &str = "render demo:twist:3000 --backend cpu --frames 12 --size 96x64 --quiet --out out --hits hits \
                     --stats stats.json --rays-out rays.npy";

fn whole_or_absent(undisturbed: &Sandbox) {
    let mut rng = Rng::with_seed(9);
    // The first call builds the program, which must not count as run time.
    let _ = integration::program::abvh();
    let start = Instant::now();
    undisturbed.run_ok(WORDS);
    let whole_run = start.elapsed();
    let all = whole_files(undisturbed);
    assert_eq!(all.len(), 26, "{all:?}");
    let mut cut_short = 0;
    for _ in 0..RUNS {
        let sandbox = Sandbox::new();
        kill(
            &mut sandbox.spawn(WORDS, Stdio::null),
            whole_run.mul_f64(rng.f64()),
        );
        let left = whole_files(&sandbox);
        cut_short += u32::from(!left.is_empty() && left.len() < all.len());
        sandbox.run_ok(&format!("{WORDS} --resume"));
        assert!(!has_temporary(&sandbox), "{:?}", sandbox.all_files());
        assert_eq!(whole_files(&sandbox), all);
        for file in all.iter().filter(|f| !has_extension(f, "json")) {
            let [a, b] = [undisturbed, &sandbox].map(|s| s.read(&file.to_string_lossy()));
            assert!(a == b, "{} differs", file.display());
        }
    }
    // Otherwise the test would prove nothing.
    assert!(cut_short > 0, "no run was killed midway");
}

/// Kills the process after a delay, so that it cannot clean up.
fn kill(child: &mut Child, delay: Duration) {
    std::thread::sleep(delay);
    child.kill().unwrap();
    child.wait().unwrap();
}

/// Sends a signal to the process and returns its exit code.
fn signalled(child: &mut Child, signal: &str) -> Option<i32> {
    let pid = child.id().to_string();
    let sent = Command::new("kill").args(["-s", signal, &pid]).status();
    assert!(sent.unwrap().success());
    child.wait().unwrap().code()
}

/// Returns the files with final names, after checking that each is complete.
fn whole_files(sandbox: &Sandbox) -> Vec<PathBuf> {
    let mut files = sandbox.files();
    files.retain(|f| !has_extension(f, "part"));
    files.iter().for_each(|f| read_whole(sandbox, f));
    files
}

fn has_extension(file: &Path, extension: &str) -> bool {
    file.extension().is_some_and(|e| e == extension)
}

fn has_temporary(sandbox: &Sandbox) -> bool {
    sandbox.all_files().iter().any(|f| has_extension(f, "part"))
}

fn read_whole(sandbox: &Sandbox, file: &Path) {
    let name = file.to_str().unwrap();
    let bytes = sandbox.read(name);
    match file.extension().and_then(|e| e.to_str()) {
        Some("png") => drop(image::load_from_memory(&bytes).unwrap()),
        Some("npz") => {
            for what in ["t", "u", "v"] {
                array::<f32>(sandbox, name, what);
            }
            array::<u32>(sandbox, name, "triangle");
            array::<u8>(sandbox, name, "shadow");
        }
        Some("npy") => {
            let file = npyz::NpyFile::new(&bytes[..]).unwrap();
            drop(file.into_vec::<f32>().unwrap());
        }
        Some("json") => drop(sandbox.json(name)),
        other => panic!("what is {other:?}?"),
    }
}

fn shards(sandbox: &Sandbox) {
    let words = "render demo:collide:3000 --backend cpu --size 160x120 --frames 10 --quiet";
    let shard = |i: usize| format!("{words} --hits o --out o --shard {i}/2 --resume");
    sandbox.run_ok(&format!("{words} --hits all --out all"));
    let all = bytes(sandbox, "all");
    let mut rng = Rng::with_seed(7);
    let rounds = if integration::is_full() { 50 } else { 3 };
    for round in 1..=rounds {
        let mut running = [1, 2].map(|i| sandbox.spawn(&shard(i), Stdio::null));
        for child in &mut running {
            kill(child, Duration::from_millis(rng.u64(5..160)));
        }
        if round % 4 != 0 && round < rounds {
            continue;
        }
        for i in [1, 2] {
            sandbox.run_ok(&shard(i));
        }
        sandbox.run_ok("merge o");
        assert!(bytes(sandbox, "o") == all, "{:?}", sandbox.all_files());
        std::fs::remove_dir_all(sandbox.path().join("o")).unwrap();
    }
}

fn signals(sandbox: &Sandbox) {
    let words = "render demo:collide:20000 --backend cpu --frames 4000 --size 320x240 --quiet";
    for (signal, code) in [("INT", 130), ("TERM", 143)] {
        let mut child = sandbox.spawn(words, Stdio::null);
        let first = sandbox.path().join("abvh-out/frame_0001.png");
        let mut waits = 0..600;
        while !first.exists() && waits.next().is_some() {
            std::thread::sleep(Duration::from_millis(50));
        }
        assert_eq!(signalled(&mut child, signal), Some(code), "{signal}");
        assert!(!has_temporary(sandbox), "{:?}", sandbox.all_files());
        std::fs::remove_dir_all(sandbox.path().join("abvh-out")).unwrap();
    }
}

/// Interrupts a run while it writes its first file, before the frame loop checks for signals.
fn signal_while_writing(sandbox: &Sandbox) {
    let words = "render demo:twist:100 --backend cpu --frames 1 --size 2048x2048 --quiet --rays-out r/rays.npy";
    std::fs::create_dir(sandbox.path().join("r")).unwrap();
    let is_large = |f: &PathBuf| {
        let size = std::fs::metadata(sandbox.path().join(f)).map(|m| m.len());
        f.starts_with("r") && size.is_ok_and(|size| size > 1 << 20)
    };
    for _ in 0..3 {
        let mut child = sandbox.spawn(words, Stdio::null);
        while !sandbox.all_files().iter().any(is_large) && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(signalled(&mut child, "INT"), Some(130));
        if !sandbox.path().join("r/rays.npy").exists() {
            assert!(sandbox.all_files().is_empty(), "{:?}", sandbox.all_files());
            return;
        }
        sandbox.remove("r/rays.npy");
    }
    panic!("the file was whole before the signal came, three times");
}

/// Tests signals while the output pipe is full, because its reader does not read.
#[cfg(unix)]
fn blocked(sandbox: &Sandbox) {
    let words =
        "render demo:twist:500 --backend cpu --frames 20 --size 320x240 --quiet --no-images";
    let path = crate::video::encoder(sandbox, "exec sleep 9");
    for (video, signal, code) in [("--y4m -", "INT", 130), ("--video a.mp4", "TERM", 143)] {
        let mut command = Command::new(abvh());
        command.args(words.split(' ')).args(video.split(' '));
        command.env("PATH", &path).current_dir(sandbox.path());
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let pipe = child.stdout.take().unwrap();
        let reader = Command::new("sleep").arg("9").stdin(pipe).spawn();
        let mut reader = reader.unwrap();
        std::thread::sleep(Duration::from_secs(2));
        let begun = Instant::now();
        assert_eq!(signalled(&mut child, signal), Some(code), "{video}");
        let took = begun.elapsed();
        assert!(took < Duration::from_secs(5), "{video}: {took:?}");
        let left = sandbox.files();
        assert!(left.iter().all(|f| f.starts_with("bin")), "{left:?}");
        reader.kill().unwrap();
        reader.wait().unwrap();
    }
}

/// Creates a test with a disk that fills up during writes. It is ignored if the machine does not permit mounting one.
fn on_disk() -> Trial {
    let trial = trial("killed::full_disk_leaves_no_partial_file", full_disk);
    match on_full_disk(Sandbox::new().path(), Path::new("true"), "") {
        Ok(tried) if tried.status.success() => trial,
        _ => (trial.with_ignored_flag(true)).with_kind("needs permission to mount a tmpfs"),
    }
}

fn full_disk(sandbox: &Sandbox) {
    for words in [
        "--size 640x480 --frames 1 --out full",
        "--size 160x120 --frames 2 --no-images --hits full",
        "--size 160x120 --frames 1 --no-images --rays-out full/rays.npy",
        // The journal's first line, which lists 3000 frame numbers, exceeds the disk.
        "--size 8x8 --frames 3000 --out full",
    ] {
        let words = format!("render demo:twist:500 --quiet {words}");
        let output = on_full_disk(sandbox.path(), abvh(), &words).unwrap();
        let run = Run::of(&output, &words);
        assert_eq!(run.stdout.lines().last(), Some("left:"), "{words}");
        run.fails(1, &["full", "space"]);
    }
}

/// Runs a command with a disk of 8 kB at `full`. The last line of standard output lists the disk's files, except
/// manifests and journals.
fn on_full_disk(folder: &Path, program: &Path, words: &str) -> std::io::Result<Output> {
    std::fs::create_dir_all(folder.join("full"))?;
    let script = "mount -t tmpfs -o size=8k none full || exit 77; \"$0\" \"$@\"; code=$?; \
                  echo left: $(ls -A full | grep -v ^abvh-run) | sed 's/ $//'; exit $code";
    let mut command = Command::new("unshare");
    command.args(["--user", "--map-root-user", "--mount", "sh", "-c", script]);
    command.arg(program).args(words.split_whitespace());
    command.current_dir(folder).output()
}

/// Number of key frames that are read during playback.
const KEYS: usize = 200;

fn write_key(sandbox: &Sandbox, key: usize) {
    let text = SQUARE.replace("v 0 0 0", &format!("v {} 0 0", key as f32 * 1e-3));
    sandbox.write(&format!("keys/{key}.obj"), text);
}

/// Checks a key frame that vanishes or shrinks. The blocked output keeps the program from reading all files before
/// that.
fn vanishes(sandbox: &Sandbox) {
    (0..KEYS).for_each(|key| write_key(sandbox, key));
    let words = "render keys --key-memory 0 --backend cpu --frames 0..200 --size 320x240 --quiet";
    for (i, says) in [(0, "no such file"), (1, "the file was changed")] {
        let says = format!("keys/199.obj: {says}");
        let all = format!("{words} --out out{i} --y4m -");
        let mut run = sandbox.spawn(&all, Stdio::piped);
        let reader = run.stdout.as_mut().unwrap();
        reader.read_exact(&mut [0; 1000]).unwrap();
        match i {
            0 => sandbox.remove("keys/199.obj"),
            _ => sandbox.write("keys/199.obj", "v 0 0"),
        }
        let mut output = run.wait_with_output().unwrap();
        output.stdout.clear();
        Run::of(&output, &all).fails(1, &[&says]);
        let done = pictures(sandbox, i);
        assert!((1..KEYS).contains(&done), "{done} pictures");
        write_key(sandbox, 199);
        sandbox.run_ok(&format!("{words} --out out{i} --resume"));
        assert_eq!(pictures(sandbox, i), KEYS);
    }
}

/// Returns the number of pictures, after checking that each is complete.
fn pictures(sandbox: &Sandbox, run: usize) -> usize {
    let all = sandbox.files().into_iter();
    let all = all.filter(|f| f.starts_with(format!("out{run}")));
    let whole = |f: &_| drop(image::open(sandbox.path().join(f)).unwrap());
    all.inspect(whole).count()
}
