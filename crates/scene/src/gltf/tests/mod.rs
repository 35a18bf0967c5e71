//! Tests with files that are built in memory. Expected values are computed by hand.

use super::*;
use crate::open;
use crate::testing::refused;
use geom::Point;
use std::fs;

mod readable;
mod refusals;

/// Returns the number of components per element.
fn size(kind: &str) -> usize {
    match kind {
        "SCALAR" => 1,
        "VEC3" => 3,
        "VEC4" => 4,
        _ => 16,
    }
}

/// Binary chunk, and the accessors that refer to it.
#[derive(Default)]
struct Bin {
    bytes: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Bin {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let (offset, length) = (self.bytes.len(), bytes.len());
        self.views.push(format!(
            r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#
        ));
        self.bytes.extend_from_slice(bytes);
        self.views.len() - 1
    }

    fn add(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize, more: &str) -> usize {
        let view = self.view(bytes);
        self.accessors.push(format!(
            r#"{{"bufferView":{view},"componentType":{component},"type":"{kind}","count":{count}{more}}}"#
        ));
        self.accessors.len() - 1
    }

    fn floats(&mut self, values: &[f32], kind: &str) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.add(&bytes, 5126, kind, values.len() / size(kind), "")
    }

    fn shorts(&mut self, values: &[u16], kind: &str) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.add(&bytes, 5123, kind, values.len() / size(kind), "")
    }

    /// Returns the complete JSON. `source` is the JSON text of the buffer's URI, if it has one.
    fn json(&self, rest: &str, source: &str) -> String {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{}{source}}}],"bufferViews":[{}],"accessors":[{}],{rest}}}"#,
            self.bytes.len(),
            self.views.join(","),
            self.accessors.join(",")
        )
    }
}

/// Returns a chunk of a binary file, padded to 4 bytes.
fn chunk(kind: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let padding = vec![b' '; data.len().next_multiple_of(4) - data.len()];
    let length = (data.len() + padding.len()) as u32;
    [&length.to_le_bytes(), &kind[..], data, &padding].concat()
}

/// Returns a binary file that consists of `chunks`.
fn container(chunks: &[Vec<u8>]) -> Vec<u8> {
    let chunks = chunks.concat();
    let length = chunks.len() as u32 + 12;
    let header = [2, length].map(u32::to_le_bytes).concat();
    [&b"glTF"[..], &header, &chunks].concat()
}

fn glb(json: &str, bin: &[u8]) -> Vec<u8> {
    container(&[chunk(b"JSON", json.as_bytes()), chunk(b"BIN\0", bin)])
}

fn read_with(bytes: &[u8], options: &SceneOptions) -> Result<Scene> {
    let file = tempfile::Builder::new().suffix(".glb").tempfile().unwrap();
    fs::write(file.path(), bytes).unwrap();
    open(file.path().to_str().unwrap(), options)
}

fn read_file(bytes: &[u8]) -> Result<Scene> {
    read_with(bytes, &SceneOptions::default())
}

fn read(bin: &Bin, rest: &str) -> Result<Scene> {
    let options = SceneOptions {
        fps: 2.0,
        ..SceneOptions::default()
    };
    read_with(&glb(&bin.json(rest, ""), &bin.bytes), &options)
}

fn close(found: Point, expected: Point) {
    let mut off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
    assert!(off.all(|d| d < 1e-6), "{found:?} is not {expected:?}");
}

const NORMALIZED: &str = r#","normalized":true"#;

