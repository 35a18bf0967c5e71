//! The list of files that a scene depends on.

use crate::folder::Folder;
use crate::gltf::buffer_files;
use crate::join::inputs;
use crate::obj::library_names;
use crate::paths::{entries, exists, extension, is_pattern, matches, path};
use crate::text::lines;
use crate::{Result, SceneError};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// Returns all files that determine the content of the scene `spec`: key frames, materials and buffers.
///
/// The list is sorted and has no duplicates. Demos have no files. Fails if an input does not exist, but a glob may have
/// no match. Missing material libraries and buffers are not listed.
pub fn files(spec: &str) -> Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for input in inputs(spec, &exists)? {
        if !input.spec.starts_with("demo:") {
            of_input(input.spec, &mut all)?;
        }
    }
    all.sort();
    all.dedup();
    Ok(all)
}

fn of_input(spec: &str, all: &mut Vec<PathBuf>) -> Result<()> {
    let path = &path(spec);
    match fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => in_folder(path, all),
        Ok(_) => with_companions(path, all),
        Err(_) if is_pattern(spec) => {
            let files = matches(spec)?.filter_map(Result::ok);
            let mut files = files.filter(|f| f.is_file());
            files.try_for_each(|f| with_companions(&f, all))
        }
        Err(e) => Err(SceneError::unreadable(path, e)),
    }
}

fn in_folder(folder: &Path, all: &mut Vec<PathBuf>) -> Result<()> {
    for file in entries(folder)?.into_iter().filter(|f| f.is_file()) {
        if matches!(extension(&file).as_str(), "obj" | "ply") {
            with_companions(&file, all)?;
        }
    }
    Ok(())
}

/// Adds a file and the files that it refers to.
fn with_companions(file: &Path, all: &mut Vec<PathBuf>) -> Result<()> {
    let unreadable = |e| SceneError::unreadable(file, e);
    all.push(file.to_owned());
    if !file.is_file() {
        return Ok(());
    }
    let folder = Folder::of(file, true);
    let names = match extension(file).as_str() {
        "obj" => {
            let statements = material_statements(file).map_err(unreadable)?;
            let names = statements.iter().map(|text| library_names(&folder, text));
            names.flatten().collect()
        }
        "gltf" | "glb" => buffer_files(file).map_err(unreadable)?,
        _ => Vec::new(),
    };
    let folder = file.parent().unwrap_or(Path::new(""));
    all.extend(names.iter().map(|n| folder.join(n)).filter(|f| f.is_file()));
    Ok(())
}

/// Returns the text after each `mtllib`. Splits lines as the OBJ reader does, but does not join continued lines.
fn material_statements(obj: &Path) -> std::io::Result<Vec<String>> {
    let mut names = Vec::new();
    for part in BufReader::new(fs::File::open(obj)?).split(b'\n') {
        let part = part?;
        let found = lines(&part).filter_map(|line| {
            let rest = line.trim_ascii_start().strip_prefix(b"mtllib")?;
            rest.first()
                .is_some_and(u8::is_ascii_whitespace)
                .then_some(rest)
        });
        names.extend(found.map(|name| String::from_utf8_lossy(name).trim().to_owned()));
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
        let buffers = r#"{"asset":{"version":"2.0"},
            "buffers":[{"byteLength":4,"uri":"d%20e.bin"},{"byteLength":0,"uri":"data:,"}]}"#;
        let g = put("g.gltf", buffers);
        let d = put("d e.bin", "");
        let name = |p: &Path| p.display().to_string();
        let folder = files(&name(&dir.path().join("a"))).unwrap();
        assert_eq!(folder, [&a, &b, &x, &y].map(PathBuf::clone));
        assert_eq!(files(&name(&a)).unwrap(), [a, x]);
        let both = format!("{}+demo:hall+{}@1,0,0", name(&g), name(&b));
        assert_eq!(files(&both).unwrap(), [b, y, d, g]);
        assert!(files("demo:twist").unwrap().is_empty());
        assert!(files("nowhere.obj").is_err());
    }

    #[test]
    fn finds_referenced_files_like_the_readers() {
        let dir = tempfile::tempdir().unwrap();
        let put = |name: &str, bytes: &[u8]| put(&dir, name, bytes);
        let listed = |file: &Path| files(&file.display().to_string()).unwrap();
        let [x, y] = ["a/x.mtl", "a/y.mtl"].map(|name| put(name, b""));
        let spaces = put("two words.mtl", b"");
        let obj = put("b.obj", b"mtllib a/x.mtl a\\y.mtl\nmtllib two words.mtl\n");
        assert_eq!(listed(&obj), [x, y, obj.clone(), spaces]);
        let json = br#"{"asset":{"version":"2.0"},"buffers":[{"byteLength":4,"uri":"d%20e.bin"}]}"#;
        let word = |n: usize| (n as u32).to_le_bytes();
        let header = [*b"glTF", word(2), word(20 + json.len()), word(json.len())].concat();
        let buffer = put("d e.bin", b"");
        let glb = put("g.glb", &[&header[..], b"JSON", json].concat());
        assert_eq!(listed(&glb), [buffer, glb.clone()]);
    }
}
