//! Manifest and journals of a run that writes into a folder.
//!
//! The manifest `abvh-run.json` determines whether a later run may continue the run. The journal `abvh-run.jsonl` has
//! one line at the start of each run, and one line per finished frame with the digests of its files.
//!
//! A line is written after the files that it lists have their final names. If several lines of a frame list a file, the
//! last one counts. Each shard has its own journal, so several shards can fill one folder. A writer locks its journal.

use crate::OutputError;
use crate::atomic::write_new;
use crate::stats::json_bytes;
use pipeline::FrameRecord;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File, TryLockError};
use std::io::{self, BufRead, BufReader, ErrorKind, Write};
use std::iter;
use std::path::{Path, PathBuf};

const MANIFEST: &str = "abvh-run.json";

/// Everything that determines the pictures and hits of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Schema version, see [`crate::SCHEMA`].
    pub schema: u32,
    /// Version of the program.
    pub version: String,
    /// Rendered scene.
    pub scene: SceneId,
    /// Number of key frames of the animation.
    #[serde(rename = "key_times")]
    pub key_frames: usize,
    /// Values of the options, by name.
    pub options: BTreeMap<String, Value>,
}

/// Identity of the rendered scene: its files, and its name on the command line if it is a demo, joins inputs or places
/// an input.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneId {
    /// Name of the scene, if its files do not identify it completely.
    pub name: Option<String>,
    /// Digests of the files with their names, sorted by path.
    pub files: Vec<NamedDigest>,
}

impl Manifest {
    /// Reads the manifest of a folder. Returns `None` if there is no manifest.
    pub fn in_folder(folder: &Path) -> Result<Option<Self>, OutputError> {
        let file = folder.join(MANIFEST);
        let text = match host::read(&file) {
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
            text => text.map_err(|e| OutputError::reading(&file, e))?,
        };
        serde_json::from_slice(&text).map(Some).map_err(|e| {
            let problem = format!("{} is not the manifest of a run: {e}", file.display());
            OutputError(format!("{problem}; use --overwrite to start a new run"))
        })
    }

    /// Writes the manifest into a folder, unless the folder has a manifest.
    pub fn write_new(&self, folder: &Path) -> Result<(), OutputError> {
        let file = folder.join(MANIFEST);
        write_new(&file, &json_bytes(&file, self)?)
    }

    /// Returns a description of the first difference between two runs, or `None` if they are equal.
    #[must_use]
    pub fn difference(&self, other: &Self) -> Option<String> {
        let (mine, theirs) = (self.named(), other.named());
        let value_of = |all: &[(String, Value)], name: &str| {
            let found = all.iter().find(|(n, _)| n == name);
            found.map_or("absent".to_owned(), |(_, value)| value.to_string())
        };
        let mut names = mine.iter().chain(&theirs).map(|(name, _)| name);
        names.find_map(|name| {
            let [a, b] = [&mine, &theirs].map(|all| value_of(all, name));
            (a != b).then(|| format!("its {name} is {a}, here it is {b}"))
        })
    }

    /// Returns all fields with their display names.
    fn named(&self) -> Vec<(String, Value)> {
        let fixed = [
            ("schema", json!(self.schema)),
            ("program's version", json!(self.version)),
            ("scene", json!(self.scene.name)),
            ("number of key frames", json!(self.key_frames)),
        ];
        let fixed = fixed.map(|(name, value)| (name.to_owned(), value));
        // Numbered, because files in different folders may have equal names.
        let files = (1..).zip(&self.scene.files);
        let files = files.map(|(i, (name, digest))| (format!("file {i}, {name}"), json!(digest)));
        let options = self.options.iter();
        let options = options.map(|(name, value)| (format!("--{name}"), value.clone()));
        fixed.into_iter().chain(files).chain(options).collect()
    }
}

/// Name of a file within its folder, and its digest.
pub type NamedDigest = (String, Digest);

/// Length and digest of a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Digest {
    /// Length in bytes.
    pub bytes: u64,
    /// SHA-256 in lower-case hexadecimal.
    pub sha256: String,
}

