//! Unusual files that must be accepted, and clear errors for files that must be refused.

use super::*;
use crate::testing::put;

/// Returns the positions of one triangle, and the rest of a document that shows it.
fn triangle(more: &str) -> (Bin, String) {
    let mut bin = Bin::default();
    let corners = bin.floats(&CORNERS, "VEC3");
    let rest = still(corners, more);
    (bin, rest)
}

/// Opens a document without a binary chunk.
fn read_text(json: impl AsRef<[u8]>) -> Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    let path = put(&folder, "a.gltf", json);
    open(path.to_str().unwrap(), &SceneOptions::default())
}

/// Asserts that the scene is the triangle of [`CORNERS`], and returns its remarks.
#[track_caller]
fn is_triangle(read: Result<Scene>) -> Vec<String> {
    let scene = read.unwrap();
    let points = scene.animation.first().to_vec();
    assert_eq!(points.as_flattened(), CORNERS);
    scene.facts.notes
}

#[test]
fn irrelevant_properties_are_ignored() {
    for more in [
        r#","textures":[{}],"images":[{"uri":7}],"samplers":[null],"cameras":"x""#,
        r#","textures":[{"extensions":{"KHR_texture_basisu":{"source":0}}}],"extensionsRequired":["KHR_texture_basisu"]"#,
        r#","extensionsUsed":["EXT_texture_webp"],"extensionsRequired":["EXT_texture_webp"]"#,
        r#","extensionsRequired":["EXT_structural_metadata","EXT_mesh_features"]"#,
        r#","materials":[{"pbrMetallicRoughness":{"baseColorFactor":"red"}}]"#,
        r#","extras":[1e999,{"a":-1}],"extensions":{"x":[[]]}"#,
        r#","scene":0,"scenes":[{"nodes":[0]},{},{"name":"empty"}]"#,
        r#","skins":[{"joints":[9]}],"animations":[]"#,
    ] {
        let (bin, rest) = triangle(more);
        assert!(is_triangle(read(&bin, &rest)).is_empty(), "{more}");
    }
    let (bin, rest) = triangle(r#","extensions":DEEP"#);
    let deep = "[".repeat(200_000) + &"]".repeat(200_000);
    is_triangle(read(&bin, &rest.replace("DEEP", &deep)));
}

#[test]
fn unused_items_are_not_validated() {
    let (mut bin, rest) = triangle(r#","animations":[{}]"#);
    let unused = [
        r#"{"bufferView":7,"componentType":5130,"type":"VEC9","count":1}"#,
        r#"{"bufferView":1,"componentType":5126,"type":"VEC3","count":99}"#,
    ];
    bin.accessors.extend(unused.map(str::to_owned));
    bin.views.push(r#"{"buffer":1,"byteLength":5}"#.to_owned());
    let rest = rest.replace(r#""POSITION":0"#, r#""POSITION":0,"NORMAL":99,"_ODD":1"#);
    assert!(is_triangle(read(&bin, &rest)).is_empty());
    let more = r#","animations":[{"name":"a"},{"channels":[{"sampler":3,"target":{"node":8,"path":"x"}}]}]"#;
    let (bin, rest) = triangle(more);
    assert_eq!(
        is_triangle(read(&bin, &rest)),
        ["took the first of 2 clips: a, 1"]
    );
}

#[test]
fn unused_buffers_may_be_missing() {
    use base64::prelude::{BASE64_STANDARD, Engine};
    let (bin, rest) = triangle("");
    let json = bin.json(&rest, "").replace(
        "}],\"bufferViews\"",
        "},{\"byteLength\":5},{\"byteLength\":5,\"uri\":\"absent.bin\"}],\"bufferViews\"",
    );
    assert!(json.contains("absent.bin"));
    is_triangle(read_file(&glb(&json, &bin.bytes)));
    let text = BASE64_STANDARD.encode(&bin.bytes);
    let uri = format!(r#""byteLength":36,"uri":"data:;base64,{text}""#);
    let json = json.replacen(r#""byteLength":36"#, &uri, 1);
    is_triangle(read_text(&json));
    for (buffer, says) in [
        (
            "1",
            "accessor 0: buffer 1: it has no uri and there is no binary chunk",
        ),
        ("2", "accessor 0: buffer 2: cannot read"),
        ("3", "accessor 0: buffer 3 does not exist, there are 3"),
    ] {
        let json = json.replace(r#""buffer":0"#, &format!(r#""buffer":{buffer}"#));
        refused(read_text(&json), &[says]);
    }
}

#[test]
fn data_uris_need_no_base64() {
    let (bin, rest) = triangle("");
    let escaped: String = bin.bytes.iter().map(|b| format!("%{b:02x}")).collect();
    for kind in [
        "",
        "application/octet-stream",
        "text/plain;charset=US-ASCII",
    ] {
        let uri = format!(r#","uri":"data:{kind},{escaped}""#);
        is_triangle(read_text(bin.json(&rest, &uri)));
    }
    let cut = format!(r#","uri":"data:,{}""#, &escaped[..30]);
    let says = "buffer 0: 36 bytes are declared, 10 are there";
    refused(read_text(bin.json(&rest, &cut)), &[says]);
}

#[test]
fn integers_may_be_written_as_floats() {
    let (bin, rest) = triangle(r#","scene":0.0,"scenes":[{"nodes":[0e0]}]"#);
    let json = bin.json(&rest, "");
    let floats = json
        .replace(r#""count":3"#, r#""count":30e-1"#)
        .replace(r#""byteLength":36"#, r#""byteLength":3.6e1"#)
        .replace(r#""componentType":5126"#, r#""componentType":5126.0"#)
        .replace(r#""POSITION":0"#, r#""POSITION":-0.0"#);
    assert_ne!(json, floats);
    is_triangle(read_file(&glb(&floats, &bin.bytes)));
    let changes = r#"
        "count":3 | "count":3.5 | 3.5 is not a whole number of at least 0
        "count":3 | "count":-3 | -3 is not a whole number of at least 0
        "count":3 | "count":1e300 | 1e+300 is not a whole number
        "count":3 | "count":1e999 | number out of range
        "count":3 | "count":"3" | string "3", expected a JSON number
        "POSITION":0 | "POSITION":4294967296 | accessor 4294967296 does not exist, there are 1
        "mesh":0 | "mesh":-1 | -1 is not a whole number
    "#;
    refusals::refuse(&json, &bin, changes);
}

#[test]
fn primitives_without_positions_are_skipped() {
    let (bin, rest) = triangle("");
    let more = r#""primitives":[{"attributes":{"NORMAL":0}},{"attributes":{},"mode":5},"#;
    let with = rest.replace(r#""primitives":["#, more);
    let notes = is_triangle(read(&bin, &with));
    assert_eq!(notes, ["skipped 2 primitives without positions"]);
}

#[test]
fn empty_scene_error_names_its_cause() {
    let (bin, rest) = triangle(r#","extensionsUsed":["EXT_unheard_of"]"#);
    let points = rest.replace(r#""primitives":["#, r#""primitives":[{"attributes":{}},"#);
    let points = points.replace(r#""POSITION":0}"#, r#""POSITION":0},"mode":0"#);
    let message = read(&bin, &points).unwrap_err().to_string();
    let says =
        "no triangles; skipped 1 primitives of mode Points; skipped 1 primitives without positions";
    assert!(message.ends_with(says), "{message}");
    let empty = r#"{"asset":{"version":"2.0"},"extensionsUsed":["EXT_unheard_of"]}"#;
    let message = read_text(empty).unwrap_err().to_string();
    assert!(message.ends_with("no triangles"), "{message}");
}

#[test]
fn meshes_without_nodes_are_shown_once() {
    let (bin, rest) = triangle("");
    let lone = rest.replace(r#""nodes":[{"mesh":0}],"#, "");
    assert_ne!(lone, rest);
    let notes = is_triangle(read(&bin, &lone));
    assert!(notes[0].contains("no nodes"), "{notes:?}");
    let unused = rest.replace(r#""nodes":[{"mesh":0}]"#, r#""nodes":[{}]"#);
    refused(read(&bin, &unused), &["no triangles"]);
}

#[test]
fn unsupported_versions_are_reported() {
    let (bin, rest) = triangle("");
    let with = |asset: &str| {
        let json = bin.json(&rest, "");
        let json = json.replace(r#""asset":{"version":"2.0"}"#, asset);
        read_file(&glb(&json, &bin.bytes))
    };
    for asset in [
        r#""asset":{"version":"2.0","minVersion":"2.0"}"#,
        r#""asset":{"version":"2.1","minVersion":"2.0"}"#,
        r#""asset":{"version":"2.7"}"#,
        r#""asset":{"version":2}"#,
    ] {
        is_triangle(with(asset));
    }
    for (asset, says) in [
        (
            r#""asset":{"version":"2.1","minVersion":"2.1"}"#,
            "needs glTF 2.1",
        ),
        (
            r#""asset":{"version":"2.10","minVersion":"2.10"}"#,
            "needs glTF 2.10",
        ),
        (
            r#""asset":{"version":"1.0"}"#,
            "glTF 1.0 is not supported, only 2.0",
        ),
        (
            r#""asset":{"version":"3.0"}"#,
            "glTF 3.0 is not supported, only 2.0",
        ),
        (
            r#""asset":{}"#,
            "there is no asset.version; glTF 1.0 is not supported",
        ),
        (r#""extras":0"#, "there is no asset.version"),
    ] {
        refused(with(asset), &[says]);
    }
    // In glTF 1.0, these lists are objects.
    let old = r#"{"asset":{"version":"1.0"},"accessors":{"a":{}},"buffers":{},"scene":"s"}"#;
    refused(read_text(old), &["glTF 1.0 is not supported"]);
}

#[test]
fn byte_order_marks_are_rejected() {
    let text = r#"{"asset":{"version":"2.0"}}"#;
    let marked = format!("\u{feff}{text}");
    let says = "begins with a byte order mark of UTF-8";
    refused(read_text(&marked), &[says]);
    refused(read_file(&glb(&marked, &[])), &[says]);
    let wide = marked.encode_utf16().flat_map(u16::to_le_bytes);
    let says = "begins with a byte order mark of UTF-16";
    refused(read_text(wide.collect::<Vec<_>>()), &[says]);
}

#[test]
fn ignores_unknown_chunks_and_trailing_bytes() {
    let (bin, rest) = triangle("");
    let json = chunk(b"JSON", bin.json(&rest, "").as_bytes());
    let data = chunk(b"BIN\0", &bin.bytes);
    let other = || chunk(b"\xffX\0Y", b"12345678");
    for chunks in [
        vec![json.clone(), data.clone()],
        vec![json.clone(), other(), data.clone(), other()],
        vec![json.clone(), chunk(b"ABCD", b""), data.clone()],
        vec![json.clone(), data.clone(), chunk(b"BIN\0", b"")],
        vec![json.clone(), data.clone(), b"odd".to_vec()],
    ] {
        let whole = container(&chunks);
        is_triangle(read_file(&whole));
        for after in [1, 3, 64] {
            is_triangle(read_file(&[&whole[..], &vec![7; after]].concat()));
        }
    }
    for (chunks, says) in [
        (
            vec![json.clone()],
            "buffer 0: it has no uri and there is no binary chunk",
        ),
        (
            vec![data.clone(), json.clone()],
            "first chunk is not of type JSON",
        ),
        (vec![], "first chunk is not of type JSON"),
        (
            vec![json, data[..20].to_vec()],
            "chunk 1 is cut short: 36 bytes are declared, 12",
        ),
    ] {
        refused(read_file(&container(&chunks)), &[says]);
    }
    let mut old = container(&[data]);
    old[4] = 1;
    refused(read_file(&old), &["binary glTF 1 is not supported, only 2"]);
}

#[test]
fn transforms_are_multiplied_in_double_precision() {
    let (bin, rest) = triangle("");
    let nodes = r#""nodes":[{"mesh":0,"translation":[-100000000.25,0,0]},{"children":[0],"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,100000000.5,0,0,1]}]"#;
    let rest = rest.replace(r#""nodes":[{"mesh":0}]"#, nodes);
    let scene = read(&bin, &rest).unwrap();
    assert_eq!(scene.animation.first()[1], [1.25, 0.0, 0.0]);
}

#[test]
fn reads_buffers_from_uris_and_files() {
    use base64::prelude::{BASE64_STANDARD, Engine};
    let (bin, rest) = moving();
    let all = tempfile::tempdir().unwrap();
    let read = |source: &str, allow_outside| {
        let json = bin.json(&rest, &format!(r#","uri":"{source}""#));
        let path = put(&all, "scene/a.gltf", json);
        let options = SceneOptions {
            allow_outside,
            ..SceneOptions::default()
        };
        open(path.to_str().unwrap(), &options)
    };
    put(&all, "scene/some bytes.bin", &bin.bytes);
    put(&all, "outside.bin", &bin.bytes);
    let beside = read("some%20bytes.bin", false).unwrap();
    assert_eq!(beside.facts.format, "gltf");
    let text = BASE64_STANDARD.encode(&bin.bytes);
    let text = format!("data:application/octet-stream;base64,{text}");
    assert!(read(&text, false).is_ok() && read("../outside.bin", true).is_ok());
    for (source, says) in [
        ("data:;base64,@@@@", "buffer 0: a data URI with bad base64"),
        ("data:;base64,AAAA", "are declared, 3 are there"),
        ("data:;base64", "a data URI without data"),
        ("absent.bin", "absent.bin"),
        ("https://example.org/a.bin", "network"),
        ("../outside.bin", "--allow-outside"),
    ] {
        refused(read(source, false), &[says]);
    }
}
