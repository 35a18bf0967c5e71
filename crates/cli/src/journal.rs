//! Which files of a run are whole: `abvh-run.jsonl` beside them, a line for each frame that is done.
//!
//! A line is written after the files that it names have their final names; of several lines about a frame the last counts.
//! A shard has a journal of its own, so that several may fill one folder at once. Whoever writes a journal holds its lock.

use crate::stop::Stop;
use crate::values::Shard;
use output::{Digest, FrameStats, digest_of};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::path::{Path, PathBuf};

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum JournalLine {
    /// What the run is to make, and its statistics without frames.
    Run { list: Vec<u64>, stats: Value },
    Frame {
        files: Vec<NamedDigest>,
        row: Box<FrameStats>,
    },
}

/// A file by its name in a folder.
pub(crate) type NamedDigest = (String, Digest);

/// What all journals of a folder say.
#[derive(Debug, Default)]
pub(crate) struct Done {
    /// The whole list of frames, of all runs together, in order.
    pub(crate) list: Vec<u64>,
    /// Statistics without frames, of the last run.
    pub(crate) stats: Option<Value>,
    frames: BTreeMap<u64, (Vec<NamedDigest>, FrameStats)>,
}

impl Done {
    /// Reads every journal of a folder. A line that was cut short says nothing.
    pub(crate) fn in_folder(folder: &Path) -> Result<Self, Stop> {
        let mut done = Self::default();
        for file in journals(folder)? {
            let cannot = |e| Stop::bad(format!("cannot read {}: {e}", file.display()));
            for line in BufReader::new(host::open(&file).map_err(cannot)?).split(b'\n') {
                match serde_json::from_slice(&line.map_err(cannot)?) {
                    Ok(JournalLine::Run { list, stats }) => {
                        done.list.extend(list);
                        // A shard without frames has none.
                        done.stats = Some(stats).filter(|s| !s.is_null()).or(done.stats);
                    }
                    Ok(JournalLine::Frame { files, row })
                        if files.iter().all(|(n, _)| is_ours(n)) =>
                    {
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
    pub(crate) fn of_stats(list: Vec<u64>, rows: Vec<FrameStats>, stats: Option<Value>) -> Self {
        let frames = rows
            .into_iter()
            .map(|row| (row.frame as u64, (Vec::new(), row)));
        let frames = frames.collect();
        Self {
            list,
            stats,
            frames,
        }
    }

    /// The row of a frame whose file `name` is in `folder`, whole.
    pub(crate) fn whole(&self, frame: u64, folder: &Path, name: &str) -> Option<&FrameStats> {
        let (files, row) = self.frames.get(&frame)?;
        let (_, digest) = files.iter().find(|(n, _)| n == name)?;
        let found = digest_of(&folder.join(name)).ok()?;
        (found == *digest).then_some(row)
    }

    /// The row of a frame all of whose files are whole, as they were written.
    pub(crate) fn all_whole(&self, frame: u64, folder: &Path) -> Option<&FrameStats> {
        let (files, row) = self.frames.get(&frame)?;
        let whole = |(name, _): &NamedDigest| self.whole(frame, folder, name).is_some();
        files.iter().all(whole).then_some(row)
    }
}

/// Whether a name is that of a file which runs make in a folder of theirs; a journal may have been tampered with.
fn is_ours(name: &str) -> bool {
    let is_plain = Path::new(name).file_name() == Some(name.as_ref());
    is_plain && (name.starts_with("frame_") || name.starts_with("hits_"))
}

fn journals(folder: &Path) -> Result<Vec<PathBuf>, Stop> {
    let cannot = |e| Stop::bad(format!("cannot read {}: {e}", folder.display()));
    let entries = match fs::read_dir(folder) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(cannot)?,
    };
    let paths = entries.map(|entry| Ok(entry.map_err(cannot)?.path()));
    let mut all: Vec<PathBuf> = paths.collect::<Result<_, Stop>>()?;
    all.retain(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("abvh-run") && name.ends_with(".jsonl")
    });
    all.sort();
    Ok(all)
}

/// Removes the files that the journals of a folder name, and the journals.
///
/// # Errors
/// Another run is writing one of them.
pub(crate) fn clear(folder: &Path) -> Result<(), Stop> {
    let done = Done::in_folder(folder)?;
    let journals = journals(folder)?;
    for journal in &journals {
        open_locked(journal)?;
    }
    let files = done.frames.values().flat_map(|(files, _)| files);
    let files = files.map(|(name, _)| folder.join(name));
    for file in files.chain(journals) {
        match fs::remove_file(&file) {
            Err(e) if e.kind() != ErrorKind::NotFound => {
                return Err(Stop::bad(format!("cannot remove {}: {e}", file.display())));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Opens a journal, which is made if there is none, and holds it as long as it is open.
fn open_locked(path: &Path) -> Result<File, Stop> {
    let name = path.display();
    let cannot = |e| Stop::bad(format!("cannot write {name}: {e}"));
    // Whoever opens a pipe waits for its other end.
    match host::open(path) {
        Err(e) if e.kind() == ErrorKind::NotFound => {}
        there => drop(there.map_err(cannot)?),
    }
    let file = File::options().append(true).create(true).open(path);
    let file = file.map_err(cannot)?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(Stop::bad(format!("another run is writing {name}"))),
        // Where there are no locks, nobody can tell.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(file),
    }
}

/// What a journal says of files.
pub(crate) fn digests(files: &[PathBuf]) -> Result<Vec<NamedDigest>, Stop> {
    let digest = |file: &PathBuf| {
        let name = file.file_name().unwrap_or_default();
        let cannot = |e| Stop::failed(format!("cannot read {}: {e}", file.display()));
        Ok((
            name.to_string_lossy().into_owned(),
            digest_of(file).map_err(cannot)?,
        ))
    };
    files.iter().map(digest).collect()
}

/// A journal that is being written.
#[derive(Debug)]
pub(crate) struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Goes on with a shard's journal in a folder.
    ///
    /// # Errors
    /// Another run is writing it, or it cannot be written.
    pub(crate) fn open(folder: &Path, shard: Option<Shard>) -> Result<Self, Stop> {
        let name = match shard {
            Some(Shard { number, of }) => format!("abvh-run-{number}-of-{of}.jsonl"),
            None => "abvh-run.jsonl".to_owned(),
        };
        let path = folder.join(name);
        let mut file = open_locked(&path)?;
        let cannot = |e| Stop::bad(format!("cannot write {}: {e}", path.display()));
        // The last line may have been cut short: nothing is to be added to it.
        if host::read(&path)
            .map_err(cannot)?
            .last()
            .is_some_and(|&end| end != b'\n')
        {
            file.write_all(b"\n").map_err(cannot)?;
        }
        Ok(Self { path, file })
    }

    /// Says what the run is to make.
    pub(crate) fn begin(&mut self, list: Vec<u64>, stats: Value) -> Result<(), Stop> {
        self.write(&JournalLine::Run { list, stats })
    }

    /// Says that a frame's files are whole.
    pub(crate) fn add(&mut self, files: Vec<NamedDigest>, row: &FrameStats) -> Result<(), Stop> {
        let row = Box::new(row.clone());
        self.write(&JournalLine::Frame { files, row })
    }

    fn write(&mut self, line: &JournalLine) -> Result<(), Stop> {
        let mut text = serde_json::to_vec(line).map_err(Stop::failed)?;
        text.push(b'\n');
        let cannot = |e| Stop::failed(format!("cannot write {}: {e}", self.path.display()));
        self.file.write_all(&text).map_err(cannot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(frame: usize) -> FrameStats {
        FrameStats {
            frame,
            hits: 7,
            sah_ratio: Some(1.25),
            ..FrameStats::default()
        }
    }

    #[test]
    fn what_was_said_of_a_frame_holds_as_long_as_its_files_do() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("frame_0003.png");
        fs::write(&file, b"pixels").unwrap();
        let mut journal = Journal::open(dir.path(), None).unwrap();
        journal
            .begin(vec![3, 4], serde_json::json!({"schema": 1}))
            .unwrap();
        let files = digests(std::slice::from_ref(&file)).unwrap();
        journal.add(files, &row(3)).unwrap();
        let again = Journal::open(dir.path(), None).unwrap_err();
        assert!(again.to_string().contains("another run"), "{again}");
        journal.file.write_all(b"{\"frame\":{\"fil").unwrap();
        drop(journal);
        let mut journal = Journal::open(dir.path(), None).unwrap();
        // What is said again counts.
        journal.add(Vec::new(), &row(5)).unwrap();
        journal.add(Vec::new(), &row(4)).unwrap();
        let changed = FrameStats { hits: 8, ..row(5) };
        journal.add(Vec::new(), &changed).unwrap();
        let done = Done::in_folder(dir.path()).unwrap();
        assert_eq!(done.list, [3, 4]);
        assert_eq!(done.whole(3, dir.path(), "frame_0003.png").unwrap().hits, 7);
        assert!(done.all_whole(4, dir.path()).is_some());
        assert_eq!(done.all_whole(5, dir.path()).unwrap().hits, 8);
        assert!(done.whole(4, dir.path(), "frame_0004.png").is_none());
        for damaged in [&b"pixel"[..], b"pixelz", b""] {
            fs::write(&file, damaged).unwrap();
            assert!(done.all_whole(3, dir.path()).is_none());
        }
    }

    #[test]
    fn shards_have_journals_of_their_own_that_are_read_together() {
        let dir = tempfile::tempdir().unwrap();
        for number in 1..=2 {
            let shard = Some(Shard { number, of: 2 });
            let mut journal = Journal::open(dir.path(), shard).unwrap();
            journal.begin(vec![0, 1], Value::Null).unwrap();
            journal.add(Vec::new(), &row(number - 1)).unwrap();
        }
        let done = Done::in_folder(dir.path()).unwrap();
        assert_eq!((done.list.len(), done.frames.len()), (2, 2));
        clear(dir.path()).unwrap();
        assert!(journals(dir.path()).unwrap().is_empty());
    }
}
