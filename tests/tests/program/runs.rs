//! Runs that are resumed, divided among shards, and that must not eat each other's files.

use crate::sandbox::{SQUARE, Sandbox, ensure, trial};
use libtest_mimic::{Failed, Trial};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("runs::two_ranges_fill_one_folder", ranges),
        trial("runs::another_run_is_named_and_kept", another),
        trial("runs::damaged_files_are_made_again", damaged),
        trial("runs::nothing_is_loaded_when_nothing_is_left", finished),
        trial("runs::statistics_stay_complete", statistics),
        trial("runs::shards_merge_to_the_whole", shards),
        trial("runs::a_shard_without_frames_loads_nothing", empty_shard),
        trial("runs::shards_of_statistics_alone_merge", stats_alone),
        trial("runs::nothing_outside_a_folder_is_touched", tampered),
        trial("runs::outputs_never_eat_inputs_or_each_other", eaten),
        trial("runs::foreseen_failures_leave_no_folder", foreseen),
        trial("runs::statistics_go_to_standard_output", to_stdout),
    ]
}

const SMALL: &str = "render demo:collide:300 --backend cpu --size 32x24 --quiet";

/// The pictures and hits of a folder, by name.
pub(crate) fn bytes(sandbox: &Sandbox, folder: &str) -> BTreeMap<PathBuf, Vec<u8>> {
    let files = sandbox.files().into_iter();
    let files = files.filter(|f| f.starts_with(folder));
    let named = |f: PathBuf| {
        let name = f.file_name().map(PathBuf::from).unwrap_or_default();
        (name, sandbox.read(&f.to_string_lossy()))
    };
    files.map(named).collect()
}

fn stats(sandbox: &Sandbox, file: &str) -> Result<Vec<u64>, Failed> {
    let stats: Value = serde_json::from_slice(&sandbox.read(file))?;
    let frames = stats["frames"].as_array().ok_or("no frames")?;
    Ok(frames.iter().filter_map(|f| f["frame"].as_u64()).collect())
}

fn ranges(sandbox: &Sandbox) -> Result<(), Failed> {
    sandbox
        .run(&format!("{SMALL} --frames 0..5 --out all"))
        .succeeds()?;
    sandbox
        .run(&format!("{SMALL} --frames 0..2 --out o"))
        .succeeds()?;
    sandbox
        .run(&format!("{SMALL} --frames 2,3-4 --out o"))
        .succeeds()?;
    // Both ranges are known, whichever came last.
    sandbox.run("merge o --stats s.json").succeeds()?;
    let frames = stats(sandbox, "s.json")?;
    ensure(frames == [0, 1, 2, 3, 4], || format!("{frames:?}"))?;
    sandbox
        .run("merge o --stats o/frame_0001.png")
        .fails(2, &["would overwrite"])?;
    ensure(bytes(sandbox, "all") == bytes(sandbox, "o"), || {
        format!("{:?}", sandbox.files())
    })
}

fn another(sandbox: &Sandbox) -> Result<(), Failed> {
    sandbox
        .run(&format!("{SMALL} --frames 3 --out o"))
        .succeeds()?;
    let kept = bytes(sandbox, "o");
    let others = [
        ("--frames 3 --eye 9,9,9", "eye"),
        ("--frames 4", "frames"),
        ("--frames 3 --intersector exact", "intersector"),
        ("--frames 3 --light 1,2,3", "light"),
    ];
    for (words, says) in others {
        for resume in ["", "--resume"] {
            let words = format!("{SMALL} {words} {resume} --out o");
            sandbox
                .run(&words)
                .fails(2, &["holds another run", says, "--overwrite"])?;
        }
    }
    let scene = SMALL.replace("collide", "twist");
    sandbox
        .run(&format!("{scene} --frames 3 --out o --resume"))
        .fails(2, &["scene"])?;
    ensure(bytes(sandbox, "o") == kept, || {
        "the run that was there has changed".into()
    })?;
    // Who renders, and how trees follow, decides no byte.
    sandbox
        .run(&format!(
            "{SMALL} --frames 3 --out o --update rebuild --layout bvh2 --threads 1"
        ))
        .succeeds()?;
    ensure(bytes(sandbox, "o") == kept, || {
        "another policy made other bytes".into()
    })?;
    sandbox
        .run(&format!(
            "{SMALL} --frames 2 --eye 9,9,9 --out o --overwrite"
        ))
        .succeeds()?;
    ensure(bytes(sandbox, "o").len() == 2, || {
        format!("{:?}", sandbox.files())
    })
}

