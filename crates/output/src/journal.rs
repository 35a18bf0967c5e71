//! What a run into a folder is: `abvh-run.json`, which says whether another run may go on with it. Which of its files are
//! whole: `abvh-run.jsonl`, a line for each frame that is done.
//!
//! A line is written after the files that it names have their final names; of several lines about a frame the last counts.
//! A shard has a journal of its own, so that several may fill one folder at once. Whoever writes a journal holds its lock.

use crate::{FrameStats, OutputError, remove_special_file, write_json};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io::{self, BufRead, BufReader, ErrorKind, Write};
use std::path::{Path, PathBuf};

const MANIFEST: &str = "abvh-run.json";

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
    pub fn in_folder(folder: &Path) -> Result<Option<Self>, OutputError> {
        let file = folder.join(MANIFEST);
        let text = match host::read(&file) {
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
            text => text.map_err(|e| OutputError::reading(&file, e))?,
        };
        serde_json::from_slice(&text).map(Some).map_err(|e| {
            let no = format!("{} is no manifest of a run: {e}", file.display());
            OutputError(format!("{no}; --overwrite starts afresh"))
        })
    }

    /// Writes it into a folder.
    pub fn write_to(&self, folder: &Path) -> Result<(), OutputError> {
        let file = folder.join(MANIFEST);
        remove_special_file(&file)?;
        write_json(&file, self)
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

/// A file by its name in a folder.
pub type NamedDigest = (String, Digest);

/// A file's length and digest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Digest {
    /// Bytes.
    pub bytes: u64,
    /// SHA-256, in lower-case hexadecimal digits.
    pub sha256: String,
}

/// Reads a regular file for its digest; refuses a pipe or a device, which may never end.
fn digest_of(file: &Path) -> io::Result<Digest> {
    let mut file = host::open(file)?;
    let mut hash = Sha256::new();
    let bytes = io::copy(&mut file, &mut hash)?;
    let sha256 = hash.finalize().iter().map(|b| format!("{b:02x}")).collect();
    Ok(Digest { bytes, sha256 })
}

