//! Output of successful runs: pictures and a table, hits.

use crate::bad::npy;
use crate::devices::{BACKENDS, HOST, backend_trial};
use crate::sandbox::{Sandbox, assert_contains, trial};
use libtest_mimic::Trial;
use serde_json::json;
use std::ffi::OsStr;
use std::io::Cursor;
use std::path::PathBuf;
use std::process::Stdio;
use zip::ZipArchive;

pub(crate) fn trials() -> Vec<Trial> {
    let name = "files::memory_estimate_is_accurate";
    let memory = |on| backend_trial(name, on, memory_estimate_is_accurate);
    let backends = BACKENDS.into_iter().chain([HOST]).map(memory);
    let others = [
        trial("files::render_writes_frames_and_table", table),
        trial("files::help_and_version_succeed", help),
        trial("files::broken_pipe_does_not_crash", broken_pipe),
        trial("hits::trace_repeats_render", trace_repeats_render),
        trial("hits::recentred_hits_keep_file_coordinates", recentred),
    ];
    backends.chain(others).collect()
}

/// Checks names and messages. `images` checks size and pixels.
fn table(sandbox: &Sandbox) {
    let run = sandbox.run_ok("render demo:twist:500 --size 32x24 --frames 3");
    let expected = [0, 1, 2].map(|i| PathBuf::from(format!("abvh-out/frame_000{i}.png")));
    assert_eq!(sandbox.files(), expected);
    assert_contains(&run.stdout, "interpolate|preprocess|refit|trace|median|p95");
}

/// Checks that a run takes at least two thirds of the expected memory, and no more than expected.
fn memory_estimate_is_accurate(sandbox: &Sandbox, backend: &str) {
    let words = format!("render demo:twist:100000 --backend {backend} --frames 3 --quiet");
    // On the other backends, the host's memory includes the driver's.
    let of = match backend {
        "cpu" => "host_bytes",
        _ => "device_bytes",
    };
    for how in [
        // Without `--lockstep`, the estimate includes a finished tree that is refitted next to the current one until
        // costs are compared. A short run may not have it.
        "--size 64x48 --update async --lockstep 1",
        "--size 640x480 --update rebuild",
    ] {
        let (_, stats) = sandbox.run_json(&format!("{words} {how} --no-images"), "--stats");
        let expected = stats["expected_memory"][of].as_u64().unwrap();
        let taken = stats["summary"][of]["worst"].as_f64().unwrap() as u64;
        let foreseen = (taken..=taken * 3 / 2).contains(&expected);
        assert!(foreseen, "{how}: {expected} bytes expected, {taken} taken");
    }
}

fn help(sandbox: &Sandbox) {
    // The width of the terminal must not affect output to a pipe.
    let narrow = [("COLUMNS", OsStr::new("20"))];
    for words in ["--help", "render --help", "trace --help", "info"] {
        let run = sandbox.run_ok(words);
        let is_help = words == "info" || run.stdout.contains("Usage");
        assert!(is_help && run.stderr.is_empty(), "{words}");
        assert_eq!(sandbox.run_where(words, &narrow).stdout, run.stdout);
    }
    assert!(sandbox.run_ok("--version").stdout.starts_with("abvh "));
}

/// Closes the reading end of the pipe before the program writes.
fn broken_pipe(sandbox: &Sandbox) {
    for words in ["info", "--help", "inspect demo:twist:200"] {
        let mut child = sandbox.spawn(words, Stdio::piped);
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        let crashed = stderr.contains("panicked") || output.status.code() == Some(101);
        assert!(!crashed, "abvh {words}: {output:?}");
    }
}

