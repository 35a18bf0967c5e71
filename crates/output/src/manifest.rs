//! What a run into a folder is: `abvh-run.json`, which says whether another run may go on with it.

use crate::{NamedDigest, OutputError, WriteError, write_json};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use std::collections::BTreeMap;
use std::io;
use std::path::Path;

const FILE: &str = "abvh-run.json";

/// All that decides a byte of a run's pictures and hits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// That of [`crate::SCHEMA`].
    pub schema: u32,
    /// Of the program.
    pub version: String,
    /// What is rendered.
    pub scene: SceneId,
    /// Whole times of the motion.
    pub key_times: usize,
    /// By name.
    pub options: BTreeMap<String, Value>,
}

/// What is rendered: the name of a demo or of inputs that are joined, and the files that are read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneId {
    /// Of a scene that its files do not tell whole.
    pub name: Option<String>,
    /// Each with its name, in the order in which they are read.
    pub files: Vec<NamedDigest>,
}

impl Manifest {
    /// The one that a folder holds, if any.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn in_folder(folder: &Path) -> Result<Option<Self>, OutputError> {
        let file = folder.join(FILE);
        let text = match host::read(&file) {
            Ok(text) => text,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(OutputError::reading(&file, e)),
        };
        let read = serde_json::from_slice(&text);
        read.map(Some).map_err(|e| {
            let no = format!("{} is no manifest of a run: {e}", file.display());
            OutputError(format!("{no}; --overwrite starts afresh"))
        })
    }

    /// Writes it into a folder.
    ///
    /// # Errors
    /// [`WriteError`]; the folder then holds what it held before.
    pub fn write_to(&self, folder: &Path) -> Result<(), WriteError> {
        write_json(&folder.join(FILE), self)
    }

    /// The first thing in which two runs differ.
    #[must_use]
    pub fn difference(&self, other: &Self) -> Option<String> {
        let (mine, theirs) = (self.named(), other.named());
        let of = |all: &[(String, Value)], name: &str| {
            let found = all.iter().find(|(n, _)| n == name);
            found.map_or("absent".to_owned(), |(_, value)| value.to_string())
        };
        let mut names = mine.iter().chain(&theirs).map(|(name, _)| name);
        names.find_map(|name| {
            let [a, b] = [&mine, &theirs].map(|all| of(all, name));
            (a != b).then(|| format!("its {name} is {a}, here it is {b}"))
        })
    }

    /// All that it says, each with what it is called.
    fn named(&self) -> Vec<(String, Value)> {
        let fixed = [
            ("schema", json!(self.schema)),
            ("program's version", json!(self.version)),
            ("scene", json!(self.scene.name)),
            ("number of key times", json!(self.key_times)),
        ];
        let fixed = fixed.map(|(name, value)| (name.to_owned(), value));
        // Several may have one name, in folders of their own.
        let files = (1..).zip(&self.scene.files);
        let files = files.map(|(i, (name, digest))| (format!("file {i}, {name}"), json!(digest)));
        let options = self.options.iter();
        let options = options.map(|(name, value)| (format!("--{name}"), value.clone()));
        fixed.into_iter().chain(files).chain(options).collect()
    }
}

/// A file's length and digest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Digest {
    /// Bytes.
    pub bytes: u64,
    /// SHA-256, in lower-case hexadecimal digits.
    pub sha256: String,
}

/// Reads a regular file for its digest; refuses a pipe or a device, which may never end.
pub(crate) fn digest_of(file: &Path) -> io::Result<Digest> {
    let mut file = host::open(file)?;
    let mut hash = Sha256::new();
    let bytes = io::copy(&mut file, &mut hash)?;
    let sha256 = hash.finalize().iter().map(|b| format!("{b:02x}")).collect();
    Ok(Digest { bytes, sha256 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digests_are_those_of_the_standard() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("abc");
        std::fs::write(&file, b"abc").unwrap();
        let found = digest_of(&file).unwrap();
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!((found.bytes, &found.sha256[..]), (3, expected));
        assert!(digest_of(dir.path()).is_err());
        #[cfg(unix)]
        assert!(digest_of(Path::new("/dev/zero")).is_err());
    }
}
