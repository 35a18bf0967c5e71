//! The files that a scene is made of, found without reading its meshes.

use crate::join::inputs;
use crate::source::{entries, exists, extension, matches};
use crate::{SceneError, word};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// All files that decide what the scene named by `spec` holds: key frames, materials, buffers, times; sorted, each once.
/// A demo has none.
///
/// # Errors
/// [`SceneError`]: an input cannot be found or read.
pub fn files(spec: &str) -> Result<Vec<PathBuf>, SceneError> {
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

fn of_input(spec: &str, all: &mut Vec<PathBuf>) -> Result<(), SceneError> {
    let path = &*word::path(spec);
    match fs::metadata(path) {
        Ok(about) if about.is_dir() => in_folder(path, all),
        Ok(_) => with_companions(path, all),
        Err(_) if spec.contains(['*', '?', '[']) => {
            let files = matches(spec)?
                .filter_map(Result::ok)
                .filter(|f| f.is_file());
            files.into_iter().try_for_each(|f| with_companions(&f, all))
        }
        Err(e) => Err(SceneError::unreadable(path, e)),
    }
}

fn in_folder(folder: &Path, all: &mut Vec<PathBuf>) -> Result<(), SceneError> {
    for file in entries(folder)?.into_iter().filter(|f| f.is_file()) {
        match extension(&file).as_str() {
            "obj" | "ply" => with_companions(&file, all)?,
            "json" => all.push(file),
            _ => {}
        }
    }
    Ok(())
}

/// A file and those that it names.
fn with_companions(file: &Path, all: &mut Vec<PathBuf>) -> Result<(), SceneError> {
    let unreadable = |e| SceneError::unreadable(file, e);
    all.push(file.to_owned());
    if !file.is_file() {
        return Ok(());
    }
    let names = match extension(file).as_str() {
        "obj" => materials(file).map_err(unreadable)?,
        "gltf" => uris(&fs::read(file).map_err(unreadable)?),
        _ => Vec::new(),
    };
    let folder = file.parent().unwrap_or(Path::new(""));
    all.extend(names.iter().map(|n| folder.join(n)).filter(|f| f.is_file()));
    Ok(())
}

fn materials(obj: &Path) -> std::io::Result<Vec<String>> {
    let mut names = Vec::new();
    for line in BufReader::new(fs::File::open(obj)?).split(b'\n') {
        if let Some(name) = line?.strip_prefix(b"mtllib ") {
            names.push(String::from_utf8_lossy(name).trim().to_owned());
        }
    }
    Ok(names)
}

fn uris(gltf: &[u8]) -> Vec<String> {
    let document: serde_json::Value = serde_json::from_slice(gltf).unwrap_or_default();
    let buffers = document["buffers"].as_array().into_iter().flatten();
    let uris = buffers.filter_map(|b| b["uri"].as_str());
    let decoded = uris.map(|u| percent_encoding::percent_decode_str(u).decode_utf8_lossy());
    decoded
        .filter(|u| !u.starts_with("data:"))
        .map(Into::into)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_is_made_of_its_meshes_and_of_what_they_name() {
        let dir = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| {
            let file = dir.path().join(name);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(&file, text).unwrap();
            file
        };
        let a = put("a/1.obj", "mtllib x.mtl\nv 0 0 0\n");
        let b = put("a/2.obj", "v 0 0 0\n");
        let x = put("a/x.mtl", "newmtl m\n");
        put("a/notes.txt", "");
        let g = put(
            "g.gltf",
            r#"{"buffers":[{"uri":"d%20e.bin"},{"uri":"data:,"}]}"#,
        );
        let d = put("d e.bin", "");
        let name = |p: &Path| p.display().to_string();
        assert_eq!(
            files(&name(&dir.path().join("a"))).unwrap(),
            [a.clone(), b.clone(), x.clone()]
        );
        assert_eq!(files(&name(&a)).unwrap(), [a, x]);
        let both = format!("{}+demo:hall+{}@1,0,0", name(&g), name(&b));
        assert_eq!(files(&both).unwrap(), [b, d, g]);
        assert!(files("demo:twist").unwrap().is_empty());
        assert!(files("nowhere.obj").is_err());
    }
}
