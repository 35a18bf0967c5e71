//! Tests that run only on Linux: file names of arbitrary bytes, and limits on memory and file size.

use crate::bad::npy;
use crate::sandbox::{Run, SQUARE, Sandbox, trial};
use integration::is_full;
use libtest_mimic::Trial;
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("files::accepts_non_utf8_file_names", any_bytes),
        trial("files::meshes_beyond_memory_are_refused", beyond_memory),
        trial("files::exceeding_file_size_limit_fails", too_large),
    ]
}

/// Tests a file name that is not UTF-8, alone, and joined to another scene with a placement.
fn any_bytes(sandbox: &Sandbox) {
    let name = OsStr::from_bytes(b"a\xff.obj");
    std::fs::write(sandbox.path().join(name), SQUARE).unwrap();
    sandbox.write("b.obj", SQUARE);
    let run = |words: &str, scene: &[u8]| {
        let words = words.split(' ').map(OsStr::new);
        let words = words.chain([OsStr::from_bytes(scene)]);
        let output = integration::program::run_where(sandbox.path(), words, &[]);
        Run::of(&output, "a name that is not UTF-8")
    };
    let render = "render --backend cpu --size 8x8 --frames 1 --quiet --overwrite";
    for (scene, says) in [
        (&b"a\xff.obj"[..], "2 triangles"),
        (b"b.obj+a\xff.obj@0,0,1*2", "4 triangles"),
    ] {
        let stdout = run(render, scene).succeeds().stdout;
        assert!(stdout.contains(says), "{stdout}");
    }
    run("inspect", b"a\xfe.obj").fails(2, &["no such file"]);
}

fn too_large(sandbox: &Sandbox) {
    let words = format!("render demo:twist:100 --size 64x48 --frames 1 --quiet {CPU}");
    let run = sandbox.run_within("-f 8", &format!("{words} --no-images --hits h"));
    run.fails(1, &["h/hits_0000.npz: File too large"]);
    assert!(sandbox.files().is_empty(), "{:?}", sandbox.files());
}

/// Options for a single thread of each kind.
const CPU: &str = "--backend cpu --threads 1 --builder-threads 1";

/// Checks that small files of large meshes are refused with a message that states the needed and the available memory.
fn beyond_memory(sandbox: &Sandbox) {
    let ply = |faces: &str, list: &str, body: &str| {
        let point = "property float x\nproperty float y\nproperty float z";
        let head = format!("ply\nformat ascii 1.0\nelement vertex 3\n{point}\nelement face");
        let corners = "0 0 0\n1 0 0\n0 1 0\n";
        format!("{head} {faces}\nproperty list {list}\nend_header\n{corners}{body}")
    };
    let face = "f 1 2 3\n".repeat(1_500_000);
    sandbox.write("a.obj", format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{face}"));
    let faces = "3 0 1 2\n".repeat(1_500_000);
    sandbox.write("a.ply", ply("1500000", "uchar int vertex_indices", &faces));
    let render = format!("--size 8x8 --frames 1 --quiet {CPU}");
    let says = ["are needed", "are free (address space"];
    for scene in ["a.obj", "a.ply"] {
        // Under the lowest limit reading fails, under the higher ones tree construction.
        let between = is_full().then_some(250_000);
        for kilobytes in [150_000, 400_000].into_iter().chain(between) {
            let limit = format!("-v {kilobytes}");
            let run = sandbox.run_within(&limit, &format!("render {scene} {render}"));
            run.fails(2, &says);
        }
    }
    // One face with many corners, and then many rays.
    let face = "3000000".to_owned() + &" 0 1 2".repeat(1_000_000);
    sandbox.write("p.ply", ply("1", "int int vertex_indices", &face));
    let run = sandbox.run_within("-v 110000", &format!("render p.ply {render}"));
    run.fails(
        2,
        &["p.ply: line 13: bad 'face' 0: 144.0 MB of memory are needed"],
    );
    sandbox.write("s.obj", SQUARE);
    let ray = [0.25_f32, 0.25, 5.0, 0.0, 0.0, -1.0].map(f32::to_le_bytes);
    let rays = ray.concat().repeat(2_000_000);
    sandbox.write("r.npy", npy("<f4", "(2000000, 6)", &rays));
    let words = format!("trace s.obj --time 0 {CPU} --rays r.npy --out h.npz");
    // Searches for a limit that suffices to read the rays but not to trace them.
    let trees = "1 key frame of 4 vertices, and trees over 2 triangles: ";
    for kilobytes in (150_000..600_000).step_by(30_000) {
        let run = sandbox.run_within(&format!("-v {kilobytes}"), &words);
        if run.stderr.contains(trees) {
            return run.fails(2, &says);
        }
        run.fails(2, &[]);
    }
    panic!("all limits are too low");
}
