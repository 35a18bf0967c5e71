//! Opens one input: a demo, a file, a directory or a glob.

use crate::paths::{
    decode_path, extension, is_gltf, is_pattern, matching_files, stem, visible_files,
};
use crate::{Result, Scene, SceneError, SceneOptions, demo, gltf, sequence};
use alphanumeric_sort::compare_str;
use std::fs;
use std::path::{Path, PathBuf};

pub(crate) fn open_one(spec: &str, options: &SceneOptions) -> Result<Scene> {
    if let Some(name) = spec.strip_prefix("demo:") {
        refuse_clip(spec, options)?;
        return demo::open(name, options);
    }
    let path = &decode_path(spec);
    match fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => directory(path, options),
        Ok(_) => file(path, options),
        Err(_) if is_pattern(spec) => pattern(spec, options),
        Err(e) => Err(SceneError::unreadable(path, e)),
    }
}

/// Returns whether an input is a single glTF file, named by its path or by a glob.
pub(crate) fn is_gltf_input(spec: &str) -> bool {
    let is_only_match = || {
        let matched = matching_files(spec).unwrap_or_default();
        matches!(matched.as_slice(), [only] if is_gltf(only))
    };
    is_gltf(&decode_path(spec)) || is_pattern(spec) && is_only_match()
}

/// Returns an error if `options` name a clip. Used for sources without clips.
pub(crate) fn refuse_clip(place: impl AsRef<Path>, options: &SceneOptions) -> Result<()> {
    options.clip.as_ref().map_or(Ok(()), |asked| {
        let cause = format!("no clip {asked:?}: only .gltf and .glb files have clips");
        Err(SceneError::unusable(place, cause))
    })
}

fn file(path: &Path, options: &SceneOptions) -> Result<Scene> {
    match extension(path).as_str() {
        "gltf" | "glb" => gltf::open(stem(path), path, options),
        "obj" | "ply" => {
            refuse_clip(path, options)?;
            sequence::open(stem(path), vec![path.to_owned()], options)
        }
        _ => {
            let cause = "unsupported file type; a scene is a .obj, .ply, .gltf or .glb file";
            Err(SceneError::unusable(path, cause))
        }
    }
}

fn directory(path: &Path, options: &SceneOptions) -> Result<Scene> {
    let files = visible_files(path)?;
    if files.is_empty() {
        return Err(SceneError::unusable(
            path,
            "the directory contains no visible files",
        ));
    }
    let whole = fs::canonicalize(path).map_err(|e| SceneError::unreadable(path, e))?;
    let name = whole.file_name().unwrap_or(path.as_os_str());
    frames(name.to_string_lossy().into_owned(), path, files, options)
}

fn pattern(spec: &str, options: &SceneOptions) -> Result<Scene> {
    let files = matching_files(spec)?;
    match files.as_slice() {
        [] => Err(SceneError::unusable(spec, "matches no file")),
        [only] => file(only, options),
        [first, ..] => {
            let name = first.parent().and_then(Path::file_name);
            let name = name.map_or_else(|| stem(first), |n| n.to_string_lossy().into_owned());
            frames(name, spec.as_ref(), files, options)
        }
    }
}

