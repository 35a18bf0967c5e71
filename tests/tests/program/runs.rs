//! Runs that are resumed or divided into shards, and that must not overwrite each other's files.

use crate::sandbox::{SQUARE, Sandbox, list, trial};
use libtest_mimic::Trial;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("runs::ranges_share_one_output_folder", ranges),
        trial("runs::different_run_is_refused", different_run),
        trial("runs::missing_manifest_is_refused", missing_manifest),
        trial("runs::overwriting_removes_all_listed_files", overwritten),
        trial("runs::locked_folder_protects_all_folders", locked),
        trial("runs::resume_repairs_only_damaged_files", damaged),
        trial("runs::finished_run_loads_nothing", finished),
        trial("runs::shards_merge_into_one_run", shards),
        trial("runs::empty_shard_is_merged", empty_shard),
        trial("runs::shards_without_pictures_merge", hits_alone),
        trial("runs::shard_without_hits_is_incomplete", other_kinds),
        trial("runs::files_outside_folder_are_untouched", tampered),
        #[cfg(unix)]
        trial("runs::named_pipes_are_replaced", pipes),
        #[cfg(unix)]
        trial("runs::redirected_output_is_kept", redirected),
        trial("runs::outputs_never_overwrite_inputs", overwritten_inputs),
        trial("runs::invalid_runs_create_no_folder", invalid_runs),
    ]
}

const SMALL: &str = "render demo:collide:300 --backend cpu --size 32x24 --quiet";

/// Returns the pictures and hits in a folder, by name.
pub(crate) fn bytes(sandbox: &Sandbox, folder: &str) -> BTreeMap<PathBuf, Vec<u8>> {
    let files = sandbox.files().into_iter();
    let files = files.filter(|f| f.starts_with(folder));
    let named = |f: PathBuf| {
        let name = f.file_name().map(PathBuf::from).unwrap_or_default();
        (name, sandbox.read(&f.to_string_lossy()))
    };
    files.map(named).collect()
}

/// Returns the frame numbers in a statistics file.
fn frames(stats: &Value) -> Vec<u64> {
    let all = list(&stats["frames"]).iter();
    all.filter_map(|f| f["frame"].as_u64()).collect()
}

fn ranges(sandbox: &Sandbox) {
    sandbox.run_ok(&format!("{SMALL} --frames 0..5 --out all"));
    sandbox.run_ok(&format!("{SMALL} --frames 0..2 --out o"));
    sandbox.run_ok(&format!("{SMALL} --frames 2,3-4 --out o"));
    // Both ranges are recorded.
    let (_, joined) = sandbox.run_json("merge o", "--stats");
    assert_eq!(frames(&joined), [0, 1, 2, 3, 4]);
    sandbox.assert_refused("merge o --stats o/frame_0001.png", &["would overwrite"]);
    let same = bytes(sandbox, "all") == bytes(sandbox, "o");
    assert!(same, "{:?}", sandbox.files());
}

fn different_run(sandbox: &Sandbox) {
    sandbox.run_ok(&format!("{SMALL} --frames 3 --out o"));
    let kept = bytes(sandbox, "o");
    for (words, says) in [
        ("--frames 3 --eye 9,9,9", "eye"),
        ("--frames 4", "frames"),
        ("--frames 3 --intersector exact", "intersector"),
        ("--frames 3 --light 1,2,3", "light"),
        ("--frames 3 --allow-outside", "allow-outside"),
    ] {
        for resume in ["", "--resume"] {
            let words = format!("{SMALL} {words} {resume} --out o");
            sandbox.assert_refused(&words, &["holds another run", says, "--overwrite"]);
        }
    }
    let scene = SMALL.replace("collide", "twist");
    sandbox.assert_refused(&format!("{scene} --frames 3 --out o --resume"), &["scene"]);
    assert!(bytes(sandbox, "o") == kept, "it has changed");
    // The output does not depend on the machine or on the update policy.
    let other = SMALL.replace("--backend cpu", "--backend cpu-ref");
    let words = "--frames 3 --out o --update rebuild --threads 1";
    sandbox.run_ok(&format!("{other} {words}"));
    assert!(bytes(sandbox, "o") == kept, "by policy");
    let words = "--frames 2 --eye 9,9,9 --out o --overwrite";
    sandbox.run_ok(&format!("{SMALL} {words}"));
    assert_eq!(bytes(sandbox, "o").len(), 2, "{:?}", sandbox.files());
}

