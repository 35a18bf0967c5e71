//! Invalid usage and input: exit code 2, one line, no output files.

use crate::devices::{BACKENDS, backend_trial};
use crate::sandbox::{SQUARE, Sandbox, trial};
use integration::is_full;
use integration::scenes::REAL;
use libtest_mimic::Trial;

/// Creates a .npy file of `shape` with contents `data`.
pub(crate) fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let dict = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
    let mut file = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    file.extend(format!("{dict:<117}\n").bytes());
    file.extend(data);
    file
}

/// Writes the files that [`CASES`] and [`OTHERS`] read. Some cases name a missing file, such as `rays.npy`.
fn inputs(sandbox: &Sandbox) {
    let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    for (name, text) in [
        ("a.obj", SQUARE),
        ("notes/notes.txt", "hello"),
        ("a.stl", "solid"),
        ("cut.obj", &SQUARE[..SQUARE.len() - 5]),
        ("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"),
        ("vertices/1.obj", SQUARE),
        ("vertices/2.obj", &format!("v 5 5 5\n{SQUARE}")),
        ("mixed/a.obj", SQUARE),
        ("mixed/a.ply", header),
        (
            "beyond.ply",
            &format!("{header}0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"),
        ),
        ("cut.glb", "glTF"),
        ("text.npy", "0 0 0 1 1 1"),
    ] {
        sandbox.write(name, text);
    }
    sandbox.write("half.npy", npy("<f2", "(2, 6)", &[0; 24]));
    std::fs::create_dir(sandbox.path().join("empty")).unwrap();
}

/// Arguments after `abvh`, and text that the message must contain.
const CASES: &str = "
render nowhere | nowhere
render empty | empty
render notes | notes | .obj
render x*.obj | x*.obj
render mixed | .obj | .ply
render a.stl | a.stl
render cut.obj | cut.obj | 6
render points.obj | points.obj | triangle
render beyond.ply | beyond.ply | 3
render cut.glb | cut.glb
render vertices | 2.obj | 4 | 5
render demo:nothing | nothing | grove
render demo:twist:100 --frames 5..2 | --frames | 5..2
render demo:twist:100 --frames 0..5000 | 5000
render demo:twist:100 --eye 1,2,3 --look-at 1,2,3 | eye
render demo:twist:100 --time-range 3..1 | --time-range | 3..1
trace demo:twist:100 --time nan --rays rays.npy --out h.npz | --time | nan
render demo:twist:100 --clip Walk | demo:twist:100 | Walk | .gltf
render a.obj --clip 0 | a.obj | clip | .glb
render demo:twist:100 --frames 1 --size 8x8 --out a.obj/pictures | a.obj/pictures
render demo:twist:100 --frames 1 --size 8x8 --no-images --stats a.obj/stats.json | a.obj/stats.json
trace a.obj --time 0 --out hits.npz --rays rays.npy | rays.npy
trace a.obj --time 0 --out hits.npz --rays half.npy | half.npy | f2 | 32
trace a.obj --time 0 --out hits.npz --rays text.npy | text.npy
";

/// Further cases, which run only as they are. [`CASES`] also run with `--backend NAME` appended. Control characters
/// must be escaped, because terminals obey them.
const OTHERS: &str = "
paint demo:twist | paint
bench demo:twist:500 --backend cpu --update device-rebuild --rival embree | nothing is left to measure | embree with device-rebuild
render demo:twist:100 --backend vulkan --adapter none | vulkan
render demo:twist:100 --frames 1 --size 8x8 --no-images --backend cpu --update device-rebuild | cpu does not support tree builds on the device
render demo:twist:100 --frames 1 --size 8x8 --no-images --adapter voodoo | backend has an adapter 'voodoo' | cpu 0: host
chart --backend cpu --quiet no/such/scene | no/such/scene
chart --backend cpu --quiet demo:twist:100 --out a.obj/below | a.obj
conform --backend cpu --quiet --adapter nowhere | cpu
conform --backend cpu --quiet --json no/such/file | no/such/file
stability --backend cpu --quiet --adapter nowhere | nowhere
stability --backend cpu --quiet --json no/such/file | no/such/file
stability --backend cpu --quiet --record no/such/file | no/such/file
inspect a.obj+ | a.obj+ | no name
inspect + | no name
render --size \u{1b}[31m8x | '\\u{1b}[31m8x'
render --backend x\u{202e}y | 'x\\u{202e}y'
render a\u{202e}jbo.\u{200b} | a\\u{202e}jbo.\\u{200b}
render --\u{1b}[2J | '--\\u{1b}[2J'
";

pub(crate) fn trials() -> Vec<Trial> {
    let robot = REAL.into_iter().filter(|scene| scene.name == "robot");
    let clip = robot.map(|scene| {
        scene.trial("unknown_clip_lists_valid_ones", |scene| {
            let words = format!("render {} --clip gallop", scene.path());
            Sandbox::new().assert_refused(&words, &["gallop", "Dance", "Idle"]);
        })
    });
    let name = "bad::invalid_input_is_refused";
    // The program handles all GPU backends alike.
    let gpus = BACKENDS
        .into_iter()
        .filter(|&on| on == "vulkan" || is_full());
    let beside = gpus.map(|on| {
        backend_trial(name, on, |s, on| {
            refused(s, CASES, &format!(" --backend {on}"));
        })
    });
    let auto = trial(name, |s| {
        refused(s, &[CASES, OTHERS].concat(), "");
    });
    clip.chain(beside).chain([auto]).collect()
}

fn refused(sandbox: &Sandbox, cases: &str, options: &str) {
    inputs(sandbox);
    let before = sandbox.files();
    for case in cases.lines().filter(|line| !line.is_empty()) {
        let (words, says) = case.split_once(" | ").unwrap();
        let says: Vec<&str> = says.split(" | ").collect();
        sandbox.assert_refused(&format!("{words}{options}"), &says);
        let after = sandbox.files();
        let folders = ["abvh-out", "abvh-chart"].map(|name| sandbox.path().join(name));
        let is_as_before = before == after && !folders.iter().any(|folder| folder.exists());
        assert!(is_as_before, "{words} left {after:?}");
    }
}
