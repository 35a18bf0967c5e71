//! What is written, and what is said, when all goes well.

use crate::devices::{BACKENDS, HOST, Subject};
#[cfg(target_os = "linux")]
use crate::sandbox::{Run, SQUARE};
use crate::sandbox::{Sandbox, ensure, trial};
use libtest_mimic::{Failed, Trial};
use std::path::PathBuf;
use std::process::{Command, Stdio};

pub(crate) fn trials() -> Vec<Trial> {
    let memory = |on: Subject| {
        let name = format!("files::{}::memory_is_foreseen", on.name);
        on.trial(&name, move |sandbox| memory_is_foreseen(sandbox, on.name))
    };
    let memory = BACKENDS.into_iter().chain([HOST]).map(memory);
    let mut all: Vec<_> = memory.collect();
    all.extend([
        trial(
            "files::a_render_writes_its_frames_and_a_table",
            frames_and_table,
        ),
        trial(
            "files::frames_of_a_range_are_numbered_by_their_key_times",
            range,
        ),
        trial("files::quiet_is_silent_on_stderr", quiet),
        trial("files::resume_keeps_whole_frames_alone", resume),
        trial("files::the_same_run_writes_the_same_bytes", same_bytes),
        trial("files::names_may_be_any_bytes", any_bytes),
        trial("files::meshes_beyond_memory_are_refused", beyond_memory),
        trial("files::help_and_version_succeed", help),
        trial("files::info_and_inspect_speak_json", json),
        trial("files::a_reader_that_goes_away_is_no_crash", broken_pipe),
    ]);
    all
}

const SMALL: &str = "render demo:twist:500 --size 32x24";

fn frames_and_table(sandbox: &Sandbox) -> Result<(), Failed> {
    let run = sandbox.run(&format!("{SMALL} --frames 3")).succeeds()?;
    let expected: Vec<PathBuf> = (0..3)
        .map(|i| format!("abvh-out/frame_000{i}.png").into())
        .collect();
    ensure(sandbox.files() == expected, || {
        format!("{:?}", sandbox.files())
    })?;
    for path in expected {
        let picture = image::open(sandbox.path().join(&path))?;
        ensure((picture.width(), picture.height()) == (32, 24), || {
            format!("{path:?}")
        })?;
    }
    let stages = [
        "interpolate",
        "preprocess",
        "refit",
        "trace",
        "median",
        "p95",
    ];
    let missing: Vec<_> = stages
        .iter()
        .filter(|&&s| !run.stdout.contains(s))
        .collect();
    ensure(missing.is_empty(), || {
        format!("no {missing:?} in the table:\n{}", run.stdout)
    })
}

fn range(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = format!("{SMALL} --frames 2..4 --out here --stats s.json --quiet");
    sandbox.run(&words).succeeds()?;
    let files = ["here/frame_0002.png", "here/frame_0003.png", "s.json"].map(PathBuf::from);
    ensure(sandbox.files() == files, || {
        format!("{:?}", sandbox.files())
    })?;
    let stats: serde_json::Value = serde_json::from_slice(&sandbox.read("s.json"))?;
    let times: Vec<_> = (0..2)
        .map(|i| stats["frames"][i]["time"].as_f64())
        .collect();
    ensure(times == [Some(2.0), Some(3.0)], || format!("{times:?}"))
}

fn quiet(sandbox: &Sandbox) -> Result<(), Failed> {
    let run = sandbox
        .run(&format!("{SMALL} --frames 2 --quiet"))
        .succeeds()?;
    ensure(run.stderr.is_empty(), || run.stderr)
}

fn resume(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = format!("{SMALL} --frames 3 --out out --hits out --quiet");
    sandbox.run(&words).succeeds()?;
    let whole = sandbox.read("out/frame_0002.png");
    let first = std::fs::metadata(sandbox.path().join("out/frame_0001.png"))?.modified()?;
    std::fs::remove_file(sandbox.path().join("out/hits_0002.npz"))?;
    sandbox.write("out/frame_0002.png", "made again");
    sandbox.run(&format!("{words} --resume")).succeeds()?;
    let again = std::fs::metadata(sandbox.path().join("out/frame_0001.png"))?.modified()?;
    ensure(again == first, || "a whole frame was made again".into())?;
    ensure(sandbox.read("out/frame_0002.png") == whole, || {
        "half a frame was not made again".into()
    })?;
    ensure(sandbox.files().len() == 6, || {
        format!("{:?}", sandbox.files())
    })
}