/// Tests a journal without a manifest, first while another run has locked the journal, then without the lock.
fn missing_manifest(sandbox: &Sandbox) {
    let words = format!("{SMALL} --frames 2 --out o");
    let manifest = sandbox.path().join("o/abvh-run.json");
    sandbox.write("o/abvh-run.jsonl", "");
    let journal = std::fs::File::open(sandbox.path().join("o/abvh-run.jsonl")).unwrap();
    journal.lock().unwrap();
    sandbox.assert_refused(&words, &["another run is writing"]);
    assert!(!manifest.exists());
    drop(journal);
    sandbox.run_ok(&words);
    sandbox.remove("o/abvh-run.json");
    let words = format!("{words} --eye 9,9,9");
    let before = sandbox.all_files();
    for options in ["", "--resume", "--hits new --shard 1/2 --rays-out r.npy"] {
        let words = format!("{words} {options}");
        sandbox.assert_refused(&words, &["no manifest", "--overwrite"]);
        assert_eq!(sandbox.all_files(), before);
    }
    sandbox.run_ok(&format!("{words} --overwrite"));
}

/// Tests a frame whose last line in the journal lists fewer files than an earlier line.
fn overwritten(sandbox: &Sandbox) {
    let words = format!("{SMALL} --frames 1 --hits d");
    sandbox.run_ok(&format!("{words} --out d"));
    sandbox.run_ok(&format!("{words} --no-images"));
    sandbox.run_ok(&format!("{words} --no-images --eye 9,9,9 --overwrite"));
    assert_eq!(sandbox.files(), [PathBuf::from("d/hits_0000.npz")]);
}

/// Tests runs into two folders while another run is writing into the second one.
fn locked(sandbox: &Sandbox) {
    let words = format!("{SMALL} --frames 1 --hits h");
    sandbox.run_ok(&format!("{words} --out o"));
    let state = || (sandbox.all_files(), bytes(sandbox, "o"));
    let before = state();
    let journal = std::fs::File::open(sandbox.path().join("h/abvh-run.jsonl")).unwrap();
    journal.lock().unwrap();
    for options in ["--out o --eye 9,9,9 --overwrite", "--out new"] {
        let words = format!("{words} {options}");
        sandbox.assert_refused(&words, &["another run is writing"]);
        assert!(state() == before, "{:?}", sandbox.all_files());
    }
    assert!(!sandbox.path().join("new").exists());
}

fn damaged(sandbox: &Sandbox) {
    let words = format!("{SMALL} --frames 5 --out o --hits h --stats s.json");
    sandbox.run_ok(&words);
    let whole = [bytes(sandbox, "o"), bytes(sandbox, "h")];
    let written = |frame: usize| {
        let path = sandbox.path().join(format!("o/frame_000{frame}.png"));
        std::fs::metadata(path).unwrap().modified().unwrap()
    };
    let (first, last) = (written(3), written(4));
    sandbox.write("o/frame_0000.png", "");
    sandbox.write("o/frame_0001.png", sandbox.read("o/frame_0002.png"));
    sandbox.remove("o/frame_0002.png");
    let mut flipped = sandbox.read("h/hits_0003.npz");
    let end = flipped.len() - 30;
    flipped[end] ^= 1;
    sandbox.write("h/hits_0003.npz", flipped);
    // Simulates a process that was killed while writing the journal.
    let torn = sandbox.text("o/abvh-run.jsonl") + "{\"frame\":{\"fil";
    sandbox.write("o/abvh-run.jsonl", torn);
    for _ in 0..2 {
        sandbox.run_ok(&format!("{words} --resume"));
        let same = [bytes(sandbox, "o"), bytes(sandbox, "h")] == whole;
        assert!(same, "damage stayed");
        assert_eq!(frames(&sandbox.json("s.json")), [0, 1, 2, 3, 4]);
    }
    let again = [written(3) != first, written(4) != last];
    assert_eq!(again, [true, false], "only frame 3 is written again");
    sandbox.run_ok("merge o h");
    sandbox.remove("h/hits_0001.npz");
    sandbox.run("merge o h").fails(1, &["1 of 5", "damaged: 1"]);
}

