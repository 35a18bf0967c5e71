//! Invalid files: each error names its cause, and no file causes a panic.

use super::*;

/// Checks that the file cannot be opened after any of the changes. Each line has the old text, the new text and a part
/// of the message. `HUGE` means 2^64 - 1.
pub(super) fn refuse(file: &str, bin: &Bin, changes: &str) {
    for change in changes.trim().lines() {
        let mut parts = change.split(" | ").map(str::trim);
        let [from, to, says] = std::array::from_fn(|_| parts.next().unwrap());
        let broken = file.replacen(from, &to.replace("HUGE", &u64::MAX.to_string()), 1);
        assert_ne!(broken, file, "{from}");
        let opened = read_file(&glb(&broken, &bin.bytes));
        refused(opened, &[says]);
    }
}

#[test]
fn errors_name_dangling_references() {
    let (bin, rest) = moving();
    let changes = r#"
        "POSITION":0 | "POSITION":9 | accessor 9 does not exist
        "sampler":1 | "sampler":2 | sampler 2 does not exist, there are 2
        "mesh":0 | "mesh":4 | mesh 4 does not exist, there are 1
        "children":[0] | "children":[0,2] | node 1: the node is its own ancestor
        "children":[1] | "children":[1,0] | node 0: the node has two parents
        "output":2 | "output":3 | accessor 3: VEC3 elements are expected
        "input":1 | "input":0 | accessor 0: SCALAR elements are expected
        "material":0 | "indices":1 | accessor 1: unsigned integers are expected
        "scene":0 | "extensionsRequired":["KHR_draco_mesh_compression"] | KHR_draco_mesh_compression
        "sampler":1,"target":{"node":1 | "sampler":1,"target":{"node":3 | node 3 does not exist
    "#;
    refuse(&bin.json(&rest, ""), &bin, changes);
    let (bin, rest) = skinned();
    let changes = r#"
        "joints":[1,2] | "joints":[1] | vertex 1 uses joint 1
        "joints":[1,2] | "joints":[1,2,0] | 2 inverse bind matrices for 3 joints
    "#;
    refuse(&bin.json(&rest, ""), &bin, changes);
}

#[test]
fn rejects_mismatched_accessors_and_weights() {
    let (bin, rest) = morphing();
    let json = bin.json(&rest, "");
    let mut bytes = glb(&json, &bin.bytes);
    assert!(read_file(&bytes).is_ok());
    let changes = r#"
        "node":0,"path" | "node":1,"path" | no morph targets
        "CUBICSPLINE" | "LINEAR" | 2 values are expected for 2 times, 6 are there
        "path":"weights" | "path":"warp" | unknown path
        "VEC3","count":3} | "VEC3","count":4} | 4 elements of 12 bytes
        "VEC3","count":3} | "VEC3","count":HUGE} | do not fit
        "byteOffset":0 | "byteOffset":HUGE | buffer view 0 ends beyond
        "byteLength":36} | "byteLength":36,"byteStride":4} | stride of 4
        "count":1, | "count":2, | 2 elements of 1 bytes
        "count":1, | "count":0, | no element is replaced
        "count":3,"sparse" | "count":2,"sparse" | sparse index 2
        "count":3,"sparse" | "count":HUGE,"sparse" | limit
        "count":3,"sparse" | "count":4,"sparse" | 4 elements for 3 vertices
    "#;
    refuse(&json, &bin, changes);
    let falling = [1.0_f32, 0.5].map(f32::to_le_bytes).concat();
    let rising = [0.0_f32, 2.0].map(f32::to_le_bytes).concat();
    let at = bytes.windows(8).position(|w| w == rising).unwrap();
    bytes[at..at + 8].copy_from_slice(&falling);
    refused(read_file(&bytes), &["do not rise"]);
}

#[test]
fn rejects_files_shorter_than_declared() {
    let (bin, rest) = moving();
    let whole = glb(&bin.json(&rest, ""), &bin.bytes);
    let most = "4294967295 bytes are declared";
    for (length, says) in [(5, "within its header"), (u32::MAX, most)] {
        let altered = [&whole[..8], &length.to_le_bytes(), &whole[12..]].concat();
        refused(read_file(&altered), &[says]);
    }
}

#[test]
fn rejects_scenes_beyond_memory_before_sampling() {
    let mut bin = Bin::default();
    let corners: Vec<f32> = CORNERS.iter().copied().cycle().take(3000).collect();
    let corners = bin.floats(&corners, "VEC3");
    let times = bin.floats(&[0.0, 65_000.0], "SCALAR");
    let moves = bin.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], "VEC3");
    let all = (0..25).map(|i| i.to_string()).collect::<Vec<_>>().join(",");
    let nodes = [r#"{"mesh":0}"#; 25].join(",");
    let rest = format!(
        r#""scene":0,"scenes":[{{"nodes":[{all}]}}],"nodes":[{nodes}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":{corners}}}}}]}}],
        "animations":[{{"samplers":[{{"input":{times},"output":{moves}}}],
        "channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}}]}}]"#
    );
    let bytes = glb(&bin.json(&rest, ""), &bin.bytes);
    assert!(bytes.len() < 40_000);
    let with = |fps, more_bytes, triangle_bytes| {
        let options = SceneOptions {
            fps,
            more_bytes,
            triangle_bytes,
            key_bytes: u64::MAX,
            ..SceneOptions::default()
        };
        read_with(&bytes, &options)
    };
    let says = "65001 key frames of 24975 vertices: 1.2 EB of memory are needed";
    refused(with(1.0, 1 << 60, 0), &[says]);
    assert!(with(0.001, 0, 0).is_ok());
    // The memory for trees is checked together with the key frames.
    let says = "24975 vertices, and trees over 8325 triangles: 9.4 EB of memory are needed";
    refused(with(1.0, 0, 1 << 50), &[says]);
}