const CORNERS: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// Returns a triangle on a moving node. Its parent rotates in steps over a shorter time. The grandparent mirrors x.
fn moving() -> (Bin, String) {
    let mut bin = Bin::default();
    let corners = bin.floats(&CORNERS, "VEC3");
    let times = bin.floats(&[1.0, 2.0], "SCALAR");
    let moves = bin.floats(&[0.0, 0.0, 0.0, 2.0, 0.0, 0.0], "VEC3");
    let half = 0.5_f32.sqrt();
    let turns = bin.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half], "VEC4");
    let later = bin.floats(&[1.25, 1.75], "SCALAR");
    let rest = format!(
        r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":{corners}}},"material":0}}]}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[1,0,0.21404114,1]}}}}],
        "nodes":[{{"mesh":0,"translation":[0,5,0]}},{{"children":[0],"rotation":[0,0,0,1]}},{{"children":[1],"scale":[-1,1,1]}}],
        "scenes":[{{"nodes":[2]}}],"scene":0,
        "animations":[{{"name":"go","samplers":[{{"input":{times},"output":{moves}}},{{"input":{later},"output":{turns},"interpolation":"STEP"}}],
        "channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}},{{"sampler":1,"target":{{"node":1,"path":"rotation"}}}}]}}]"#
    );
    (bin, rest)
}

#[test]
fn node_transforms_follow_the_hierarchy() {
    let (bin, rest) = moving();
    let scene = read(&bin, &rest).unwrap();
    let keys = scene.animation.all_keys().unwrap();
    let facts = &scene.facts;
    assert_eq!((keys.len(), facts.seconds_per_key), (3, Some(0.5)));
    assert_eq!(facts.clip.as_deref(), Some("go"));
    close(keys[0][1], [-1.0, 0.0, 0.0]);
    close(keys[1][0], [-1.0, 0.0, 0.0]);
    close(keys[1][1], [-2.0, 0.0, 0.0]);
    // Rotation by 90 degrees about z, then mirroring: (3, 0) to (0, 3); (2, 1) to (-1, 2) to (1, 2).
    close(keys[2][1], [0.0, 3.0, 0.0]);
    close(keys[2][2], [1.0, 2.0, 0.0]);
    assert_eq!(scene.animation.triangles(), [[0, 1, 2]]);
    assert_eq!(*scene.colours, [[255, 0, 128]]);
}

#[test]
fn channels_without_node_are_ignored() {
    let (bin, rest) = moving();
    let idle = r#""channels":[{"sampler":0,"target":{"path":"pointer"}},"#;
    let with = rest.replace(r#""channels":["#, idle);
    assert_ne!(with, rest);
    let last = |rest: &str| {
        let keys = read(&bin, rest).unwrap().animation.all_keys().unwrap();
        (keys.len(), keys[2].to_vec())
    };
    assert_eq!(last(&with), last(&rest));
    let targetless = rest.replace(r#""channels":["#, r#""channels":[{"sampler":0},"#);
    refused(read(&bin, &targetless), &["missing field `target`"]);
}

#[test]
fn selects_clip_by_name_or_index() {
    let (bin, rest) = moving();
    let none = rest.replace(r#""animations""#, r#""extras""#);
    let still = read(&bin, &none).unwrap();
    assert_eq!((still.animation.key_count(), still.facts.clip), (1, None));
    close(still.animation.first()[0], [0.0, 5.0, 0.0]);
    let more = r#""animations":[{"samplers":[],"channels":[]},"#;
    let two = rest.replace(r#""animations":["#, more);
    let bytes = glb(&bin.json(&two, ""), &bin.bytes);
    let with = |fps, clip: Option<&str>| {
        let options = SceneOptions {
            fps,
            clip: clip.map(str::to_owned),
            ..SceneOptions::default()
        };
        read_with(&bytes, &options)
    };
    for (clip, keys) in [(Some("go"), 25), (Some("1"), 25), (Some("0"), 1), (None, 1)] {
        let animation = with(24.0, clip).unwrap().animation;
        assert_eq!(animation.key_count(), keys, "{clip:?}");
    }
    assert!(with(24.0, None).unwrap().facts.notes[0].contains("first of 2 clips: 0, go"));
    let says = r#"no clip "stop"; there are 0 "0", 1 "go""#;
    refused(with(24.0, Some("stop")), &[says]);
    for fps in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e9] {
        refused(with(fps, None), &["frame rate"]);
    }
}

/// Returns a triangle with two joints. The second joint is bound at x = 1 and rotates by 90 degrees about z.
fn skinned() -> (Bin, String) {
    let mut bin = Bin::default();
    let corners = bin.floats(&[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 3.0, 0.0, 0.0], "VEC3");
    let joints = bin.shorts(&[0, 9, 9, 9, 1, 0, 0, 0, 0, 1, 0, 0], "VEC4");
    // Weights of three vertices as bytes: the first joint, the second, and both. The last sum is 254, not 255.
    let weights = [255, 0, 0, 0, 255, 0, 0, 0, 127, 127, 0, 0];
    let weights = bin.add(&weights, 5121, "VEC4", 3, NORMALIZED);
    let mut binds = [0.0; 32];
    for i in 0..4 {
        (binds[5 * i], binds[16 + 5 * i]) = (1.0, 1.0);
    }
    binds[16 + 12] = -1.0;
    let binds = bin.floats(&binds, "MAT4");
    let times = bin.floats(&[0.0, 1.0], "SCALAR");
    let half = -0.5_f32.sqrt();
    // The negated quaternion is the same rotation, but the direct arc to it is longer.
    let turns = bin.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half], "VEC4");
    let rest = format!(
        r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":{corners},"JOINTS_0":{joints},"WEIGHTS_0":{weights}}}}}]}}],
        "nodes":[{{"mesh":0,"skin":0,"translation":[100,0,0]}},{{"children":[2]}},{{"translation":[1,0,0]}}],
        "skins":[{{"joints":[1,2],"inverseBindMatrices":{binds}}}],"scenes":[{{"nodes":[0,1]}}],
        "animations":[{{"samplers":[{{"input":{times},"output":{turns}}}],"channels":[{{"sampler":0,"target":{{"node":2,"path":"rotation"}}}}]}}]"#
    );
    (bin, rest)
}

#[test]
fn skins_follow_joints_not_nodes() {
    let (bin, rest) = skinned();
    let scene = read(&bin, &rest).unwrap();
    let keys = scene.animation.all_keys().unwrap();
    for (found, x) in keys[0].iter().zip([0.0, 2.0, 3.0]) {
        close(*found, [x, 0.0, 0.0]);
    }
    let h = 0.5_f32.sqrt();
    close(keys[1][1], [1.0 + h, h, 0.0]);
    close(keys[2][0], [0.0, 0.0, 0.0]);
    close(keys[2][1], [1.0, 1.0, 0.0]);
    close(keys[2][2], [2.0, 1.0, 0.0]);
}

/// Returns a triangle with two morph targets whose weights are splines. The second target is sparse without a base.
fn morphing() -> (Bin, String) {
    let mut bin = Bin::default();
    let corners = bin.floats(&CORNERS, "VEC3");
    let up = bin.floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0], "VEC3");
    let at = bin.view(&[2]);
    let by = bin.view(&[4.0_f32, 0.0, 0.0].map(f32::to_le_bytes).concat());
    bin.accessors.push(format!(
        r#"{{"componentType":5126,"type":"VEC3","count":3,"sparse":{{"count":1,"indices":{{"bufferView":{at},"componentType":5121}},"values":{{"bufferView":{by}}}}}}}"#
    ));
    let aside = bin.accessors.len() - 1;
    let times = bin.floats(&[0.0, 2.0], "SCALAR");
    // Keys are (in-tangent, value, out-tangent) of two weights: w0 = t^2 over 0..2, and w1 = 0.5 is constant.
    let weights = [0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 4.0, 0.0, 4.0, 0.5, 0.0, 0.0];
    let weights = bin.floats(&weights, "SCALAR");
    let rest = format!(
        r#""meshes":[{{"weights":[0,1],"primitives":[{{"attributes":{{"POSITION":{corners}}},"targets":[{{"POSITION":{up}}},{{"POSITION":{aside}}}]}}]}}],
        "nodes":[{{"mesh":0}},{{"extras":["any",{{}}]}}],
        "animations":[{{"samplers":[{{"input":{times},"output":{weights},"interpolation":"CUBICSPLINE"}}],"channels":[{{"sampler":0,"target":{{"node":0,"path":"weights"}}}}]}}]"#
    );
    (bin, rest)
}

#[test]
fn morph_targets_are_weighted_and_summed() {
    let (bin, rest) = morphing();
    let keys = read(&bin, &rest).unwrap().animation.all_keys().unwrap();
    assert_eq!(keys.len(), 5);
    for (i, key) in keys.iter().enumerate() {
        let t = i as f32 * 0.5;
        close(key[1], [1.0, 0.0, t * t]);
        close(key[2], [2.0, 1.0, t * t]);
    }
    let still = rest.replace(r#""animations""#, r#""extras""#);
    let still = read(&bin, &still).unwrap();
    close(still.animation.first()[2], [4.0, 1.0, 0.0]);
}

#[test]
fn triangulates_strips_fans_and_lists() {
    let mut bin = Bin::default();
    let corners = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(|x: f32| [x, x * x, 0.0]);
    let corners = bin.floats(corners.as_flattened(), "VEC3");
    let indices = bin.shorts(&[5, 4, 3, 1], "SCALAR");
    let primitive = |more: &str| format!(r#"{{"attributes":{{"POSITION":{corners}}}{more}}}"#);
    let strip = primitive(&format!(r#","mode":5,"indices":{indices}"#));
    let fan = primitive(&format!(r#","mode":6,"indices":{indices}"#));
    let (points, list) = (primitive(r#","mode":0"#), primitive(""));
    let of = |primitives: &[String]| {
        let all = primitives.join(",");
        let rest = format!(r#""meshes":[{{"primitives":[{all}]}}],"nodes":[{{"mesh":0}}]"#);
        read(&bin, &rest)
    };
    let scene = of(&[strip, points.clone(), fan, list]).unwrap();
    let a = &scene.animation;
    let xs = |t: &[u32; 3]| t.map(|v| a.first()[v as usize][0] as u32);
    let found: Vec<_> = a.triangles().iter().map(xs).collect();
    let (in_strip, in_fan) = ([[5, 4, 3], [4, 1, 3]], [[5, 4, 3], [5, 3, 1]]);
    let expected = [in_strip, in_fan, [[0, 1, 2], [3, 4, 5]]].concat();
    assert_eq!(found, expected);
    assert_eq!(scene.facts.notes, ["skipped 1 primitives of mode Points"]);
    let says = "no triangles; skipped 1 primitives of mode Points";
    refused(of(&[points]), &[says]);
}

/// Returns a static triangle with positions from accessor `positions`, followed by more JSON.
fn still(positions: usize, more: &str) -> String {
    let attributes = format!(r#"{{"POSITION":{positions}}}"#);
    format!(
        r#""nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{attributes}}}]}}]{more}"#
    )
}

#[test]
fn accessor_without_view_is_zero() {
    let mut bin = Bin::default();
    let declared = r#"{"componentType":5126,"type":"VEC3","count":3}"#;
    bin.accessors.push(declared.to_owned());
    bin.view(&[1, 2]);
    let scene = read(&bin, &still(0, "")).unwrap();
    assert_eq!(scene.animation.first(), [[0.0; 3]; 3]);
}

#[test]
fn reads_integer_and_normalized_positions() {
    let name = r#"["KHR_mesh_quantization"]"#;
    let required = format!(r#","extensionsUsed":{name},"extensionsRequired":{name}"#);
    let bytes = vec![0, 0, 0, 127, 0, 0, 0, 0x81, 0];
    let shorts = [0_i16, 0, 0, 32767, 0, 0, 0, -32767, 0];
    let shorts = shorts.map(i16::to_le_bytes).concat();
    let whole = |kind, x, y| (kind, "", [x, y]);
    let part = |kind, x: f32, y: f32, most: f32| (kind, NORMALIZED, [x / most, y / most]);
    for (component, more, [x, y]) in [
        whole(5120, 127.0, -127.0),
        part(5120, 127.0, -127.0, 127.0),
        whole(5121, 127.0, 129.0),
        part(5121, 127.0, 129.0, 255.0),
        whole(5122, 32767.0, -32767.0),
        part(5122, 32767.0, -32767.0, 32767.0),
        whole(5123, 32767.0, 32769.0),
        part(5123, 32767.0, 32769.0, 65535.0),
    ] {
        let data = if component < 5122 { &bytes } else { &shorts };
        let mut bin = Bin::default();
        let positions = bin.add(data, component, "VEC3", 3, more);
        let scene = read(&bin, &still(positions, &required)).unwrap();
        let corners = [[0.0; 3], [x, 0.0, 0.0], [0.0, y, 0.0]];
        assert_eq!(scene.animation.first(), corners);
        assert!(scene.facts.notes.is_empty(), "{:?}", scene.facts.notes);
    }
}

#[test]
fn expands_mesh_instances() {
    let mut bin = Bin::default();
    let positions = bin.floats(&CORNERS, "VEC3");
    let places = bin.floats(&[0.0, 0.0, 0.0, 5.0, 0.0, 0.0], "VEC3");
    let scales = bin.floats(&[1.0, 1.0, 1.0, 2.0, 2.0, 2.0], "VEC3");
    let required = r#","extensionsRequired":["EXT_mesh_gpu_instancing"]"#;
    let with = |attributes: &str| {
        let instances = format!(
            r#""mesh":0,"extensions":{{"EXT_mesh_gpu_instancing":{{"attributes":{{{attributes}}}}}}}}}]"#
        );
        let rest = still(positions, required).replacen(r#""mesh":0}]"#, &instances, 1);
        read(&bin, &rest)
    };
    let scene = with(&format!(r#""TRANSLATION":{places},"SCALE":{scales}"#)).unwrap();
    assert_eq!(scene.animation.triangle_count(), 2);
    let corners = [1, 4].map(|v| scene.animation.first()[v]);
    assert_eq!(corners, [[1.0, 0.0, 0.0], [7.0, 0.0, 0.0]]);
    let uneven = format!(r#""TRANSLATION":{places},"SCALE":{positions}"#);
    for (attributes, says) in [
        (r#""TRANSLATION":99"#, "accessor 99 does not exist"),
        (uneven.as_str(), "differ in their counts"),
    ] {
        refused(with(attributes), &[says]);
    }
}

#[test]
fn unsupported_extensions_are_reported() {
    let mut bin = Bin::default();
    let positions = bin.floats(&CORNERS, "VEC3");
    for name in ["KHR_draco_mesh_compression", "EXT_meshopt_compression"] {
        let used = still(positions, &format!(r#","extensionsUsed":["{name}"]"#));
        let notes = read(&bin, &used).unwrap().facts.notes;
        assert!(notes[0].contains(name), "{notes:?}");
        let required = used.replace("extensionsUsed", "extensionsRequired");
        let says = format!("requires the extension {name:?}");
        refused(read(&bin, &required), &[&says]);
    }
}