fn finished(sandbox: &Sandbox) {
    sandbox.write("in/1.obj", SQUARE);
    let words = "render in --backend cpu --size 32x24 --frames 1 --out o";
    sandbox.run_ok(words);
    let run = sandbox.run_ok(&format!("{words} --resume"));
    assert!(run.stdout.contains("nothing is left"), "{}", run.stdout);
    // A run without frames left does not open its device.
    let elsewhere = words.replace("--backend cpu", "--backend vulkan --adapter none");
    sandbox.run_ok(&format!("{elsewhere} --resume"));
    // The frame rate of a video does not affect the run.
    sandbox.run_ok(&format!("{words} --resume --fps 30 --y4m a.y4m"));
    // The scene's folder may be renamed. A '+' in its name does not join scenes.
    sandbox.write("a+b/1.obj", SQUARE);
    sandbox.run_ok(&format!(
        "{} --resume",
        words.replace("render in", "render a+b")
    ));
    // A glob also matches the outputs, which are not read.
    let glob = "render in/* --backend cpu --size 32x24 --frames 1 --out in";
    for resume in ["", "--resume"] {
        sandbox.run_ok(&format!("{glob} {resume}"));
    }
    // An existing file may contain the rays of another run.
    sandbox.write("r.npy", "stale");
    sandbox.run_ok(&format!("{words} --resume --rays-out r.npy"));
    assert!(sandbox.read("r.npy").starts_with(b"\x93NUMPY"));
    // Endless files are refused before they are compared with the previous run's.
    if cfg!(unix) {
        let says = ["/dev/zero", "a device is not a regular file"];
        sandbox.assert_refused("render /dev/zero --frames 1 --out o", &says);
    }
    sandbox.write("in/1.obj", SQUARE.replace("v 1 1 0", "v 1 2 0"));
    sandbox.assert_refused(&format!("{words} --resume"), &["1.obj"]);
}

fn shards(sandbox: &Sandbox) {
    sandbox.run_ok(&format!("{SMALL} --frames 7 --out all"));
    for i in [1, 3] {
        sandbox.run_ok(&format!("{SMALL} --frames 7 --shard {i}/3 --out o"));
    }
    sandbox.run("merge o").fails(1, &["2 of 7", "2, 3"]);
    sandbox.run_ok(&format!("{SMALL} --frames 7 --shard 2/3 --out p"));
    let (_, joined) = sandbox.run_json("merge o p", "--stats");
    assert_eq!(frames(&joined), [0, 1, 2, 3, 4, 5, 6]);
    let mut joined = bytes(sandbox, "o");
    joined.extend(bytes(sandbox, "p"));
    assert!(joined == bytes(sandbox, "all"), "{:?}", sandbox.files());
    sandbox.run_ok(&format!("{SMALL} --frames 7 --eye 9,9,9 --out q"));
    sandbox.assert_refused("merge o q", &["eye"]);
    sandbox.assert_refused("merge nowhere", &["no such directory"]);
    let beyond = format!("{SMALL} --frames 2 --shard 3/2 --out few");
    sandbox.assert_refused(&beyond, &["shard"]);
}

fn empty_shard(sandbox: &Sandbox) {
    sandbox.write("in/1.obj", SQUARE);
    sandbox.write("in/2.obj", SQUARE);
    let shard = |i: usize, out: &str| {
        let words = "render in --size 32x24 --frames 2 --quiet --backend cpu";
        let run = sandbox.run_ok(&format!("{words} --shard {i}/5 --out {out}"));
        let is_told = run.stdout.contains("this shard has no frames");
        assert!(is_told == [1, 2, 4].contains(&i), "{}", run.stdout);
    };
    shard(1, "o");
    let resumed =
        "render in --size 32x24 --frames 2 --quiet --backend cpu --shard 1/5 --out o --resume";
    let (_, stats) = sandbox.run_json(resumed, "--stats");
    assert!(stats["scene"]["triangles"] == 2, "{stats}");
    shard(1, "apart");
    sandbox.run("merge o").fails(1, &["2 of 2", "0, 1"]);
    shard(3, "o");
    shard(5, "p");
    shard(2, "p");
    for folders in ["o apart p", "apart p o"] {
        let (_, all) = sandbox.run_json(&format!("merge {folders}"), "--stats");
        assert!(all["scene"]["triangles"] == 2, "{all}");
        assert_eq!(frames(&all), [0, 1], "{folders}");
    }
}