fn damaged(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = format!("{SMALL} --frames 4 --out o --hits h");
    sandbox.run(&words).succeeds()?;
    let whole = [bytes(sandbox, "o"), bytes(sandbox, "h")];
    sandbox.write("o/frame_0000.png", "");
    sandbox.write("o/frame_0001.png", sandbox.read("o/frame_0002.png"));
    let mut flipped = sandbox.read("h/hits_0003.npz");
    let last = flipped.len() - 30;
    flipped[last] ^= 1;
    sandbox.write("h/hits_0003.npz", flipped);
    sandbox.run(&format!("{words} --resume")).succeeds()?;
    ensure([bytes(sandbox, "o"), bytes(sandbox, "h")] == whole, || {
        "damage stayed".into()
    })
}

fn finished(sandbox: &Sandbox) -> Result<(), Failed> {
    sandbox.write("in/1.obj", SQUARE);
    let words = "render in --backend cpu --size 32x24 --frames 1 --out o";
    sandbox.run(words).succeeds()?;
    let run = sandbox.run(&format!("{words} --resume")).succeeds()?;
    ensure(run.stdout.contains("nothing is left"), || {
        run.stdout.clone()
    })?;
    // A device that cannot be had is not asked for.
    let elsewhere = words.replace("--backend cpu", "--backend vulkan --adapter none");
    sandbox.run(&format!("{elsewhere} --resume")).succeeds()?;
    // What never ends is not read to be compared with what there was.
    #[cfg(unix)]
    sandbox
        .run("render /dev/zero --frames 1 --out o")
        .fails(2, &["/dev/zero", "a device is not a regular file"])?;
    sandbox.write("in/1.obj", SQUARE.replace("v 1 1 0", "v 1 2 0"));
    sandbox
        .run(&format!("{words} --resume"))
        .fails(2, &["1.obj"])
}

fn statistics(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = format!("{SMALL} --frames 5 --out o --stats s.json");
    sandbox.run(&words).succeeds()?;
    std::fs::remove_file(sandbox.path().join("o/frame_0002.png"))?;
    for _ in 0..2 {
        sandbox.run(&format!("{words} --resume")).succeeds()?;
        let frames = stats(sandbox, "s.json")?;
        ensure(frames == [0, 1, 2, 3, 4], || format!("{frames:?}"))?;
    }
    Ok(())
}

fn shards(sandbox: &Sandbox) -> Result<(), Failed> {
    sandbox
        .run(&format!("{SMALL} --frames 7 --out all"))
        .succeeds()?;
    for i in [1, 3] {
        sandbox
            .run(&format!("{SMALL} --frames 7 --shard {i}/3 --out o"))
            .succeeds()?;
    }
    sandbox.run("merge o").fails(1, &["2 of 7", "2, 3"])?;
    sandbox
        .run(&format!("{SMALL} --frames 7 --shard 2/3 --out p"))
        .succeeds()?;
    sandbox.run("merge o p --stats s.json").succeeds()?;
    let frames = stats(sandbox, "s.json")?;
    ensure(frames == [0, 1, 2, 3, 4, 5, 6], || format!("{frames:?}"))?;
    let mut joined = bytes(sandbox, "o");
    joined.extend(bytes(sandbox, "p"));
    ensure(joined == bytes(sandbox, "all"), || {
        format!("{:?}", sandbox.files())
    })?;
    sandbox
        .run(&format!("{SMALL} --frames 7 --eye 9,9,9 --out q"))
        .succeeds()?;
    sandbox.run("merge o q").fails(2, &["eye"])?;
    sandbox.run("merge nowhere").fails(2, &["no manifest"])?;
    sandbox
        .run(&format!("{SMALL} --frames 2 --shard 3/2 --out few"))
        .fails(2, &["shard"])
}

