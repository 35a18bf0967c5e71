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
