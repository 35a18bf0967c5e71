//! The list of files that a scene depends on.

use crate::folder::Folder;
use crate::gltf::buffer_files;
use crate::join::inputs;
use crate::obj::{library_names, statements};
use crate::paths::{decode_path, exists, extension, is_pattern, matching_files, visible_files};
use crate::{Result, SceneError};
use std::fs;
use std::path::{Path, PathBuf};

/// Returns all files that determine the content of the scene `spec`: key frames, materials and buffers.
///
/// The list is sorted and has no duplicates. Demos have no files. Fails if an input does not exist, but a glob may have
/// no match. Material libraries and buffers are listed only if they exist and can be opened. Unless `allow_outside` is
/// set, those outside their scene's folder are not listed, because [`open`](crate::open) does not read them.
pub fn files(spec: &str, allow_outside: bool) -> Result<Vec<PathBuf>> {
    let mut list = FileList {
        allow_outside,
        all: Vec::new(),
    };
    for input in inputs(spec, &exists)? {
        list.add_input(input.spec)?;
    }
    list.all.sort();
    list.all.dedup();
    Ok(list.all)
}

/// Returns the files of the scene `spec` that no output may overwrite, including those outside its folder. Unlike
/// [`files`], returns all files that it finds if the scene is invalid.
pub fn protected_files(spec: &str) -> Vec<PathBuf> {
    let mut list = FileList {
        allow_outside: true,
        all: Vec::new(),
    };
    let names: Vec<&str> = match inputs(spec, &exists) {
        Ok(inputs) => inputs.iter().map(|input| input.spec).collect(),
        // A placement is invalid, or an input has no name.
        Err(_) => spec
            .split('+')
            .map(|text| text.rsplit_once('@').map_or(text, |(name, _)| name))
            .collect(),
    };
    for name in names {
        // Opening the scene reports this error.
        let _ = list.add_input(name);
    }
    list.all
}

/// Files found so far.
struct FileList {
    allow_outside: bool,
    all: Vec<PathBuf>,
}

impl FileList {
    fn add_input(&mut self, spec: &str) -> Result<()> {
        if spec.starts_with("demo:") {
            return Ok(());
        }
        let path = &decode_path(spec);
        match fs::metadata(path) {
            Ok(metadata) if metadata.is_dir() => self.add_key_frames(&visible_files(path)?),
            Ok(_) => self.add_with_companions(path),
            Err(_) if is_pattern(spec) => match matching_files(spec)?.as_slice() {
                [only] => self.add_with_companions(only),
                several => self.add_key_frames(several),
            },
            Err(e) => Err(SceneError::unreadable(path, e)),
        }
    }

    /// Adds the key frames among several files. Returns the first error, after all files.
    fn add_key_frames(&mut self, files: &[PathBuf]) -> Result<()> {
        let is_mesh = |f: &&PathBuf| matches!(extension(f).as_str(), "obj" | "ply");
        let added = files
            .iter()
            .filter(is_mesh)
            .map(|f| self.add_with_companions(f));
        added.fold(Ok(()), Result::and)
    }

    /// Adds a file and the files that it refers to.
    fn add_with_companions(&mut self, file: &Path) -> Result<()> {
        let unreadable = |e| SceneError::unreadable(file, e);
        self.all.push(file.to_owned());
        if !file.is_file() {
            return Ok(());
        }
        let folder = Folder::of(file, self.allow_outside);
        let mut names = match extension(file).as_str() {
            "obj" => {
                let statements = material_statements(file).map_err(unreadable)?;
                let names = statements.iter().map(|text| library_names(&folder, text));
                names.flatten().collect()
            }
            "gltf" | "glb" => buffer_files(file).map_err(unreadable)?,
            _ => Vec::new(),
        };
        names.retain(|name| folder.permitted(name).is_ok());
        let folder = file.parent().unwrap_or(Path::new(""));
        let files = names.iter().map(|name| folder.join(decode_path(name)));
        // A library that cannot be opened does not affect the scene.
        self.all.extend(files.filter(|f| host::open(f).is_ok()));
        Ok(())
    }
}