/// A scene that cannot be read, and a device that cannot be had, are no matter.
fn empty_shard(sandbox: &Sandbox) -> Result<(), Failed> {
    sandbox.write("in/1.obj", SQUARE);
    sandbox.write("in/2.obj", SQUARE);
    let words = "render in --size 32x24 --frames 2 --quiet";
    let shard = |i: usize, out: &str| {
        sandbox.run(&format!("{words} --backend cpu --shard {i}/5 --out {out}"))
    };
    let empty = |i: usize, out: &str| {
        let absent = "--backend vulkan --adapter none";
        let run = sandbox.run(&format!("{words} {absent} --shard {i}/5 --out {out}"));
        let run = run.succeeds()?;
        let is_told = run.stdout == "this shard has no frames: there are more shards than frames\n";
        ensure(is_told && run.stderr.is_empty(), || {
            format!("{}{}", run.stdout, run.stderr)
        })
    };
    sandbox.write("in/2.obj", "no mesh");
    empty(1, "first")?;
    empty(4, "last")?;
    sandbox.write("in/2.obj", SQUARE);
    empty(1, "o")?;
    empty(1, "apart")?;
    sandbox.run("merge o").fails(1, &["2 of 2", "0, 1"])?;
    sandbox.run("merge o first").fails(2, &["2.obj"])?;
    shard(3, "o").succeeds()?;
    shard(5, "p").succeeds()?;
    // What the others found out stays.
    empty(2, "p")?;
    for folders in ["o apart p", "apart p o"] {
        let run = sandbox.run(&format!("merge {folders} --stats s.json"));
        run.succeeds()?;
        let all: Value = serde_json::from_slice(&sandbox.read("s.json"))?;
        ensure(all["scene"]["triangles"] == 2, || all.to_string())?;
        ensure(stats(sandbox, "s.json")? == [0, 1], || folders.into())?;
    }
    sandbox
        .run(&format!("{words} --fov 50 --shard 1/5 --out apart"))
        .fails(2, &["holds another run", "fov"])
}

fn stats_alone(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = format!("{SMALL} --no-images --frames 3");
    for i in 1..=4 {
        let file = format!("--shard {i}/4 --stats s{i}.json");
        sandbox.run(&format!("{words} {file}")).succeeds()?;
    }
    sandbox
        .run("merge s1.json s2.json s4.json --stats s.json")
        .fails(1, &["1 of 3", "missing or damaged: 1"])?;
    sandbox
        .run("merge s1.json s2.json s3.json s4.json --stats s1.json")
        .fails(2, &["would overwrite", "s1.json"])?;
    sandbox
        .run("merge s1.json s2.json s3.json s4.json --stats s.json")
        .succeeds()?;
    ensure(stats(sandbox, "s.json")? == [0, 1, 2], || "frames".into())?;
    // What was joined can be joined again, but not with another run.
    sandbox.run("merge s.json").succeeds()?;
    sandbox
        .run(&format!("{words} --eye 9,9,9 --stats other.json"))
        .succeeds()?;
    sandbox
        .run("merge s.json other.json")
        .fails(2, &["not of one run", "eye"])?;
    sandbox.write("no.json", "{}");
    sandbox.run("merge no.json").fails(2, &["no.json"])?;
    for i in 1..=2 {
        sandbox
            .run(&format!("{words} --shard {i}/2 --hits h"))
            .succeeds()?;
    }
    sandbox.run("merge h").succeeds()?;
    sandbox
        .run(&format!("{words} --hits h2 --stats beside.json"))
        .succeeds()?;
    sandbox.run("merge beside.json").fails(2, &["folders"])
}