/// Computes the digest of a regular file. Refuses pipes and devices, which may never end.
fn digest_of(file: &Path) -> io::Result<Digest> {
    let mut file = host::open(file)?;
    let mut hash = Sha256::new();
    let bytes = io::copy(&mut file, &mut hash)?;
    let sha256 = hash.finalize().iter().map(|b| format!("{b:02x}")).collect();
    Ok(Digest { bytes, sha256 })
}

/// Computes the digests of `files` in parallel, in their order.
pub fn digests(files: &[PathBuf]) -> Result<Vec<NamedDigest>, OutputError> {
    let digest = |file: &PathBuf| {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let digest = digest_of(file).map_err(|e| OutputError::reading(file, e))?;
        Ok((name.into_owned(), digest))
    };
    files.par_iter().map(digest).collect()
}

/// Kind of a frame's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FileKind {
    /// Picture of the frame.
    Picture,
    /// Hits of the camera's rays.
    Hits,
}

impl FileKind {
    /// Returns the name of a frame's file of this kind.
    #[must_use]
    pub fn file_name(self, frame: u64) -> String {
        match self {
            Self::Picture => format!("frame_{frame:04}.png"),
            Self::Hits => format!("hits_{frame:04}.npz"),
        }
    }

    /// Returns the kind of the file with this name. Returns `None` if no frame has a file of this name.
    #[must_use]
    pub fn of(name: &str) -> Option<Self> {
        let (_, numbered) = name.split_once('_')?;
        let (number, _) = numbered.split_once('.')?;
        let frame: u64 = number.parse().ok()?;
        let mut all = [Self::Picture, Self::Hits].into_iter();
        all.find(|kind| kind.file_name(frame) == name)
    }
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum JournalLine {
    /// `list`: the indices of the run's frames in all shards, including those that are already complete. `kinds`: the
    /// kinds of files that each frame gets in the folder; earlier versions did not record them. `stats`: the run's
    /// statistics without those of its frames.
    Run {
        list: Vec<u64>,
        #[serde(default)]
        kinds: Vec<FileKind>,
        stats: Value,
    },
    Frame {
        files: Vec<NamedDigest>,
        #[serde(rename = "row")]
        record: Box<FrameRecord>,
    },
}

/// Combined contents of all journals of a folder.
#[derive(Debug, Default)]
pub struct JournalContents {
    /// Kinds of files that each frame gets in the folder, by frame number.
    pub expected: BTreeMap<u64, BTreeSet<FileKind>>,
    /// Statistics of the last recorded run, without those of its frames. Journals are read in the order of their names.
    pub stats: Option<Value>,
    frames: BTreeMap<u64, (BTreeMap<String, Digest>, FrameRecord)>,
}

impl JournalContents {
    /// Reads all journals of a folder. Truncated lines are ignored.
    pub fn in_folder(folder: &Path) -> Result<Self, OutputError> {
        let mut done = Self::default();
        for file in journals(folder)? {
            let cannot = |e| OutputError::reading(&file, e);
            let mut expected = BTreeMap::new();
            for line in BufReader::new(host::open(&file).map_err(cannot)?).split(b'\n') {
                match serde_json::from_slice(&line.map_err(cannot)?) {
                    Ok(JournalLine::Run { list, kinds, stats }) => {
                        // A later run of the same frames may write fewer kinds of files.
                        expected.extend(list.into_iter().map(|frame| (frame, kinds.clone())));
                        done.stats = Some(stats).filter(Value::is_object).or(done.stats);
                    }
                    Ok(JournalLine::Frame { files, record }) if are_ours(&files) => {
                        done.add(files, *record);
                    }
                    Ok(JournalLine::Frame { .. }) | Err(_) => {}
                }
            }
            for (frame, kinds) in expected {
                done.expected.entry(frame).or_default().extend(kinds);
            }
        }
        Ok(done)
    }