fn same_bytes(sandbox: &Sandbox) -> Result<(), Failed> {
    for out in ["a", "b"] {
        let words =
            format!("{SMALL} --frames 2 --out {out} --hits {out} --rays-out {out}.npy --quiet");
        sandbox.run(&words).succeeds()?;
    }
    for name in ["/frame_0001.png", "/hits_0001.npz", ".npy"] {
        let [a, b] = ["a", "b"].map(|out| sandbox.read(&format!("{out}{name}")));
        ensure(a == b, || format!("{name} differs"))?;
    }
    Ok(())
}

/// Alone, joined and placed.
#[cfg(target_os = "linux")]
fn any_bytes(sandbox: &Sandbox) -> Result<(), Failed> {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let name = OsStr::from_bytes(b"a\xff.obj");
    std::fs::write(sandbox.path().join(name), SQUARE)?;
    sandbox.write("b.obj", SQUARE);
    let joined = OsStr::from_bytes(b"b.obj+a\xff.obj@0,0,1*2");
    for (scene, says) in [(name, "2 triangles"), (joined, "4 triangles")] {
        let words = "render --backend cpu --size 8x8 --frames 1 --quiet --overwrite";
        let words = words.split(' ').map(OsStr::new).chain([scene]);
        let output = integration::program::run(sandbox.path(), words);
        let run = Run::of(&output, "render, a name that is not UTF-8").succeeds()?;
        ensure(run.stdout.contains(says), || run.stdout.clone())?;
    }
    let absent = OsStr::from_bytes(b"a\xfe.obj");
    let output = integration::program::run(sandbox.path(), [OsStr::new("inspect"), absent]);
    Run::of(&output, "inspect, likewise").fails(2, &["no such file"])
}

/// Elsewhere names are text.
#[cfg(not(target_os = "linux"))]
fn any_bytes(_: &Sandbox) -> Result<(), Failed> {
    Ok(())
}

/// Little text makes much mesh: both numbers are named, and nothing breaks down over it.
#[cfg(target_os = "linux")]
fn beyond_memory(sandbox: &Sandbox) -> Result<(), Failed> {
    let head = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    let ply = format!(
        "ply\nformat ascii 1.0\n{head}element face 1500000\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n"
    );
    sandbox.write(
        "a.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned() + &"f 1 2 3\n".repeat(1_500_000),
    );
    sandbox.write("a.ply", ply + &"3 0 1 2\n".repeat(1_500_000));
    for scene in ["a.obj", "a.ply"] {
        let words = format!(
            "render {scene} --backend cpu --size 8x8 --frames 1 --threads 1 --builder-threads 1 --quiet"
        );
        // So little that reading breaks down over it, and trees beyond.
        for kilobytes in [150_000, 250_000, 400_000] {
            let run = limited(sandbox, kilobytes, &words)?;
            run.fails(2, &["are needed", "are free (address space"])?;
        }
    }
    // One face of many corners, and many rays.
    let polygon = "ply\nformat ascii 1.0\n".to_owned() + head;
    let face =
        "element face 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n";
    sandbox.write(
        "p.ply",
        polygon + face + "3000000" + &" 0 1 2".repeat(1_000_000),
    );
    let words =
        "render p.ply --backend cpu --size 8x8 --frames 1 --threads 1 --builder-threads 1 --quiet";
    limited(sandbox, 110_000, words)?
        .fails(2, &["reading 3 vertices and 1 faces", "are needed"])?;
    sandbox.write("s.obj", SQUARE);
    rays(sandbox, 2_000_000)?;
    let words = "trace s.obj --time 0 --backend cpu --threads 1 --builder-threads 1 --rays r.npy --out h.npz";
    // Least and greatest limit under which rays can be read, and not be traced.
    let says = "1 key frame of 4 vertices, and trees over 2 triangles: ";
    for kilobytes in (150_000..600_000).step_by(30_000) {
        let run = limited(sandbox, kilobytes, words)?;
        if run.stderr.contains(says) {
            return run.fails(2, &["are needed", "are free (address space"]);
        }
        let stderr = run.stderr.clone();
        run.fails(2, &[])
            .map_err(|_| format!("under {kilobytes} KiB: {stderr}"))?;
    }
    Err("all limits are too low".into())
}