/// Tests a slope of 0.1 across a unit square, at coordinates where single precision has steps of up to 0.5.
fn recentred(sandbox: &Sandbox) {
    let corner = |x: f64, y: f64| [691_608.0 + x, 5_334_760.2 + y, 520.0 + 0.1 * x];
    let corners = [
        corner(0.0, 0.0),
        corner(1.0, 0.0),
        corner(0.0, 1.0),
        corner(1.0, 1.0),
    ];
    let vertices = corners.map(|[x, y, z]| format!("v {x} {y} {z}\n")).concat();
    sandbox.write("a.obj", vertices + "f 1 2 3\nf 2 4 3\n");
    let rays = [(0.25, 0.25), (0.75, 0.625)]
        .map(|(x, y)| [691_608.0 + x, 5_334_760.2 + y, 600.0, 0.0, 0.0, -1.0_f64]);
    let bytes = rays
        .as_flattened()
        .iter()
        .flat_map(|x: &f64| x.to_le_bytes());
    sandbox.write(
        "rays.npy",
        npy("<f8", "(2, 6)", &bytes.collect::<Vec<u8>>()),
    );
    let trace = "trace a.obj --time 0 --backend cpu --intersector exact";
    let plain = sandbox.run_ok(&format!("{trace} --rays rays.npy --out plain.npz"));
    assert_contains(&plain.stderr, "a.obj: coordinates lose up to|--recentre");
    sandbox.run_ok(&format!("{trace} --recentre --rays rays.npy --out h.npz"));
    let (shape, offset) = array::<f64>(sandbox, "h.npz", "offset");
    assert_eq!(shape, [3]);
    let centre = [691_608.5, 5_334_760.7, 520.05];
    assert!(
        offset.iter().zip(centre).all(|(a, b)| (a - b).abs() < 1e-6),
        "{offset:?}"
    );
    assert_eq!(array::<u32>(sandbox, "h.npz", "triangle").1, [0, 1]);
    let expected = [79.975_f32, 79.925];
    let found = array::<f32>(sandbox, "h.npz", "t").1;
    assert!(
        found
            .iter()
            .zip(expected)
            .all(|(a, b)| (a - b).abs() < 1e-4),
        "{found:?}"
    );
    // A camera placed in the file's coordinates looks from above, and its rays are written in the file's coordinates.
    let view = "--eye 691608.5,5334760.7,522 --look-at 691608.5,5334760.7,520 --up 0,1,0 --light 691608,5334760,530";
    let frame = "--frames 1 --size 8x8 --no-images --backend cpu --intersector exact --quiet";
    let words = format!(
        "render a.obj --recentre {view} {frame} --hits r --rays-out out.npy --stats s.json"
    );
    sandbox.run_ok(&words);
    let words = format!("render a.obj --recentre {view} {frame}").replace(",522", ",520");
    sandbox.assert_refused(&words, &["the same point, [691608.5, 5334760.7, "]);
    let triangles = array::<u32>(sandbox, "r/hits_0000.npz", "triangle").1;
    assert!(
        triangles.contains(&0) && triangles.contains(&1),
        "{triangles:?}"
    );
    assert_eq!(array::<f64>(sandbox, "r/hits_0000.npz", "offset").1, offset);
    let stats = sandbox.json("s.json");
    assert_eq!(stats["scene"]["facts"]["offset"], json!(offset));
    sandbox.run_ok(&format!(
        "{trace} --recentre --rays out.npy --out again.npz"
    ));
    assert_eq!(array::<u32>(sandbox, "again.npz", "triangle").1, triangles);
}

/// Traces the rays that `render` writes, with a fresh tree and with one built at another time.
fn trace_repeats_render(sandbox: &Sandbox) {
    let scene = "demo:collide:2000";
    let frame = "--time-range 7.25..9 --frames 2 --size 40x30 --no-images --quiet";
    sandbox.run_ok(&format!(
        "render {scene} {frame} --hits . --rays-out rays.npy"
    ));
    let expected = bits(sandbox, "hits_0000.npz");
    let shape = array::<u8>(sandbox, "hits_0000.npz", "shadow").0;
    assert_eq!(shape, [30, 40]);
    let words = format!("trace {scene} --time 7.25 --rays rays.npy --out h.npz");
    for options in "|--update refit --tree-time 0|--update rebuild --threads 1".split('|') {
        sandbox.run_ok(&format!("{words} {options}"));
        assert!(bits(sandbox, "h.npz") == expected, "{options}");
    }
    sandbox.run_ok(&format!("{words} --any-hit"));
    let hit: Vec<u8> = array(sandbox, "h.npz", "hit").1;
    let met = expected[0].iter().map(|&i| u8::from(i != u32::MAX));
    assert!(met.eq(hit), "any-hit disagrees");
}

/// Returns `triangle`, and the bits of `t`, `u`, `v`.
fn bits(sandbox: &Sandbox, file: &str) -> [Vec<u32>; 4] {
    let [t, u, v] = ["t", "u", "v"].map(|name| {
        let floats = array::<f32>(sandbox, file, name).1.into_iter();
        floats.map(f32::to_bits).collect()
    });
    [array(sandbox, file, "triangle").1, t, u, v]
}

/// Returns shape and values of an array in a file.
pub(crate) fn array<T: npyz::Deserialize>(
    sandbox: &Sandbox,
    file: &str,
    name: &str,
) -> (Vec<u64>, Vec<T>) {
    let mut archive = ZipArchive::new(Cursor::new(sandbox.read(file))).unwrap();
    let array = archive.by_name(&format!("{name}.npy"));
    let array = array.unwrap_or_else(|e| panic!("{file}, {name}: {e}"));
    let array = npyz::NpyFile::new(array).unwrap();
    (array.shape().to_vec(), array.into_vec().unwrap())
}
