//! Names of inputs: encoding of paths as strings, patterns, and file extensions.

use crate::{Result, SceneError};
use std::borrow::Cow;
use std::ffi::OsStr;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

/// Escape character before a byte that is not UTF-8. Paths never contain it.
const NUL: char = '\0';

/// Encodes a path, or several joined by `+`, as a scene name for [`crate::open`] and [`crate::files`]. Each byte that
/// is not UTF-8 becomes a NUL and two hexadecimal digits. All other characters are unchanged.
#[must_use]
pub fn encode_path(path: &OsStr) -> String {
    encode(path.as_encoded_bytes()).into_owned()
}

/// Encodes text like [`encode_path`]. Different texts without NUL remain different, even if they are not
/// UTF-8.
pub(crate) fn encode(text: &[u8]) -> Cow<'_, str> {
    if let Ok(text) = std::str::from_utf8(text) {
        return Cow::Borrowed(text);
    }
    let mut word = String::new();
    for chunk in text.utf8_chunks() {
        word += chunk.valid();
        for byte in chunk.invalid() {
            // Writing to a string cannot fail.
            let _ = write!(word, "{NUL}{byte:02x}");
        }
    }
    Cow::Owned(word)
}

/// Decodes a path that [`encode`] encoded.
#[cfg(unix)]
pub(crate) fn decode_path(word: &str) -> PathBuf {
    use std::os::unix::ffi::OsStringExt;
    let decoded = || {
        let mut parts = word.split(NUL);
        let mut bytes = parts.next()?.as_bytes().to_vec();
        for part in parts {
            let byte = u8::from_str_radix(part.get(..2)?, 16).ok()?;
            bytes.push(Some(byte).filter(|byte| !byte.is_ascii())?);
            bytes.extend(&part.as_bytes()[2..]);
        }
        Some(std::ffi::OsString::from_vec(bytes).into())
    };
    // A name with a malformed escape encodes no path. It is returned unchanged, and opening it reports the error.
    decoded().unwrap_or_else(|| word.into())
}

#[cfg(not(unix))]
pub(crate) fn decode_path(word: &str) -> PathBuf {
    word.into()
}

/// Returns whether `spec`, as a whole, is the name of one input: a demo of any name, an existing path,
/// or a glob with a match.
pub(crate) fn exists(spec: &str) -> bool {
    let matches = || glob::glob(spec).is_ok_and(|mut all| all.next().is_some());
    let is_demo = spec.starts_with("demo:") && !spec.contains(['+', '@']);
    is_demo || decode_path(spec).exists() || is_pattern(spec) && matches()
}

/// Returns whether `spec` is a glob.
pub(crate) fn is_pattern(spec: &str) -> bool {
    spec.contains(['*', '?', '['])
}

/// Returns the extension in lower case.
pub(crate) fn extension(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default();
    extension.to_string_lossy().to_lowercase()
}

pub(crate) fn is_gltf(path: &Path) -> bool {
    matches!(extension(path).as_str(), "gltf" | "glb")
}

pub(crate) fn stem(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or(path.as_os_str());
    stem.to_string_lossy().into_owned()
}

/// Returns the files of a directory, except hidden ones. Some systems create `._1.obj` next to `1.obj`.
pub(crate) fn visible_files(directory: &Path) -> Result<Vec<PathBuf>> {
    let unreadable = |e| SceneError::unreadable(directory, e);
    let is_hidden = |f: &Path| {
        let name = f.file_name().unwrap_or_default();
        name.to_string_lossy().starts_with('.')
    };
    let all = fs::read_dir(directory).map_err(unreadable)?;
    let paths = all.map(|entry| entry.map(|e| e.path()));
    let paths = paths.collect::<Result<Vec<_>, _>>();
    let mut files = paths.map_err(unreadable)?;
    files.retain(|f| !is_hidden(f) && !f.is_dir());
    Ok(files)
}

/// Returns the files that a glob matches.
pub(crate) fn matching_files(pattern: &str) -> Result<Vec<PathBuf>> {
    let bad = |e| SceneError::unusable(pattern, format!("not a pattern of paths: {e}"));
    let unreadable = |e: glob::GlobError| {
        let path = e.path().to_owned();
        SceneError::unreadable(&path, e.into())
    };
    let all = glob::glob(pattern).map_err(bad)?;
    let mut files = all.collect::<Result<Vec<_>, _>>().map_err(unreadable)?;
    files.retain(|f| !f.is_dir());
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn path_encoding_round_trips() {
        use std::os::unix::ffi::OsStrExt;
        for bytes in [
            &b"plain \xc3\xa9.obj"[..],
            b"\xff",
            b"a\xe9b.obj+c\xff\xfe.ply@1,2,3",
            b"cut\xc3",
            b"",
        ] {
            let name = OsStr::from_bytes(bytes);
            assert_eq!(decode_path(&encode_path(name)).as_os_str(), name);
        }
        assert_eq!(encode_path(OsStr::from_bytes(b"a\xff.obj")), "a\0ff.obj");
        for malformed in ["a\0", "a\0zz", "a\x0041"] {
            assert_eq!(decode_path(malformed), Path::new(malformed));
        }
    }
}