fn hits_alone(sandbox: &Sandbox) {
    let words = format!("{SMALL} --no-images --frames 3");
    for i in 1..=2 {
        sandbox.run_ok(&format!("{words} --shard {i}/2 --hits h"));
    }
    sandbox.run_ok("merge h");
    let printed = sandbox.run(&format!("{words} --stats -")).parsed();
    assert_eq!(frames(&printed), [0, 1, 2]);
    sandbox.run_ok(&format!("{words} --stats s.json"));
    sandbox.assert_refused("merge s.json", &["s.json"]);
}

fn other_kinds(sandbox: &Sandbox) {
    let words = format!("{SMALL} --frames 4 --out o");
    sandbox.run_ok(&format!("{words} --shard 1/2 --hits h"));
    sandbox.run_ok(&format!("{words} --shard 2/2"));
    sandbox.run_ok("merge o");
    sandbox.run("merge o h").fails(1, &["2 of 4", "2, 3"]);
    sandbox.run_ok(&format!("{words} --shard 2/2 --hits h"));
    sandbox.run_ok("merge o h");
    // A run that was killed after two frames, and continues without hits.
    let words = format!("{SMALL} --frames 4 --out p");
    sandbox.run_ok(&format!("{words} --hits p"));
    let journal = sandbox.text("p/abvh-run.jsonl");
    let begun: String = journal.split_inclusive('\n').take(3).collect();
    sandbox.write("p/abvh-run.jsonl", begun);
    for frame in [2, 3] {
        sandbox.remove(&format!("p/hits_000{frame}.npz"));
    }
    sandbox.run_ok(&format!("{words} --resume"));
    sandbox.run_ok("merge p");
}

fn tampered(sandbox: &Sandbox) {
    sandbox.write("victim", "kept");
    sandbox.run_ok(&format!("{SMALL} --frames 2 --out o --hits ./o"));
    let journal = sandbox.text("o/abvh-run.jsonl");
    let elsewhere = journal.replace("frame_0000.png", "../victim");
    sandbox.write("o/abvh-run.jsonl", elsewhere);
    #[cfg(unix)]
    {
        sandbox.remove("o/frame_0001.png");
        let link = sandbox.path().join("o/frame_0001.png");
        std::os::unix::fs::symlink("../victim", link).unwrap();
    }
    sandbox.run_ok(&format!("{SMALL} --frames 3 --out o --overwrite"));
    assert_eq!(sandbox.text("victim"), "kept");
    for i in 1..=2 {
        let shard = format!("--shard {i}/2 --out p --overwrite");
        sandbox.run_ok(&format!("{SMALL} --frames 4 {shard}"));
    }
    sandbox.run_ok("merge p");
    sandbox.remove("o/abvh-run.jsonl");
    sandbox.run("merge o").fails(1, &["no run has begun"]);
}

/// Checks that named pipes in the output folder are replaced. Opening one for writing would block until it has a
/// reader.
#[cfg(unix)]
fn pipes(sandbox: &Sandbox) {
    let all = ["o/frame_0000.png", "o/hits_0001.npz", "o/abvh-run.json"];
    sandbox.write("o/mine", "");
    let mut make = std::process::Command::new("mkfifo");
    let made = make.args(all).current_dir(sandbox.path()).status();
    assert!(made.unwrap().success());
    let words = format!("{SMALL} --frames 2 --out o --hits o");
    sandbox.assert_refused(&words, &["o/abvh-run.json", "pipe"]);
    sandbox.run_ok(&format!("{words} --overwrite"));
    for name in all {
        assert!(sandbox.path().join(name).is_file(), "{name}");
    }
}