    /// Adds a frame's line. Files that only earlier lines list remain known.
    fn add(&mut self, files: Vec<NamedDigest>, record: FrameRecord) {
        let (known, _) = self.frames.remove(&record.frame.index).unzip();
        let mut known = known.unwrap_or_default();
        known.extend(files);
        self.frames.insert(record.frame.index, (known, record));
    }

    /// Returns whether no journal has a complete line.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.expected.is_empty() && self.frames.is_empty()
    }

    /// Returns whether a journal lists files of a frame.
    #[must_use]
    pub fn lists(&self, frame: u64) -> bool {
        self.frames.contains_key(&frame)
    }

    /// Returns whether a journal lists a file of this kind of a frame.
    #[must_use]
    pub fn lists_kind(&self, frame: u64, kind: FileKind) -> bool {
        let listed = self.frames.get(&frame);
        listed.is_some_and(|(files, _)| files.contains_key(&kind.file_name(frame)))
    }

    /// Returns the statistics of a frame if its file `name` in `folder` is unchanged. Returns `None` otherwise.
    #[must_use]
    pub fn unchanged(&self, frame: u64, folder: &Path, name: &str) -> Option<&FrameRecord> {
        let (files, record) = self.frames.get(&frame)?;
        let digest = files.get(name)?;
        let found = digest_of(&folder.join(name)).ok()?;
        (found == *digest).then_some(record)
    }

    /// Returns the statistics of a frame if all of its files in `folder` are unchanged. Returns `None` otherwise.
    #[must_use]
    pub fn all_unchanged(&self, frame: u64, folder: &Path) -> Option<&FrameRecord> {
        let (files, record) = self.frames.get(&frame)?;
        let mut names = files.keys();
        let unchanged = |name: &String| self.unchanged(frame, folder, name).is_some();
        names.all(unchanged).then_some(record)
    }
}

/// Returns whether all names are those of frames' files. With other names, a manipulated journal could make
/// [`clear_run`] remove other files.
fn are_ours(files: &[NamedDigest]) -> bool {
    let mut names = files.iter().map(|(name, _)| name);
    names.all(|name| FileKind::of(name).is_some())
}

fn journals(folder: &Path) -> Result<Vec<PathBuf>, OutputError> {
    let cannot = |e| OutputError::reading(folder, e);
    let entries = match fs::read_dir(folder) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(cannot)?,
    };
    let paths = entries.map(|entry| Ok(entry.map_err(cannot)?.path()));
    let mut all: Vec<PathBuf> = paths.collect::<Result<_, OutputError>>()?;
    all.retain(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("abvh-run") && name.ends_with(".jsonl")
    });
    all.sort();
    Ok(all)
}

