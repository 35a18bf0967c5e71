//! From the word that names a scene to the files that make it.

use crate::sequence::Format;
use crate::{Options, Scene, SceneError, clip, demo, sequence};
use std::fs;
use std::path::{Path, PathBuf};

/// See [`crate::open`].
pub(crate) fn open(spec: &str, options: &Options) -> Result<Scene, SceneError> {
    if let Some(name) = spec.strip_prefix("demo:") {
        return demo::open(name);
    }
    let path = Path::new(spec);
    match fs::metadata(path) {
        Ok(about) if about.is_dir() => directory(path),
        Ok(_) => file(path, options),
        Err(_) if spec.contains(['*', '?', '[']) => pattern(spec, options),
        Err(e) => Err(SceneError::unreadable(path, e)),
    }
}

/// Lower-case extension.
fn extension(path: &Path) -> String {
    path.extension()
        .map(|e| e.to_string_lossy().to_lowercase())
        .unwrap_or_default()
}

fn format_of(path: &Path) -> Option<Format> {
    match extension(path).as_str() {
        "obj" => Some(Format::Obj),
        "ply" => Some(Format::Ply),
        _ => None,
    }
}

fn is_gltf(path: &Path) -> bool {
    matches!(extension(path).as_str(), "gltf" | "glb")
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
        .into_owned()
}

fn file(path: &Path, options: &Options) -> Result<Scene, SceneError> {
    if is_gltf(path) {
        return clip::open(stem(path), path, options);
    }
    match format_of(path) {
        Some(format) => sequence::open(stem(path), vec![path.to_owned()], format),
        None => Err(SceneError::UnsupportedExtension {
            path: path.to_owned(),
        }),
    }
}

fn directory(path: &Path) -> Result<Scene, SceneError> {
    let unreadable = |e| SceneError::unreadable(path, e);
    let mut files = Vec::new();
    for entry in fs::read_dir(path).map_err(unreadable)? {
        let file = entry.map_err(unreadable)?.path();
        // Hidden files are no key frames: some systems leave "._1.obj" beside "1.obj".
        let hidden = file
            .file_name()
            .is_some_and(|n| n.to_string_lossy().starts_with('.'));
        if !hidden && !file.is_dir() {
            files.push(file);
        }
    }
    if files.is_empty() {
        return Err(SceneError::EmptyDirectory {
            path: path.to_owned(),
        });
    }
    let whole = fs::canonicalize(path).map_err(unreadable)?;
    let name = whole
        .file_name()
        .unwrap_or(path.as_os_str())
        .to_string_lossy();
    frames(name.into_owned(), &path.display().to_string(), files)
}

fn pattern(spec: &str, options: &Options) -> Result<Scene, SceneError> {
    let pattern = spec.to_owned();
    let matches = glob::glob(spec).map_err(|e| SceneError::BadPattern {
        pattern: pattern.clone(),
        cause: e.to_string(),
    })?;
    let mut files = Vec::new();
    for found in matches {
        let found = found.map_err(|e| {
            let path = e.path().to_owned();
            SceneError::unreadable(&path, e.into())
        })?;
        if !found.is_dir() {
            files.push(found);
        }
    }
    match files.as_slice() {
        [] => Err(SceneError::NoMatch { pattern }),
        [only] => file(only, options),
        [first, ..] => {
            let name = first.parent().and_then(Path::file_name);
            let name = name.map_or_else(|| stem(first), |n| n.to_string_lossy().into_owned());
            frames(name, spec, files)
        }
    }
}

/// Key frames from the meshes among `files`, in natural order: `2.obj` before `10.obj`.
fn frames(name: String, place: &str, files: Vec<PathBuf>) -> Result<Scene, SceneError> {
    let count = |format| {
        files
            .iter()
            .filter(|f| format_of(f) == Some(format))
            .count()
    };
    let (obj, ply) = (count(Format::Obj), count(Format::Ply));
    let place = place.to_owned();
    let format = match (obj, ply) {
        (0, 0) => {
            let gltf = files.iter().find(|f| is_gltf(f));
            let hint = gltf.map_or_else(String::new, |f| {
                format!("; name {} itself to open it", f.display())
            });
            return Err(SceneError::NoMeshes {
                place,
                files: files.len(),
                hint,
            });
        }
        (_, 0) => Format::Obj,
        (0, _) => Format::Ply,
        _ => return Err(SceneError::MixedFormats { place, obj, ply }),
    };
    let mut files: Vec<_> = files
        .into_iter()
        .filter(|f| format_of(f) == Some(format))
        .collect();
    alphanumeric_sort::sort_path_slice(&mut files);
    sequence::open(name, files, format)
}