/// Tests `/dev/stdout` when standard output is a file, which must keep its content and receive the results.
#[cfg(unix)]
fn redirected(sandbox: &Sandbox) {
    let program = integration::program::abvh();
    sandbox.write("log", "earlier\n");
    for (file, redirection, begins) in [("log", ">>", "earlier\n{"), ("new", ">", "{")] {
        let words = format!("{SMALL} --frames 1 --no-images --stats /dev/stdout");
        let script = format!("\"$0\" {words} {redirection} {file}");
        let mut shell = std::process::Command::new("sh");
        let shell = shell.args(["-c", &script]).arg(program);
        let ended = shell.current_dir(sandbox.path()).status();
        assert!(ended.unwrap().success());
        let text = sandbox.text(file);
        let is_whole = text.starts_with(begins) && text.contains("of 32x24");
        assert!(is_whole, "{text}");
    }
}

fn overwritten_inputs(sandbox: &Sandbox) {
    sandbox.write("in.obj", SQUARE);
    sandbox.write("frame_0000.png", "newmtl a\nKd 1 0 0\n");
    sandbox.write("coloured.obj", format!("mtllib frame_0000.png\n{SQUARE}"));
    sandbox.write("sub/frame_1.obj", SQUARE);
    #[cfg(unix)]
    std::os::unix::fs::symlink("in.obj", sandbox.path().join("soft")).unwrap();
    let render = "render in.obj --backend cpu --size 32x24 --frames 1 --quiet --out o";
    for (words, says) in [
        ("--stats in.obj", "--stats"),
        ("--stats ./in.obj", "SCENE"),
        ("--stats sub/../in.obj", "SCENE"),
        #[cfg(unix)]
        ("--stats soft", "SCENE"),
        ("--stats z --y4m z", "--y4m"),
        ("--stats z --rays-out sub/../z", "--rays-out"),
        ("--stats o/frame_0000.png", "--out"),
        ("--stats o/abvh-run.json", "--out"),
    ] {
        sandbox.assert_refused(&format!("{render} {words}"), &["would overwrite", says]);
    }
    let here = "render coloured.obj --backend cpu --frames 1 --out .";
    sandbox.assert_refused(here, &["may overwrite", "which is read"]);
    sandbox
        .run_ok("render sub/frame_1.obj --backend cpu --size 32x24 --frames 1 --quiet --out sub");
    let both = format!("{render} --stats - --y4m -");
    sandbox.assert_refused(&both, &["--stats", "--y4m", "standard output"]);
    // Output folders only claim file names of their own pattern, and one device file may receive several outputs.
    let beside = "--rays-out r.npy --stats ./o/stats.json --y4m frame_0000.y4m";
    sandbox.run_ok(&format!("{render} {beside}"));
    if cfg!(unix) {
        sandbox.run_ok(&format!("{render} --stats /dev/null --rays-out /dev/null"));
    }
    let rays = sandbox.read("r.npy");
    let trace = "trace in.obj --time 0 --backend cpu --quiet";
    sandbox.assert_refused(&format!("{trace} --rays r.npy --out r.npy"), &["--rays"]);
    sandbox.assert_refused(&format!("{trace} --rays r.npy --out in.obj"), &["SCENE"]);
    let bench = "bench in.obj --backend cpu --size 32x24 --frames 1 --quiet";
    sandbox.assert_refused(&format!("{bench} --json in.obj"), &["SCENE"]);
    let same = sandbox.read("r.npy") == rays && sandbox.text("in.obj") == SQUARE;
    assert!(same, "an input was overwritten");
}

fn invalid_runs(sandbox: &Sandbox) {
    sandbox.write("file", "in the way");
    for words in [
        "--out file --frames 1",
        "--out new/deep --frames 0..900",
        "--out new --stats no/such/s.json",
        "--out new --hits file/h",
    ] {
        sandbox.assert_refused(&format!("{SMALL} {words}"), &[]);
    }
    let elsewhere = SMALL.replace("--backend cpu", "--backend vulkan --adapter 99");
    for words in ["--out new", "--out new/deep --y4m new/deep/a.y4m"] {
        sandbox.assert_refused(&format!("{elsewhere} {words}"), &[]);
    }
    if cfg!(target_os = "linux") {
        let run = sandbox.run(&format!("{SMALL} --out new/deep --rays-out /dev/full"));
        run.fails(1, &["/dev/full", "space"]);
    }
    let left = sandbox.all_files();
    let is_empty = !sandbox.path().join("new").exists();
    assert!(left == [PathBuf::from("file")] && is_empty, "{left:?}");
}