/// What a journal says of files, or a manifest.
pub fn digests(files: &[PathBuf]) -> Result<Vec<NamedDigest>, OutputError> {
    let digest = |file: &PathBuf| {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let digest = digest_of(file).map_err(|e| OutputError::reading(file, e))?;
        Ok((name.into_owned(), digest))
    };
    files.par_iter().map(digest).collect()
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum JournalLine {
    /// What the run is to make, and its statistics without frames.
    Run { list: Vec<u64>, stats: Value },
    Frame {
        files: Vec<NamedDigest>,
        row: Box<FrameStats>,
    },
}

/// What all journals of a folder say.
#[derive(Debug, Default)]
pub struct Finished {
    /// The whole list of frames, of all runs together, in order.
    pub list: Vec<u64>,
    /// Statistics without frames, of the last run.
    pub stats: Option<Value>,
    frames: BTreeMap<u64, (Vec<NamedDigest>, FrameStats)>,
}

impl Finished {
    /// Reads every journal of a folder. A line that was cut short says nothing.
    pub fn in_folder(folder: &Path) -> Result<Self, OutputError> {
        let mut done = Self::default();
        for file in journals(folder)? {
            let cannot = |e| OutputError::reading(&file, e);
            for line in BufReader::new(host::open(&file).map_err(cannot)?).split(b'\n') {
                match serde_json::from_slice(&line.map_err(cannot)?) {
                    Ok(JournalLine::Run { list, stats }) => {
                        done.list.extend(list);
                        done.stats = Some(stats).filter(Value::is_object).or(done.stats);
                    }
                    Ok(JournalLine::Frame { files, row }) if are_ours(&files) => {
                        done.frames.insert(row.frame as u64, (files, *row));
                    }
                    Ok(JournalLine::Frame { .. }) | Err(_) => {}
                }
            }
        }
        done.list.sort_unstable();
        done.list.dedup();
        Ok(done)
    }

    /// What a file of statistics says, which stands alone.
    #[must_use]
    pub fn of_stats(list: Vec<u64>, rows: Vec<FrameStats>, stats: Value) -> Self {
        let rows = rows.into_iter();
        let frames = rows.map(|row| (row.frame as u64, (Vec::new(), row)));
        Self {
            list,
            stats: Some(stats),
            frames: frames.collect(),
        }
    }

    /// The row of a frame whose file `name` is in `folder`, whole.
    #[must_use]
    pub fn whole(&self, frame: u64, folder: &Path, name: &str) -> Option<&FrameStats> {
        let (files, row) = self.frames.get(&frame)?;
        let (_, digest) = files.iter().find(|(n, _)| n == name)?;
        let found = digest_of(&folder.join(name)).ok()?;
        (found == *digest).then_some(row)
    }

    /// The row of a frame all of whose files are whole, as they were written.
    #[must_use]
    pub fn all_whole(&self, frame: u64, folder: &Path) -> Option<&FrameStats> {
        let (files, row) = self.frames.get(&frame)?;
        let whole = |(name, _): &NamedDigest| self.whole(frame, folder, name).is_some();
        files.iter().all(whole).then_some(row)
    }
}

/// Whether names are those of files which runs make in a folder of theirs; a journal may have been tampered with.
fn are_ours(files: &[NamedDigest]) -> bool {
    files.iter().all(|(name, _)| {
        let is_plain = Path::new(name).file_name() == Some(name.as_ref());
        is_plain && (name.starts_with("frame_") || name.starts_with("hits_"))
    })
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

/// Removes the files that the journals of a folder name, and the journals, unless another run is writing one of them.
pub fn clear_run(folder: &Path) -> Result<(), OutputError> {
    let done = Finished::in_folder(folder)?;
    let journals = journals(folder)?;
    for journal in &journals {
        open_locked(journal)?;
    }
    let files = done.frames.values().flat_map(|(files, _)| files);
    let files = files.map(|(name, _)| folder.join(name));
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

/// Opens a journal, which is made if there is none, and holds it as long as it is open.
fn open_locked(path: &Path) -> Result<File, OutputError> {
    let cannot = |e| OutputError::writing(path, e);
    // Whoever opens a pipe waits for its other end.
    match host::open(path) {
        Err(e) if e.kind() == ErrorKind::NotFound => {}
        there => drop(there.map_err(cannot)?),
    }
    let file = File::options().append(true).create(true).open(path);
    let file = file.map_err(cannot)?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => {
            let name = path.display();
            Err(OutputError(format!("another run is writing {name}")))
        }
        // Where there are no locks, nobody can tell.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(file),
    }
}

/// A journal that is being written.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Takes hold of the journal of a folder, or of one shard of so many. Fails if another run is writing it.
    pub fn open(folder: &Path, shard: Option<[usize; 2]>) -> Result<Self, OutputError> {
        let path = folder.join(match shard {
            Some([number, of]) => format!("abvh-run-{number}-of-{of}.jsonl"),
            None => "abvh-run.jsonl".to_owned(),
        });
        let file = open_locked(&path)?;
        Ok(Self { path, file })
    }

    /// Goes on with it: what the run is to make, and its statistics.
    pub fn begin(&mut self, list: Vec<u64>, stats: Value) -> Result<(), OutputError> {
        let path = &self.path;
        // The last line may have been cut short: nothing is to be added to it.
        let text = host::read(path).map_err(|e| OutputError::reading(path, e))?;
        if text.last().is_some_and(|&end| end != b'\n') {
            (self.file.write_all(b"\n")).map_err(|e| OutputError::writing(path, e))?;
        }
        self.write(&JournalLine::Run { list, stats })
    }

    /// Says that these files of a frame are whole, with its row of the statistics.
    pub fn add(&mut self, files: Vec<NamedDigest>, row: &FrameStats) -> Result<(), OutputError> {
        let row = Box::new(row.clone());
        self.write(&JournalLine::Frame { files, row })
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

    #[test]
    fn a_folder_has_one_writer_at_a_time() {
        let dir = tempfile::tempdir().unwrap();
        let open = || Journal::open(dir.path(), None);
        let first = open().unwrap();
        let again = open().err().unwrap().to_string();
        assert!(again.contains("another run"), "{again}");
        drop(first);
        open().unwrap();
    }
}