/// Removes the manifest and the journals of a folder, and the files that the journals list. `journals` are the
/// folder's journals, which remain locked until all files are removed.
pub fn clear_run(folder: &Path, journals: &[Journal]) -> Result<(), OutputError> {
    let done = JournalContents::in_folder(folder)?;
    let files = done.frames.values().flat_map(|(files, _)| files.keys());
    let manifest = iter::once(folder.join(MANIFEST));
    let files = manifest.chain(files.map(|name| folder.join(name)));
    let journals = journals.iter().map(|journal| journal.path.clone());
    for file in files.chain(journals) {
        let name = file.display();
        match fs::remove_file(&file) {
            Err(e) if e.kind() != ErrorKind::NotFound => {
                return Err(OutputError(format!("cannot remove {name}: {e}")));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Returns the path of the journal of a folder, or of one shard `[number, of]`.
fn journal_path(folder: &Path, shard: Option<[usize; 2]>) -> PathBuf {
    folder.join(match shard {
        Some([number, of]) => format!("abvh-run-{number}-of-{of}.jsonl"),
        None => "abvh-run.jsonl".to_owned(),
    })
}

/// Journal that is open for writing, and locked until it is dropped.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Opens and locks the journal of a folder, or of one shard `[number, of]`. Creates it if necessary. Fails if
    /// another run is writing it.
    pub fn open(folder: &Path, shard: Option<[usize; 2]>) -> Result<Self, OutputError> {
        Self::open_file(journal_path(folder, shard))
    }

    /// Opens and locks the journal like [`Self::open`]. Returns `None` if it does not exist.
    pub fn open_existing(
        folder: &Path,
        shard: Option<[usize; 2]>,
    ) -> Result<Option<Self>, OutputError> {
        let path = journal_path(folder, shard);
        path.exists().then(|| Self::open_file(path)).transpose()
    }

    /// Opens and locks all journals of a folder. Fails if another run is writing one.
    pub fn open_all(folder: &Path) -> Result<Vec<Self>, OutputError> {
        journals(folder)?.into_iter().map(Self::open_file).collect()
    }

    fn open_file(path: PathBuf) -> Result<Self, OutputError> {
        let cannot = |e| OutputError::writing(&path, e);
        // Opening a pipe for writing would block until it has a reader, so `host::open` refuses it first.
        match host::open(&path) {
            Err(e) if e.kind() == ErrorKind::NotFound => {}
            opened => drop(opened.map_err(cannot)?),
        }
        let file = File::options().append(true).create(true).open(&path);
        let file = file.map_err(cannot)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                let name = path.display();
                Err(OutputError(format!("another run is writing {name}")))
            }
            // Without support for locks, another writer cannot be detected.
            Ok(()) | Err(TryLockError::Error(_)) => Ok(Self { path, file }),
        }
    }

    /// Appends a line with the numbers of the frames of all shards, the kinds of their files, and the run's statistics.
    pub fn begin(
        &mut self,
        list: Vec<u64>,
        kinds: Vec<FileKind>,
        stats: Value,
    ) -> Result<(), OutputError> {
        let path = &self.path;
        // The last line may be truncated. It is ended here, so that the new line is separate.
        let text = host::read(path).map_err(|e| OutputError::reading(path, e))?;
        if text.last().is_some_and(|&end| end != b'\n') {
            (self.file.write_all(b"\n")).map_err(|e| OutputError::writing(path, e))?;
        }
        self.write(&JournalLine::Run { list, kinds, stats })
    }

    /// Records that `files` of a frame are complete, with the frame's statistics.
    pub fn add(
        &mut self,
        files: Vec<NamedDigest>,
        record: &FrameRecord,
    ) -> Result<(), OutputError> {
        let record = Box::new(record.clone());
        self.write(&JournalLine::Frame { files, record })
    }

    fn write(&mut self, line: &JournalLine) -> Result<(), OutputError> {
        let text = serde_json::to_string(line).map_err(io::Error::from);
        let written = text.and_then(|text| self.file.write_all((text + "\n").as_bytes()));
        written.map_err(|e| OutputError::writing(&self.path, e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digest_matches_sha256_test_vector() {
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

    #[test]
    fn first_manifest_is_kept() {
        let dir = tempfile::tempdir().unwrap();
        let manifest = |key_frames| Manifest {
            schema: crate::SCHEMA,
            version: String::new(),
            scene: SceneId {
                name: None,
                files: Vec::new(),
            },
            key_frames,
            options: BTreeMap::new(),
        };
        for key_frames in [1, 2] {
            manifest(key_frames).write_new(dir.path()).unwrap();
        }
        let found = Manifest::in_folder(dir.path()).unwrap();
        assert_eq!(found, Some(manifest(1)));
    }

    #[test]
    fn only_names_of_frames_have_a_kind() {
        for kind in [FileKind::Picture, FileKind::Hits] {
            for frame in [0, 17, 12_345, u64::MAX] {
                assert_eq!(FileKind::of(&kind.file_name(frame)), Some(kind));
            }
        }
        for other in [
            "frame_1.obj",
            "frame_1.png",
            "hits_0001.png",
            "../frame_0001.png",
        ] {
            assert_eq!(FileKind::of(other), None, "{other}");
        }
    }

    #[test]
    fn second_writer_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let open = || Journal::open(dir.path(), None);
        let first = open().unwrap();
        let again = open().err().unwrap().to_string();
        assert!(again.contains("another run"), "{again}");
        drop(first);
        open().unwrap();
    }
}
