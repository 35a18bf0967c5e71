//! Files with something wrong: each is named, none panics.

use super::*;

#[test]
fn buffers_come_from_data_uris_and_from_files_beside() {
    let (bin, rest) = moving();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let read = |source: &str| {
        fs::write(&path, bin.json(&rest, &format!(r#","uri":"{source}""#))).unwrap();
        open(path.to_str().unwrap(), &Options::default()).map_err(|e| e.to_string())
    };
    fs::write(folder.path().join("some bytes.bin"), &bin.bytes).unwrap();
    assert_eq!(read("some%20bytes.bin").unwrap().facts.format, "gltf");
    use base64::prelude::{BASE64_STANDARD, Engine};
    let text = BASE64_STANDARD.encode(&bin.bytes);
    assert!(read(&format!("data:application/octet-stream;base64,{text}")).is_ok());
    for (source, says) in [
        ("data:;base64,####".to_owned(), "buffer 0: bad base64"),
        ("data:;base64,AAAA".to_owned(), "are declared, 3 are there"),
        ("data:,AAAA".to_owned(), "not base64"),
        ("absent.bin".to_owned(), "absent.bin"),
        ("https://example.org/a.bin".to_owned(), "network"),
    ] {
        let message = read(&source).unwrap_err();
        assert!(message.contains(says), "{message}");
    }
}

#[test]
fn a_buffer_outside_the_folder_is_read_only_if_that_is_allowed() {
    let (bin, rest) = moving();
    let all = tempfile::tempdir().unwrap();
    let path = all.path().join("scene/a.gltf");
    fs::create_dir(path.parent().unwrap()).unwrap();
    fs::write(all.path().join("outside.bin"), &bin.bytes).unwrap();
    fs::write(&path, bin.json(&rest, r#","uri":"../outside.bin""#)).unwrap();
    let with = |allow_outside| {
        let options = Options {
            allow_outside,
            ..Options::default()
        };
        open(path.to_str().unwrap(), &options).map_err(|e| e.to_string())
    };
    let message = with(false).unwrap_err();
    assert!(
        message.contains("buffer 0") && message.contains("--allow-outside"),
        "{message}"
    );
    assert!(with(true).is_ok());
    fs::write(&path, bin.json(&rest, r#","uri":"/dev/zero""#)).unwrap();
    let message = with(true).unwrap_err();
    assert!(message.contains("a device"), "{message}");
}

/// Each (what is written instead of what, part of the message).
fn refuse((bin, rest): &(Bin, String), changes: &[(&str, &str, &str)]) {
    for (from, to, says) in changes {
        let broken = rest.replace(from, to);
        assert_ne!(&broken, rest, "{from}");
        let message = read(bin, &broken).err().unwrap_or_default();
        let good = message.contains(says) && !message.contains('\n');
        assert!(good, "{says:?} is not in {message:?}");
    }
}

#[test]
fn nodes_and_channels_that_lead_nowhere_are_named() {
    let changes = [
        (
            r#""POSITION":0"#,
            r#""POSITION":9"#,
            "accessor 9 does not exist",
        ),
        (
            r#""sampler":1"#,
            r#""sampler":2"#,
            "animations[0].channels[1].sampler: Index out of bounds",
        ),
        (
            r#""mesh":0"#,
            r#""mesh":4"#,
            "nodes[0].mesh: Index out of bounds",
        ),
        (
            r#""children":[0]"#,
            r#""children":[0,2]"#,
            "its own ancestor",
        ),
        (
            r#""children":[1]"#,
            r#""children":[1,0]"#,
            "node 0: the node has two parents",
        ),
        (
            r#""output":2"#,
            r#""output":3"#,
            "accessor 3: Vec3 elements are expected",
        ),
        (
            r#""input":1"#,
            r#""input":0"#,
            "accessor 0: Scalar elements are expected",
        ),
        (
            r#""material":0"#,
            r#""indices":1"#,
            "accessor 1: unsigned integers are expected",
        ),
        (
            r#""scene":0"#,
            r#""extensionsRequired":["KHR_draco_mesh_compression"]"#,
            "KHR_draco_mesh_compression",
        ),
        (
            r#""sampler":1,"target":{"node":1"#,
            r#""sampler":1,"target":{"node":3"#,
            "node 3 does not exist",
        ),
    ];
    refuse(&moving(), &changes);
}

#[test]
fn joints_that_lead_nowhere_are_named() {
    let changes = [
        (
            r#""joints":[1,2]"#,
            r#""joints":[1]"#,
            "vertex 1 hangs on joint 1",
        ),
        (
            r#""joints":[1,2]"#,
            r#""joints":[1,2,0]"#,
            "2 inverse bind matrices for 3 joints",
        ),
    ];
    refuse(&skinned(), &changes);
}

#[test]
fn weights_that_fit_no_target_are_refused() {
    let changes = [
        (
            r#""node":0,"path""#,
            r#""node":1,"path""#,
            "no morph targets",
        ),
        (
            r#""CUBICSPLINE""#,
            r#""LINEAR""#,
            "2 values are expected for 2 times, 6 are there",
        ),
        (r#""weights""#, r#""warp""#, "unknown path"),
    ];
    refuse(&morphing(), &changes);
}

#[test]
fn accessors_that_leave_their_buffer_are_refused() {
    let (bin, rest) = morphing();
    let json = bin.json(&rest, "");
    let read = |json: &str| read_with(&glb(json, &bin.bytes), &Options::default());
    assert!(read(&json).is_ok());
    for (from, to, says) in [
        (
            r#""VEC3","count":3}"#,
            r#""VEC3","count":4}"#,
            "4 elements of 12 bytes",
        ),
        (
            r#""VEC3","count":3}"#,
            r#""VEC3","count":18446744073709551615}"#,
            "do not fit",
        ),
        (
            r#""byteOffset":0"#,
            r#""byteOffset":18446744073709551615"#,
            "buffer view 0 ends beyond",
        ),
        (
            r#""byteLength":36}"#,
            r#""byteLength":36,"byteStride":4}"#,
            "stride of 4",
        ),
        (r#""count":1,"#, r#""count":2,"#, "2 elements of 1 bytes"),
        (r#""count":1,"#, r#""count":0,"#, "no element is replaced"),
        (
            r#""count":3,"sparse""#,
            r#""count":2,"sparse""#,
            "sparse index 2",
        ),
        (
            r#""count":3,"sparse""#,
            r#""count":18446744073709551615,"sparse""#,
            "limit",
        ),
        (
            r#""count":3,"sparse""#,
            r#""count":4,"sparse""#,
            "4 elements for 3 vertices",
        ),
    ] {
        let broken = json.replacen(from, to, 1);
        assert_ne!(broken, json, "{from}");
        let message = read(&broken).err().unwrap_or_default();
        assert!(message.contains(says), "{says:?} is not in {message:?}");
    }
    let falling = [1.0_f32, 0.5].map(f32::to_le_bytes).concat();
    let rising = [0.0_f32, 2.0].map(f32::to_le_bytes).concat();
    let mut bytes = glb(&json, &bin.bytes);
    let at = bytes.windows(8).position(|w| w == rising).unwrap();
    bytes[at..at + 8].copy_from_slice(&falling);
    assert!(
        read_with(&bytes, &Options::default())
            .unwrap_err()
            .contains("do not rise")
    );
}

#[test]
fn a_file_cut_anywhere_or_with_any_digit_changed_never_panics() {
    for (bin, rest) in [moving(), skinned(), morphing()] {
        let json = bin.json(&rest, "");
        let whole = glb(&json, &bin.bytes);
        for end in (0..whole.len()).step_by(3) {
            let message = read_with(&whole[..end], &Options::default()).unwrap_err();
            assert!(!message.is_empty());
        }
        for (at, _) in json.char_indices().filter(|(_, c)| c.is_ascii_digit()) {
            for digits in ["7", "18446744073709551615"] {
                let broken = format!("{}{digits}{}", &json[..at], &json[at + 1..]);
                // Some of these are scenes too.
                let _ = read_with(&glb(&broken, &bin.bytes), &Options::default());
            }
        }
    }
}

#[test]
fn a_container_that_lies_about_its_length_is_refused() {
    let (bin, rest) = moving();
    let mut bytes = glb(&bin.json(&rest, ""), &bin.bytes);
    for (length, says) in [
        (5_u32, "within its header"),
        (u32::MAX, "4294967295 bytes are declared"),
    ] {
        bytes[8..12].copy_from_slice(&length.to_le_bytes());
        let message = read_with(&bytes, &Options::default()).unwrap_err();
        assert!(message.contains(says), "{message}");
    }
}

#[test]
fn a_small_file_that_takes_more_than_there_is_is_refused_before_it_is_sampled() {
    let mut bin = Bin::default();
    let corners: Vec<f32> = CORNERS.iter().copied().cycle().take(3000).collect();
    let corners = bin.floats(&corners, "VEC3");
    let times = bin.floats(&[0.0, 65_000.0], "SCALAR");
    let moves = bin.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], "VEC3");
    let nodes: Vec<String> = (0..25).map(|_| r#"{"mesh":0}"#.to_owned()).collect();
    let (all, nodes) = (
        (0..25).map(|i| i.to_string()).collect::<Vec<_>>().join(","),
        nodes.join(","),
    );
    let rest = format!(
        r#""scene":0,"scenes":[{{"nodes":[{all}]}}],"nodes":[{nodes}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":{corners}}}}}]}}],
        "animations":[{{"samplers":[{{"input":{times},"output":{moves}}}],
        "channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}}]}}]"#
    );
    let bytes = glb(&bin.json(&rest, ""), &bin.bytes);
    assert!(bytes.len() < 40_000);
    let with = |fps, memory| {
        let memory = Some(memory);
        let options = Options {
            fps,
            memory,
            ..Options::default()
        };
        read_with(&bytes, &options).err().unwrap_or_default()
    };
    let message = with(1.0, 16 << 30);
    let says = "65001 key frames of 24975 vertices: 19.5 GB of memory are needed, 17.2 GB are free";
    assert!(message.contains(says), "{message}");
    let message = with(0.001, 100_000);
    let says = "the meshes of its nodes: 700.0 KB of memory are needed, 100.0 KB are free";
    assert!(message.contains(says), "{message}");
    assert_eq!(with(0.001, 60 << 20), "");
}
