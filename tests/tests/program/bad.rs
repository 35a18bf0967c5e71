//! Bad usage and bad input: exit 2, one clear line, nothing written.

use crate::devices::BACKENDS;
use crate::sandbox::{SQUARE, Sandbox, trial};
use integration::scenes::REAL;
use libtest_mimic::Trial;

/// A .npy file of `shape` that holds `data`.
pub(crate) fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let dict = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
    let mut file = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    file.extend(format!("{dict:<117}\n").bytes());
    file.extend(data);
    file
}

/// A mesh in binary: three vertices, and so many faces that begin with `body`.
fn ply(faces: usize, body: &[u8]) -> Vec<u8> {
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
         property float z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    );
    let xyz = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes);
    [header.as_bytes(), xyz.as_flattened(), body].concat()
}

/// A face that names `last` as its third vertex.
fn face(last: i32) -> Vec<u8> {
    let indices = [0, 1, last].map(i32::to_le_bytes);
    [&[3], indices.as_flattened()].concat()
}

/// A GLB that promises more than it holds.
fn glb() -> Vec<u8> {
    let words = [2, 12 + 8 + 4096, 4096_u32].map(u32::to_le_bytes);
    let json = br#"JSON{"asset":{"version":"2.0"}}     "#;
    [b"glTF", words.as_flattened(), json].concat()
}

/// All that [`CASES`] name.
fn inputs(sandbox: &Sandbox) {
    let three = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for (name, text) in [
        ("a.obj", SQUARE),
        ("mixed/a.obj", SQUARE),
        ("notes/notes.txt", "hello"),
        ("a.stl", "solid"),
        ("cut-face.obj", &SQUARE[..SQUARE.len() - 5]),
        ("cut-vertex.obj", "v 0 0 0\nv 1 0"),
        ("number.obj", "v 0 0 zero\n"),
        ("beyond.obj", &format!("{three}f 1 2 4\n")),
        ("zero.obj", &format!("{three}f 0 1 2\n")),
        ("before.obj", &format!("{three}f -1 -2 -4\n")),
        ("points.obj", three),
        ("vertices/1.obj", SQUARE),
        ("vertices/2.obj", &format!("v 5 5 5\n{SQUARE}")),
        ("fewer/1.obj", SQUARE),
        ("fewer/2.obj", &SQUARE[..SQUARE.len() - 8]),
        ("others/1.obj", SQUARE),
        ("others/2.obj", &SQUARE.replace("f 1 3 4", "f 2 3 4")),
        ("text.npy", "0 0 0 1 1 1"),
        ("empty.glb", ""),
    ] {
        sandbox.write(name, text);
    }
    for (name, bytes) in [
        ("mixed/a.ply", ply(1, &face(2))),
        ("cut.ply", ply(1, &face(2)[..4])),
        ("beyond.ply", ply(1, &face(3))),
        ("negative.ply", ply(1, &face(-1))),
        ("points.ply", ply(0, &[])),
        ("cut.glb", glb()),
        ("five.npy", npy("<f4", "(2, 5)", &[0; 40])),
        ("row.npy", npy("<f4", "(12,)", &[0; 48])),
        ("double.npy", npy("<f8", "(2, 6)", &[0; 96])),
        ("integers.npy", npy("<i4", "(2, 6)", &[0; 48])),
        ("short.npy", npy("<f4", "(2, 6)", &[0; 40])),
    ] {
        sandbox.write(name, bytes);
    }
    std::fs::create_dir(sandbox.path().join("empty")).unwrap();
}

