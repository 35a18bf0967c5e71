use super::*;
use crate::testing::{ascii_ply, open_in, put};
use crate::{Scene, SceneOptions};
use tempfile::TempDir;

/// Coordinates of a survey point. The spacing of single-precision floats is 0.0625 in x and 0.5 in y.
const EAST: f64 = 691_608.1;
const NORTH: f64 = 5_334_760.7;

/// Returns the vertices of a triangle of size 1, shifted by `shift` in x.
fn corners(shift: f64) -> [Position; 3] {
    let at = |x: f64, y: f64, z: f64| [EAST + shift + x, NORTH + y, z];
    [at(0.0, 0.0, 0.1), at(1.0, 0.0, 0.3), at(0.0, 1.0, 0.2)]
}

fn obj(shift: f64) -> String {
    let vertices = corners(shift).map(|[x, y, z]| format!("v {x} {y} {z}\n"));
    vertices.concat() + "f 1 2 3\n"
}

fn ascii(kind: &str) -> String {
    let vertices = corners(0.0).map(|[x, y, z]| format!("{x} {y} {z}\n"));
    ascii_ply(&vertices.concat(), "3 0 1 2\n").replace("float", kind)
}

fn binary_ply(shift: f64) -> Vec<u8> {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty double x\nproperty double y\n\
                  property double z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let vertices = corners(shift).map(|p| p.map(f64::to_le_bytes).concat());
    let face = [0_i32, 1, 2].map(i32::to_le_bytes).concat();
    [header.as_bytes(), &vertices.concat(), &[3], &face].concat()
}

/// Returns a glTF document with a triangle at the origin, translated by its node.
fn gltf() -> String {
    use base64::prelude::{BASE64_STANDARD, Engine};
    let corners = [[0.0_f32, 0.0, 0.1], [1.0, 0.0, 0.3], [0.0, 1.0, 0.2]];
    let bytes = corners.map(|p| p.map(f32::to_le_bytes).concat());
    let data = BASE64_STANDARD.encode(bytes.concat());
    format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0,"translation":[{EAST},{NORTH},0]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"type":"VEC3","count":3}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],
        "buffers":[{{"byteLength":36,"uri":"data:;base64,{data}"}}]}}"#
    )
}

fn open(folder: &TempDir, name: &str, recentre: bool) -> Scene {
    let options = SceneOptions {
        recentre,
        ..SceneOptions::default()
    };
    open_in(folder, name, &options).unwrap()
}

/// Asserts that a key frame plus the offset equals `expected`.
#[track_caller]
fn adds_up(scene: &Scene, key: usize, expected: &[Position]) {
    let offset = scene.facts.offset.unwrap();
    let key = scene.animation.key(key).unwrap();
    assert_eq!(key.len(), expected.len());
    for (found, expected) in key.iter().zip(expected) {
        for axis in 0..3 {
            let found = f64::from(found[axis]) + offset[axis];
            let off = (found - expected[axis]).abs();
            assert!(off < 1e-6, "axis {axis}: {found} is not {}", expected[axis]);
        }
    }
}

#[test]
fn distant_coordinates_are_noted_or_recentred() {
    let folder = tempfile::tempdir().unwrap();
    put(&folder, "a.obj", obj(0.0));
    put(&folder, "double.ply", ascii("double"));
    put(&folder, "float.ply", ascii("float"));
    put(&folder, "binary.ply", binary_ply(0.0));
    put(&folder, "a.gltf", gltf());
    for name in ["a.obj", "double.ply", "float.ply", "binary.ply", "a.gltf"] {
        let plain = open(&folder, name, false);
        let notes = &plain.facts.notes;
        let says = "coordinates lose up to 0.2";
        let told = |n: &String| n.contains(name) && n.contains(says) && n.contains("--recentre");
        assert!(notes.iter().any(told), "{name}: {notes:?}");
        assert_eq!(plain.facts.offset, None);
        let near = open(&folder, name, true);
        assert!(near.facts.notes.is_empty(), "{:?}", near.facts.notes);
        adds_up(&near, 0, &corners(0.0));
        let bounds = near.animation.bounds();
        assert!(bounds.max.iter().all(|x| *x < 0.51), "{name}: {bounds:?}");
    }
}

#[test]
fn small_rounding_losses_are_not_noted() {
    let folder = tempfile::tempdir().unwrap();
    // The loss is at most 0.03 in a scene of size 100.
    put(
        &folder,
        "large.obj",
        "v 691608.1 0 0\nv 691708.3 0 0\nv 691608.1 7 0\nf 1 2 3\n",
    );
    put(
        &folder,
        "one.obj",
        "v 0.1 0.2 0.3\nv 1.1 0 0\nv 0 1e99 nan\nv 0 1 0\nf 1 2 3\nf 1 2 4\n",
    );
    assert!(open(&folder, "large.obj", false).facts.notes.is_empty());
    let near = open(&folder, "one.obj", true);
    let notes = &near.facts.notes;
    let exceeds = "exceeds the range of 32-bit floats";
    assert!(notes.len() == 1 && notes[0].contains(exceeds), "{notes:?}");
    assert_eq!(near.facts.offset, Some([0.55, 0.5, 0.15]));
    let stray = near.animation.key(0).unwrap()[2];
    assert!(stray[1].is_infinite() && stray[2].is_nan());
}

#[test]
fn placements_that_lose_precision_are_noted() {
    let folder = tempfile::tempdir().unwrap();
    put(&folder, "unit.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let notes = |name: &str| open(&folder, name, false).facts.notes;
    assert!(notes("unit.obj@1,2,3*0.1").is_empty());
    let far = notes(&format!("unit.obj@{EAST},{NORTH},7"));
    let says = ": coordinates lose up to 0.2";
    assert!(far.len() == 1 && far[0].contains(says), "{far:?}");
    // The placement itself is rounded, too.
    put(
        &folder,
        "far.obj",
        "v 5000000 0 0\nv 5000001 0 0\nv 5000000 1 0\nf 1 2 3\n",
    );
    assert_eq!(notes("far.obj@-5000000.3,0,0").len(), 1);
    // The loss is compared with the size of the whole scene.
    put(
        &folder,
        "wide.obj",
        "v 0 0 0\nv 100000 0 0\nv 0 100000 0\nf 1 2 3\n",
    );
    assert!(notes("wide.obj+unit.obj@50000.3,0,0").is_empty());
}

#[test]
fn key_frames_share_the_first_offset() {
    let folder = tempfile::tempdir().unwrap();
    for (name, shift) in [("1", 0.0), ("2", 3.5), ("3", -2.25)] {
        put(&folder, &format!("obj/{name}.obj"), obj(shift));
        put(&folder, &format!("ply/{name}.ply"), binary_ply(shift));
    }
    for kind in ["obj", "ply"] {
        let scene = open(&folder, kind, true);
        for (key, shift) in [0.0, 3.5, -2.25].into_iter().enumerate() {
            adds_up(&scene, key, &corners(shift));
        }
    }
}

#[test]
fn joined_inputs_share_one_offset() {
    let folder = tempfile::tempdir().unwrap();
    put(&folder, "a.obj", obj(0.0));
    put(&folder, "b.ply", binary_ply(10.0));
    put(&folder, "unit.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let place = format!("a.obj+b.ply+unit.obj@{EAST},{NORTH},7*2");
    let scene = open(&folder, &place, true);
    let unit = [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]].map(|[x, y]| [EAST + x, NORTH + y, 7.0]);
    adds_up(&scene, 0, &[corners(0.0), corners(10.0), unit].concat());
}