/// Returns the text after each `mtllib`.
fn material_statements(obj: &Path) -> std::io::Result<Vec<String>> {
    let mut names = Vec::new();
    for (_, statement) in statements(&host::read(obj)?) {
        if let Some(("mtllib", name)) = statement.trim().split_once(char::is_whitespace) {
            names.push(name.trim().to_owned());
        }
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::put;

    #[test]
    fn lists_meshes_and_referenced_files() {
        let dir = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| put(&dir, name, text);
        let a = put("a/1.obj", "mtllib x.mtl\nv 0 0 0\n");
        let b = put("a/2.obj", "# head\r mtllib\ty.mtl\rv 0 0 0\r");
        let y = put("a/y.mtl", "newmtl m\r");
        let x = put("a/x.mtl", "newmtl m\n");
        put("a/notes.txt", "");
        put("a/.3.obj", "");
        let buffers = r#"{"asset":{"version":"2.0"},
            "buffers":[{"byteLength":4,"uri":"d%20e.bin"},{"byteLength":0,"uri":"data:,"}]}"#;
        let g = put("g.gltf", buffers);
        let d = put("d e.bin", "");
        let name = |p: &Path| p.display().to_string();
        let files = |spec: &str| files(spec, false);
        let folder = files(&name(&dir.path().join("a"))).unwrap();
        assert_eq!(folder, [&a, &b, &x, &y].map(PathBuf::clone));
        assert_eq!(files(&name(&dir.path().join("a/[0-9n]*"))).unwrap(), folder);
        assert_eq!(files(&name(&a)).unwrap(), [a, x]);
        let invalid = format!("nowhere.obj+{}@1,0", name(&b));
        assert_eq!(protected_files(&invalid), [&b, &y].map(PathBuf::clone));
        let both = format!("{}+demo:hall+{}@1,0,0", name(&g), name(&b));
        assert_eq!(files(&both).unwrap(), [b, y, d, g]);
        assert!(files("demo:twist").unwrap().is_empty());
        assert!(files("nowhere.obj").is_err());
    }

    #[test]
    fn finds_referenced_files_like_the_readers() {
        let dir = tempfile::tempdir().unwrap();
        let put = |name: &str, bytes: &[u8]| put(&dir, name, bytes);
        let listed = |file: &Path| files(&file.display().to_string(), false).unwrap();
        let [x, y] = ["a/x.mtl", "a/y.mtl"].map(|name| put(name, b""));
        let spaces = put("two words.mtl", b"");
        let obj = put("b.obj", b"mtllib a/x.mtl a\\y.mtl\nmtllib two words.mtl\n");
        assert_eq!(listed(&obj), [&x, &y, &obj, &spaces].map(PathBuf::clone));
        let text =
            b"mtllib\\\na/x.mtl \\\r\na/y.mtl\nmtllibs z.mtl\nf 1 2 \\\nmtllib two words.mtl\n";
        let continued = put("d.obj", text);
        assert_eq!(listed(&continued), [x.clone(), y, continued.clone()]);
        let marked = put("c.obj", "\u{feff}mtllib a/x.mtl\n".as_bytes());
        assert_eq!(listed(&marked), [x, marked.clone()]);
        let json = br#"{"asset":{"version":"2.0"},"buffers":[{"byteLength":4,"uri":"d%20e.bin"}]}"#;
        let word = |n: usize| (n as u32).to_le_bytes();
        let header = [*b"glTF", word(2), word(20 + json.len()), word(json.len())].concat();
        let buffer = put("d e.bin", b"");
        let glb = put("g.glb", &[&header[..], b"JSON", json].concat());
        assert_eq!(listed(&glb), [buffer, glb.clone()]);
    }

    #[test]
    fn outside_files_require_permission() {
        let dir = tempfile::tempdir().unwrap();
        put(&dir, "out.mtl", "");
        let obj = put(&dir, "a/1.obj", "mtllib ../out.mtl\n");
        let spec = obj.display().to_string();
        let outside = dir.path().join("a/../out.mtl");
        assert_eq!(files(&spec, false).unwrap(), std::slice::from_ref(&obj));
        assert_eq!(files(&spec, true).unwrap(), [outside, obj]);
    }
}