/// Words after `abvh`, and what must be said.
const CASES: &str = "
render nowhere | nowhere
render nowhere.obj | nowhere.obj
render empty | empty
render notes | notes | .obj
render x*.obj | x*.obj
render mixed | .obj | .ply
render a.stl | a.stl
render cut-face.obj | cut-face.obj | 6
render cut-vertex.obj | cut-vertex.obj | 2
render number.obj | number.obj | 1
render beyond.obj | beyond.obj | 4
render zero.obj | zero.obj | 4 | 0
render before.obj | before.obj | 4
render points.obj | points.obj | triangle
render cut.ply | cut.ply
render beyond.ply | beyond.ply | 3
render negative.ply | negative.ply | negative
render points.ply | points.ply | triangle
render cut.glb | cut.glb
render empty.glb | empty.glb
render vertices | 2.obj | 4 | 5
render fewer | 2.obj | 1 | 2
render others | 2.obj
render demo:nothing | nothing | grove
render demo:twist:0 | 0
render demo:twist:some | some
render demo:twist:100 --frames 0 | --frames | 0
render demo:twist:100 --frames 5..2 | --frames | 5..2
render demo:twist:100 --frames 0..5000 | 5000
render demo:twist:100 --size 0x5 | --size | 0x5
render demo:twist:100 --size 100000x100000 | 100000x100000 | 16384
render demo:twist:100 --size 100 | --size | 100
render demo:twist:100 --eye nan,0,0 | --eye | nan
render demo:twist:100 --eye 1,2,3 --look-at 1,2,3 | eye
render demo:twist:100 --fov 180 | --fov | 180
render demo:twist:100 --threads 0 | --threads | 0
render demo:twist:100 --colour red | --colour
render demo:twist:100 --update often | often
render demo:twist:100 --update refit --lockstep 1 | lockstep
render demo:twist:100 --time-range 3..1 | --time-range | 3..1
trace demo:twist:100 --time nan --rays rays.npy --out h.npz | --time | nan
render demo:twist:100 --clip Walk | demo:twist:100 | Walk | .gltf
render a.obj --clip 0 | a.obj | clip | .glb
render demo:twist:100 --frames 1 --size 8x8 --out a.obj/pictures | a.obj/pictures
render demo:twist:100 --frames 1 --size 8x8 --no-images --stats a.obj/stats.json | a.obj/stats.json
trace a.obj --time 0 --out hits.npz --rays rays.npy | rays.npy
trace a.obj --time 0 --out hits.npz --rays five.npy | five.npy | 5 | 6
trace a.obj --time 0 --out hits.npz --rays row.npy | row.npy | 12 | 6
trace a.obj --time 0 --out hits.npz --rays double.npy | double.npy | f8 | 32
trace a.obj --time 0 --out hits.npz --rays integers.npy | integers.npy | i4
trace a.obj --time 0 --out hits.npz --rays short.npy | short.npy
trace a.obj --time 0 --out hits.npz --rays text.npy | text.npy
";

/// Likewise, of which no backend may be named besides. Terminals obey some characters: those are spelt out.
const OTHERS: &str = "
paint demo:twist | paint
bench demo:twist:500 --backend vulkan-rt --update rebuild --layout fast | nothing is left to measure | vulkan-rt | fast
render demo:twist:100 --backend vulkan --adapter none | vulkan
render --size \u{1b}[31m8x | '\\u{1b}[31m8x'
render --backend x\u{202e}y | 'x\\u{202e}y'
render a\u{202e}jbo.\u{200b} | a\\u{202e}jbo.\\u{200b}
render --\u{1b}[2J | '--\\u{1b}[2J'
";

pub(crate) fn trials() -> Vec<Trial> {
    let robot = REAL.into_iter().filter(|scene| scene.name == "robot");
    let clip = robot.map(|scene| {
        scene.trial("an_unknown_clip_is_answered_by_those_there_are", |scene| {
            let words = format!("render {} --clip gallop", scene.path());
            Sandbox::new().refuses(&words, &["gallop", "Dance", "Idle"]);
        })
    });
    let beside = BACKENDS.into_iter().map(|on| {
        let option = format!(" --backend {}", on.name);
        on.trial("bad::input_is_refused", move |s, _| {
            refused(s, CASES, &option)
        })
    });
    let auto = trial("bad::input_is_refused", |s| {
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
        sandbox.refuses(&format!("{words}{options}"), &says);
        assert!(
            before == sandbox.files(),
            "{words} left {:?}",
            sandbox.files()
        );
    }
}