/// Opens the meshes among `files` as key frames in natural order: `2.obj` before `10.obj`.
fn frames(
    name: String,
    place: &Path,
    mut files: Vec<PathBuf>,
    options: &SceneOptions,
) -> Result<Scene> {
    let count_of = |kind: &str| files.iter().filter(|f| extension(f) == kind).count();
    let bad = |cause: String| Err(SceneError::unusable(place, cause));
    let kind = match (count_of("obj"), count_of("ply")) {
        (0, 0) => {
            let gltf = files.iter().find(|f| is_gltf(f));
            let hint = gltf.map(|f| format!("; to open {}, give its own path", f.display()));
            let (count, hint) = (files.len(), hint.unwrap_or_default());
            return bad(format!("no .obj or .ply file among {count} files{hint}"));
        }
        (_, 0) => "obj",
        (0, _) => "ply",
        (obj, ply) => {
            return bad(format!(
                "{obj} .obj and {ply} .ply files are mixed; \
                 all key frames must have one format, which a pattern such as '*.obj' selects"
            ));
        }
    };
    files.retain(|f| extension(f) == kind);
    refuse_clip(place, options)?;
    // Sorts by bytes first. The natural order treats names as equal if they differ only in bytes that are not UTF-8,
    // and the stable sort keeps their order.
    files.sort();
    files.sort_by(|a, b| compare_str(a.to_string_lossy(), b.to_string_lossy()));
    sequence::open(name, files, options)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{ascii_ply, open_in, put, refused};
    use tempfile::TempDir;

    const TRIANGLE: &str = "f 1 2 3\n";

    /// Returns an OBJ file whose first vertex is at `x`.
    fn obj(x: u32, faces: &str) -> String {
        format!("v {x} 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n{faces}")
    }

    fn folder(files: &[(&str, String)]) -> TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            put(&folder, name, text);
        }
        folder
    }

    /// Returns the x coordinate of the first vertex of each key frame.
    fn first_xs(scene: &Scene) -> Vec<f32> {
        let keys = scene.animation.all_keys().unwrap();
        keys.iter().map(|key| key[0][0]).collect()
    }

    #[test]
    fn directory_files_are_naturally_ordered() {
        let files = [("10.obj", 10), ("2.obj", 2), ("1.OBJ", 1), (".3.obj", 3)];
        let files = files.map(|(name, x)| (name, obj(x, TRIANGLE)));
        let others = [("read.me", String::new()), ("x.obj/4.txt", String::new())];
        let folder = folder(&files.into_iter().chain(others).collect::<Vec<_>>());
        let open = |below| open_in(&folder, below, &SceneOptions::default()).unwrap();
        let scene = open("");
        assert_eq!(first_xs(&scene), [1.0, 2.0, 10.0]);
        assert_eq!(scene.facts.files.len(), 3);
        let name = folder.path().file_name().and_then(|n| n.to_str());
        assert_eq!(Some(scene.name.as_str()), name);
        for (spec, found) in [
            ("*0.obj", &[10.0][..]),
            ("[0-9]*.obj", &[2.0, 10.0]),
            ("2.obj", &[2.0]),
        ] {
            assert_eq!(first_xs(&open(spec)), found);
        }
        assert_eq!(open("2.obj").name, "2");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn names_that_are_not_utf8_are_naturally_ordered() {
        use std::ffi::OsStr;
        use std::os::unix::ffi::OsStrExt;
        let folder = folder(&[]);
        for x in [10, 2, 1] {
            let name = [&b"\xff"[..], format!("{x}.obj").as_bytes()].concat();
            let path = folder.path().join(OsStr::from_bytes(&name));
            fs::write(path, obj(x, TRIANGLE)).unwrap();
        }
        let scene = open_in(&folder, "", &SceneOptions::default()).unwrap();
        assert_eq!(first_xs(&scene), [1.0, 2.0, 10.0]);
    }

    #[test]
    fn rejects_key_frames_of_other_topology() {
        for (text, says) in [
            (obj(2, TRIANGLE) + "v 0 0 0\n", ["5 vertices", "1.obj"]),
            (obj(2, "f 1 2 3 4\n"), ["2 triangles", "has 1"]),
            (
                obj(2, "f 1 3 2\n"),
                ["face 0 joins other vertices", "1.obj"],
            ),
            (
                obj(2, "f 1 2 4\n"),
                ["face 0 joins other vertices", "1.obj"],
            ),
            (obj(2, "f 1 2\n"), ["0 triangles, but", "has 1"]),
            (String::new(), ["0 triangles, but", ""]),
            (obj(2, ""), ["1.obj has 1;", ""]),
        ] {
            let files = [
                ("1.obj", obj(0, TRIANGLE)),
                ("2.obj", obj(1, TRIANGLE)),
                ("3.obj", text),
            ];
            let opened = open_in(&folder(&files), "", &SceneOptions::default());
            refused(opened, &["3.obj", says[0], says[1]]);
        }
    }

    #[test]
    fn first_key_frame_determines_triangulation() {
        // The second vertex forms a notch at y = 1 but not at y = 3.
        let arrow = |y: u32, faces: &str| format!("v 2 2 0\nv 0 {y} 0\nv -2 2 0\nv 0 0 0\n{faces}");
        let ply = |y: u32, face: &str| ascii_ply(&format!("2 2 0\n0 {y} 0\n-2 2 0\n0 0 0\n"), face);
        // Opens ten key frames of which the first differs. Sequences of more than eight key frames may be paged.
        let opened = |kind: &str, first: String, later: &str, key_bytes| {
            let folder = tempfile::tempdir().unwrap();
            put(&folder, &format!("0.{kind}"), first);
            for key in 1..10 {
                put(&folder, &format!("{key}.{kind}"), later);
            }
            let options = SceneOptions {
                key_bytes,
                ..SceneOptions::default()
            };
            open_in(&folder, "", &options)
        };
        for key_bytes in [1, 1 << 20] {
            for (first, later, expected) in [
                (1, 3, [[0, 1, 3], [1, 2, 3]]),
                (3, 1, [[0, 1, 2], [0, 2, 3]]),
            ] {
                let face = "f 1 2 3 4\n";
                let obj = opened("obj", arrow(first, face), &arrow(later, face), key_bytes);
                let face = "4 0 1 2 3\n";
                let ply = opened("ply", ply(first, face), &ply(later, face), key_bytes);
                for scene in [obj.unwrap(), ply.unwrap()] {
                    assert_eq!(scene.animation.triangles(), expected);
                    let last = scene.animation.at(9.0).unwrap();
                    assert_eq!(last.vertex(1), [0.0, later as f32, 0.0]);
                }
            }
            // Equal triangles from different polygons are not the same topology.
            let triangles = arrow(3, "f 1 2 3\nf 1 3 4\n");
            let other = opened("obj", arrow(3, "f 1 2 3 4\n"), &triangles, key_bytes);
            refused(other, &["1.obj", "face 0 joins other vertices"]);
        }
    }

    #[test]
    fn utf16_text_is_rejected() {
        let utf16 = |text: &str| text.chars().flat_map(|c| [c, '\0']).collect::<String>();
        let folder = folder(&[
            ("a.obj", utf16(&obj(0, TRIANGLE))),
            ("a.ply", utf16("ply\nformat ascii 1.0\n")),
        ]);
        for name in ["a.obj", "a.ply"] {
            let opened = open_in(&folder, name, &SceneOptions::default());
            refused(opened, &["UTF-16", "UTF-8"]);
        }
    }

    #[test]
    fn git_lfs_pointers_are_reported() {
        let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n";
        let triangle = obj(0, TRIANGLE);
        let gltf = r#"{"asset":{"version":"2.0"},"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
            "accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":3}],
            "bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"uri":"a.bin","byteLength":36}]}"#;
        let folder = folder(&[
            ("a.obj", pointer.to_owned()),
            ("a.ply", pointer.to_owned()),
            ("a.gltf", pointer.to_owned()),
            ("a.glb", pointer.to_owned()),
            ("a.bin", pointer.to_owned()),
            ("buffer.gltf", gltf.to_owned()),
            ("keys/1.obj", triangle.clone()),
            ("keys/2.obj", pointer.to_owned()),
            ("m.mtl", pointer.to_owned()),
            (
                "materials.obj",
                format!("mtllib m.mtl\nusemtl m\n{triangle}"),
            ),
        ]);
        let options = SceneOptions::default();
        for name in ["a.obj", "a.ply", "a.gltf", "a.glb", "buffer.gltf", "keys"] {
            refused(open_in(&folder, name, &options), &["Git LFS pointer"]);
        }
        let scene = open_in(&folder, "materials.obj", &options).unwrap();
        let names_pointer = |n: &String| n.contains("m.mtl") && n.contains("Git LFS pointer");
        assert!(scene.facts.notes.iter().any(names_pointer));
    }

    #[test]
    fn rejects_non_scenes_with_a_reason() {
        let folder = folder(&[
            ("other/a.txt", String::new()),
            ("other/a.glb", String::new()),
            ("void.obj", String::new()),
            ("cloud.obj", obj(0, "")),
        ]);
        for (path, says) in [
            ("other", "no .obj or .ply file among 2 files; to open"),
            ("other/a.glb", "not glTF"),
            ("a[", "not a pattern"),
            ("void.obj", "no triangles"),
            ("cloud.obj", "no triangles, though there are 4 vertices"),
            ("void.obj/below.obj", "cannot read"),
        ] {
            refused(open_in(&folder, path, &SceneOptions::default()), &[says]);
        }
        let open = |spec| crate::open(spec, &SceneOptions::default());
        refused(open("demo:"), &["twist"]);
        refused(open(""), &["no such file"]);
    }
}
