//! What a run into a folder is: `abvh-run.json`, which says whether another run may go on with it.

use crate::journal::digests;
use crate::{Digest, OutputError, WriteError, write_json};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

const FILE: &str = "abvh-run.json";
const SCHEMA: u32 = 1;

/// All that decides a byte of a run's pictures and hits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    schema: u32,
    version: String,
    scene: SceneId,
    /// Whole times of the motion.
    pub key_times: usize,
    options: BTreeMap<String, Value>,
}

/// What is rendered: the name of a demo or of inputs that are joined, and the files that are read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct SceneId {
    name: Option<String>,
    files: Vec<(String, Digest)>,
}

impl Manifest {
    /// Of a run with these options, over a motion with so many whole times; `name` is that of a scene that its files do
    /// not tell whole.
    ///
    /// # Errors
    /// A file of the scene cannot be read.
    pub fn new(
        version: &str,
        (name, files): (Option<&str>, &[PathBuf]),
        key_times: usize,
        options: BTreeMap<String, Value>,
    ) -> Result<Self, OutputError> {
        let scene = SceneId {
            name: name.map(str::to_owned),
            files: digests(files)?,
        };
        Ok(Self {
            schema: SCHEMA,
            version: version.to_owned(),
            scene,
            key_times,
            options,
        })
    }

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
            let file = file.display();
            OutputError(format!(
                "{file} is no manifest of a run: {e}; --overwrite starts afresh"
            ))
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
