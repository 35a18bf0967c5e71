//! Paths as words: a scene's name is text, a path may be any bytes.

use std::borrow::Cow;
use std::ffi::OsStr;
use std::fmt::Write;
use std::path::Path;

/// Before a byte that is not UTF-8. No path holds it.
const NUL: char = '\0';

/// The word by which [`crate::open`] and [`crate::files`] know a path or several joined ones. Each byte that is not
/// UTF-8 stands as a NUL and two hexadecimal digits; all else stands as it is.
#[must_use]
pub fn word(path: &OsStr) -> String {
    let mut word = String::new();
    for chunk in path.as_encoded_bytes().utf8_chunks() {
        word += chunk.valid();
        for byte in chunk.invalid() {
            // Writing to a string does not fail.
            let _ = write!(word, "{NUL}{byte:02x}");
        }
    }
    word
}

/// The path that a word stands for.
#[cfg(unix)]
pub(crate) fn path(word: &str) -> Cow<'_, Path> {
    use std::os::unix::ffi::OsStringExt;
    let mut parts = word.split(NUL);
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    if bytes.len() == word.len() {
        return Cow::Borrowed(Path::new(word));
    }
    for part in parts {
        let byte = part.get(..2).and_then(|d| u8::from_str_radix(d, 16).ok());
        match byte.filter(|byte| !byte.is_ascii()) {
            Some(byte) => {
                bytes.push(byte);
                bytes.extend(&part.as_bytes()[2..]);
            }
            // No path: whoever opens it says so.
            None => return Cow::Borrowed(Path::new(word)),
        }
    }
    Cow::Owned(std::ffi::OsString::from_vec(bytes).into())
}

/// The path that a word stands for.
#[cfg(not(unix))]
pub(crate) fn path(word: &str) -> Cow<'_, Path> {
    Cow::Borrowed(Path::new(word))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::ffi::OsStrExt;

    #[test]
    fn every_path_comes_back_from_its_word() {
        for bytes in [
            &b"plain \xc3\xa9.obj"[..],
            b"\xff",
            b"a\xe9b.obj+c\xff\xfe.ply@1,2,3",
            b"cut\xc3",
            b"",
        ] {
            let name = OsStr::from_bytes(bytes);
            assert_eq!(path(&word(name)).as_os_str(), name);
        }
        assert_eq!(word(OsStr::from_bytes(b"a\xff.obj")), "a\0ff.obj");
        for none in ["a\0", "a\0zz", "a\x0041"] {
            assert_eq!(path(none), Path::new(none));
        }
    }
}