fn tampered(sandbox: &Sandbox) -> Result<(), Failed> {
    sandbox.write("victim", "kept");
    sandbox
        .run(&format!("{SMALL} --frames 2 --out o --hits ./o"))
        .succeeds()?;
    let journal = String::from_utf8(sandbox.read("o/abvh-run.jsonl"))?;
    sandbox.write(
        "o/abvh-run.jsonl",
        journal.replace("frame_0000.png", "../victim"),
    );
    #[cfg(unix)]
    {
        std::fs::remove_file(sandbox.path().join("o/frame_0001.png"))?;
        std::os::unix::fs::symlink("../victim", sandbox.path().join("o/frame_0001.png"))?;
    }
    sandbox
        .run(&format!("{SMALL} --frames 3 --out o --overwrite"))
        .succeeds()?;
    ensure(sandbox.read("victim") == b"kept", || {
        "a file outside the folder was touched".into()
    })?;
    for i in 1..=2 {
        let words = format!("{SMALL} --frames 4 --shard {i}/2 --out p --overwrite");
        sandbox.run(&words).succeeds()?;
    }
    sandbox.run("merge p").succeeds()?;
    std::fs::remove_file(sandbox.path().join("o/abvh-run.jsonl"))?;
    sandbox.run("merge o").fails(1, &["no run has begun"])
}

fn eaten(sandbox: &Sandbox) -> Result<(), Failed> {
    sandbox.write("in.obj", SQUARE);
    std::fs::hard_link(
        sandbox.path().join("in.obj"),
        sandbox.path().join("link.json"),
    )?;
    let render = "render in.obj --backend cpu --size 32x24 --frames 1 --quiet --out o";
    for (words, says) in [
        ("--stats in.obj", "--stats"),
        ("--stats ./in.obj", "SCENE"),
        ("--timeline link.json", "--timeline"),
        ("--stats z --timeline z", "--timeline"),
        ("--stats z --rays-out ./z", "--rays-out"),
        ("--stats o/frame_0000.png", "--out"),
        ("--stats o/abvh-run.json", "--out"),
    ] {
        sandbox
            .run(&format!("{render} {words}"))
            .fails(2, &["would overwrite", says])?;
    }
    for option in ["--timeline", "--rays-out", "--hits", "--out"] {
        sandbox
            .run(&format!("{} {option} -", render.replace("--out o", "")))
            .fails(2, &[option, "only --stats"])?;
    }
    sandbox
        .run(&format!("{render} --rays-out r.npy"))
        .succeeds()?;
    let rays = sandbox.read("r.npy");
    let trace = "trace in.obj --time 0 --backend cpu --quiet";
    sandbox
        .run(&format!("{trace} --rays r.npy --out r.npy"))
        .fails(2, &["--rays"])?;
    sandbox
        .run(&format!("{trace} --rays r.npy --out in.obj"))
        .fails(2, &["SCENE"])?;
    let bench = "bench in.obj --backend cpu --size 32x24 --frames 1 --quiet";
    sandbox
        .run(&format!("{bench} --json in.obj"))
        .fails(2, &["SCENE"])?;
    ensure(
        sandbox.read("r.npy") == rays && sandbox.read("in.obj") == SQUARE.as_bytes(),
        || "an input was overwritten".into(),
    )
}

fn foreseen(sandbox: &Sandbox) -> Result<(), Failed> {
    sandbox.write("file", "in the way");
    for words in [
        "--out file --frames 1",
        "--out new/deep --frames 0..900",
        "--out new --stats no/such/s.json",
        "--out new --hits file/h",
        "--out new --adapter 99 --backend vulkan",
    ] {
        sandbox.run(&format!("{SMALL} {words}")).fails(2, &[])?;
    }
    #[cfg(target_os = "linux")]
    sandbox
        .run(&format!("{SMALL} --out new/deep --rays-out /dev/full"))
        .fails(1, &["/dev/full", "space"])?;
    let left = sandbox.all_files();
    let is_empty = !sandbox.path().join("new").exists();
    ensure(left == [PathBuf::from("file")] && is_empty, || {
        format!("{left:?}")
    })
}

fn to_stdout(sandbox: &Sandbox) -> Result<(), Failed> {
    let run = sandbox
        .run(&format!("{SMALL} --frames 2 --no-images --stats -"))
        .succeeds()?;
    let stats: Value = serde_json::from_str(&run.stdout)?;
    ensure(
        stats["frames"].as_array().is_some_and(|f| f.len() == 2),
        || run.stdout.clone(),
    )
}