/// A run that may have so much memory.
#[cfg(target_os = "linux")]
fn limited(sandbox: &Sandbox, kilobytes: u32, words: &str) -> Result<Run, Failed> {
    let limited = format!("ulimit -v {kilobytes}; exec \"$0\" \"$@\"");
    let output = Command::new("sh")
        .args(["-c", &limited])
        .arg(integration::program::abvh())
        .args(words.split(' '))
        .current_dir(sandbox.path())
        .output()?;
    Ok(Run::of(&output, words))
}

/// A file of rays, all of which are alike.
#[cfg(target_os = "linux")]
fn rays(sandbox: &Sandbox, count: u64) -> Result<(), Failed> {
    let dict = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({count}, 6), }}");
    let mut file = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    file.extend(format!("{dict:<117}\n").bytes());
    let ray = [0.25_f32, 0.25, 5.0, 0.0, 0.0, -1.0].map(f32::to_le_bytes);
    file.extend(ray.concat().repeat(usize::try_from(count)?));
    sandbox.write("r.npy", file);
    Ok(())
}

/// Elsewhere nobody tells how much memory is left.
#[cfg(not(target_os = "linux"))]
fn beyond_memory(_: &Sandbox) -> Result<(), Failed> {
    Ok(())
}

/// What a run is expected to take is what it takes, or up to half as much again.
fn memory_is_foreseen(sandbox: &Sandbox, backend: &str) -> Result<(), Failed> {
    let words = format!("render demo:twist:100000 --backend {backend} --frames 3 --quiet");
    for how in [
        "--size 64x48 --layout bvh2 --update async",
        "--size 640x480 --layout fast --update rebuild",
    ] {
        sandbox
            .run(&format!("{words} {how} --no-images --stats s.json"))
            .succeeds()?;
        let stats: serde_json::Value = serde_json::from_slice(&sandbox.read("s.json"))?;
        // The host's memory holds a driver too, where there is one.
        let of = if backend == "cpu" {
            "host_bytes"
        } else {
            "device_bytes"
        };
        let bytes = |value: &serde_json::Value| value.as_u64().ok_or(format!("no {of}"));
        let expected = bytes(&stats["expected_memory"][of])?;
        let taken = bytes(&stats["summary"][of]["peak"])?;
        ensure((taken..=taken * 3 / 2).contains(&expected), || {
            format!("{backend} {how}: {expected} bytes expected, {taken} taken")
        })?;
    }
    Ok(())
}

fn help(sandbox: &Sandbox) -> Result<(), Failed> {
    for words in ["--help", "render --help", "trace --help"] {
        let run = sandbox.run(words).succeeds()?;
        ensure(
            run.stdout.contains("Usage") && run.stderr.is_empty(),
            || words.into(),
        )?;
    }
    // How wide a terminal is, is no matter to a pipe.
    let narrow = [("COLUMNS", std::ffi::OsStr::new("20"))];
    for words in ["render --help", "info"] {
        let texts = [sandbox.run(words), sandbox.run_where(words, &narrow)];
        ensure(texts[0].stdout == texts[1].stdout, || {
            texts[1].stdout.clone()
        })?;
    }
    let run = sandbox.run("--version").succeeds()?;
    ensure(run.stdout.starts_with("abvh "), || run.stdout)
}

fn json(sandbox: &Sandbox) -> Result<(), Failed> {
    for words in ["info --json", "inspect demo:collide:500 --json"] {
        let run = sandbox.run(words).succeeds()?;
        let value: serde_json::Value = serde_json::from_str(&run.stdout)?;
        ensure(value.is_object(), || run.stdout)?;
    }
    Ok(())
}

/// The pipe's reading end is closed before the program writes.
fn broken_pipe(sandbox: &Sandbox) -> Result<(), Failed> {
    for words in ["info", "--help", "inspect demo:twist:200"] {
        let mut child = Command::new(integration::program::abvh())
            .args(words.split(' '))
            .current_dir(sandbox.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()?;
        drop(child.stdout.take());
        let output = child.wait_with_output()?;
        let stderr = String::from_utf8_lossy(&output.stderr);
        ensure(!stderr.contains("panicked"), || {
            format!("abvh {words}: {stderr}")
        })?;
        ensure(output.status.code() != Some(101), || {
            format!("abvh {words}: {:?}", output.status)
        })?;
    }
    Ok(())
}
