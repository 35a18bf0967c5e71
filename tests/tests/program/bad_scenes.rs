//! Scenes that must be refused.

use crate::bad::{Case, nothing};
use crate::sandbox::SQUARE;

/// `a.obj` of this text.
pub(crate) fn obj(text: &str) -> Vec<(&'static str, Vec<u8>)> {
    vec![("a.obj", text.as_bytes().to_vec())]
}

fn ply(body: &[u8], faces: usize) -> Vec<(&'static str, Vec<u8>)> {
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
         property float z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    );
    vec![("a.ply", [header.as_bytes(), body].concat())]
}

/// Three vertices, then one triangle that names `last` as its third.
fn ply_body(last: i32) -> Vec<u8> {
    let xyz = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let mut bytes: Vec<u8> = xyz.iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.push(3);
    bytes.extend([0, 1, last].iter().flat_map(|i| i.to_le_bytes()));
    bytes
}

/// A GLB that promises more than it holds.
fn glb() -> Vec<(&'static str, Vec<u8>)> {
    let json = br#"{"asset":{"version":"2.0"}}     "#;
    let mut bytes = b"glTF".to_vec();
    for word in [2, 12 + 8 + 4096, 4096] {
        bytes.extend(u32::to_le_bytes(word));
    }
    bytes.extend(b"JSON");
    bytes.extend(json);
    vec![("a.glb", bytes)]
}

pub(crate) const SCENES: [Case; 19] = [
    ("missing_path", nothing, "render nowhere", &["nowhere"]),
    (
        "missing_file",
        nothing,
        "render nowhere.obj",
        &["nowhere.obj"],
    ),
    (
        "directory_without_meshes",
        || vec![("d/notes.txt", b"hello".to_vec())],
        "render d",
        &["d", ".obj"],
    ),
    (
        "glob_that_matches_nothing",
        nothing,
        "render x*.obj",
        &["x*.obj"],
    ),
    (
        "mixed_formats",
        || [obj(SQUARE), ply(&ply_body(2), 1)].concat(),
        "render .",
        &[".obj", ".ply"],
    ),
    (
        "unsupported_extension",
        || vec![("a.stl", b"solid".to_vec())],
        "render a.stl",
        &["a.stl"],
    ),
    (
        "obj_cut_in_a_face",
        || obj(&SQUARE[..SQUARE.len() - 5]),
        "render a.obj",
        &["a.obj", "6"],
    ),
    (
        "obj_cut_in_a_vertex",
        || obj("v 0 0 0\nv 1 0"),
        "render a.obj",
        &["a.obj", "2"],
    ),
    (
        "obj_bad_number",
        || obj("v 0 0 zero\n"),
        "render a.obj",
        &["a.obj", "1"],
    ),
    (
        "obj_index_out_of_range",
        || obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n"),
        "render a.obj",
        &["a.obj", "4"],
    ),
    (
        "obj_index_zero",
        || obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n"),
        "render a.obj",
        &["a.obj", "4", "0"],
    ),
    (
        "obj_negative_index_before_the_start",
        || obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n"),
        "render a.obj",
        &["a.obj", "4"],
    ),
    (
        "obj_without_triangles",
        || obj("v 0 0 0\nv 1 0 0\nv 0 1 0\n"),
        "render a.obj",
        &["a.obj", "triangle"],
    ),
    (
        "ply_cut_short",
        || ply(&ply_body(2)[..40], 1),
        "render a.ply",
        &["a.ply"],
    ),
    (
        "ply_index_out_of_range",
        || ply(&ply_body(3), 1),
        "render a.ply",
        &["a.ply", "3"],
    ),
    (
        "ply_negative_index",
        || ply(&ply_body(-1), 1),
        "render a.ply",
        &["a.ply", "negative"],
    ),
    (
        "ply_without_triangles",
        || ply(&ply_body(2)[..36], 0),
        "render a.ply",
        &["a.ply", "triangle"],
    ),
    ("glb_cut_short", glb, "render a.glb", &["a.glb"]),
    (
        "glb_empty",
        || vec![("a.glb", Vec::new())],
        "render a.glb",
        &["a.glb"],
    ),
];

pub(crate) const FRAMES: [Case; 3] = [
    (
        "second_frame_has_more_vertices",
        || {
            vec![
                ("d/1.obj", SQUARE.into()),
                ("d/2.obj", format!("v 5 5 5\n{SQUARE}").into_bytes()),
            ]
        },
        "render d",
        &["2.obj", "4", "5"],
    ),
    (
        "second_frame_has_fewer_triangles",
        || {
            vec![
                ("d/1.obj", SQUARE.into()),
                ("d/2.obj", SQUARE[..SQUARE.len() - 8].into()),
            ]
        },
        "render d",
        &["2.obj", "1", "2"],
    ),
    (
        "second_frame_has_other_triangles",
        || {
            vec![
                ("d/1.obj", SQUARE.into()),
                ("d/2.obj", SQUARE.replace("f 1 3 4", "f 2 3 4").into_bytes()),
            ]
        },
        "render d",
        &["2.obj"],
    ),
];
