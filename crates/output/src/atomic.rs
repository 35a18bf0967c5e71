//! Whole files or none.
//!
//! A file is written under a temporary name in its own directory and renamed over its final name. Targets that are no
//! plain files (devices, pipes) cannot be renamed over without destroying them; they get the finished bytes in one go.

use geom::lock;
use std::collections::BTreeSet;
use std::fmt::Display;
use std::fs;
use std::io::{self, BufWriter, Write};
#[cfg(unix)]
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};
use tempfile::NamedTempFile;

/// Bytes collected before they go to the file.
const BUFFER: usize = 1 << 18;

/// What keeps a run from a file or a folder that it needs: what was found there, and what is wanted. Nothing is left under
/// the name of a file that could not be written but what was there before.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct OutputError(pub(crate) String);

impl OutputError {
    pub(crate) fn reading(file: &Path, cause: io::Error) -> Self {
        Self(format!("cannot read {}: {cause}", file.display()))
    }

    pub(crate) fn writing(file: &Path, cause: impl Display) -> Self {
        Self(format!("cannot write {}: {cause}", file.display()))
    }
}

/// How temporary files are named.
const PREFIX: &str = ".abvh-";
const SUFFIX: &str = ".part";

/// Temporary files that exist, of this process.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    lock(&UNFINISHED)
}

/// Removes every temporary file of this process, which is about to end. None is made while the result is held.
#[must_use]
pub fn remove_unfinished() -> impl Sized {
    let files = unfinished();
    for file in files.iter() {
        // One that has got its final name is gone already.
        let _ = fs::remove_file(file);
    }
    files
}

/// A file under a temporary name beside its final one.
#[derive(Debug)]
pub(crate) struct UnfinishedFile {
    path: PathBuf,
    // Dropping it on the way out of an error removes it.
    temporary: (UnfinishedName, NamedTempFile),
}

impl UnfinishedFile {
    /// Begins the file `path`, links followed, which appears when it is finished. `None` for a device, a pipe or a socket:
    /// it is written to where it is.
    pub(crate) fn beside(path: &Path) -> io::Result<Option<Self>> {
        let begin = |path: PathBuf| {
            let temporary = temporary_in(host::parent(&path))?;
            Ok(Self { path, temporary })
        };
        plain_target(path)?.map(begin).transpose()
    }

    /// Where it lies meanwhile.
    pub(crate) fn path(&self) -> &Path {
        self.temporary.1.path()
    }

    /// Gives it its final name, which keeps what it had where that fails.
    pub(crate) fn finish(self) -> io::Result<()> {
        let (_known, file) = self.temporary;
        file.persist(&self.path).map(drop).map_err(|e| e.error)
    }
}

/// Has a temporary file be known as long as it exists.
#[derive(Debug)]
struct UnfinishedName(PathBuf);

impl Drop for UnfinishedName {
    fn drop(&mut self) {
        unfinished().remove(&self.0);
    }
}

/// Writes `bytes` to `path`, all of them or none.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    write_with(path, |out| out.write_all(bytes))
}

/// Lets `fill` write a file, which appears at `path` only if `fill` succeeds.
pub fn write_with(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), OutputError> {
    let write = || match UnfinishedFile::beside(path)? {
        Some(file) => fill_and_finish(file, fill),
        None => {
            let mut bytes = Vec::new();
            fill(&mut bytes)?;
            open_as_it_is(path)?.write_all(&bytes)
        }
    };
    write().map_err(|e| OutputError::writing(path, e))
}

/// What is there already, to be written to.
pub(crate) fn open_as_it_is(path: &Path) -> io::Result<fs::File> {
    fs::OpenOptions::new().write(true).open(path)
}

/// Finds out before long work whether a file could be written at `path`, without touching it. There may be no such
/// directory, no permission, or a directory in the way. Removes what killed runs left beside it.
pub fn check_writable(path: &Path) -> Result<(), OutputError> {
    let check = || match plain_target(path)? {
        Some(file) => {
            // A folder that may be written to need not be readable.
            let _ = remove_abandoned(host::parent(&file));
            temporary_in(host::parent(&file)).map(drop)
        }
        // Whoever reads a pipe would take the end of this look for the end of the file.
        None if is_pipe(path)? => Ok(()),
        None => open_as_it_is(path).map(drop),
    };
    check().map_err(|e| OutputError::writing(path, e))
}

/// Finds out before long work whether files could be made in the directory `dir`, without making it.
pub fn check_dir(dir: &Path) -> Result<(), OutputError> {
    let mut above = dir.ancestors().filter(|d| !d.as_os_str().is_empty());
    let existing = above.find(|d| fs::symlink_metadata(d).is_ok());
    let existing = existing.unwrap_or(Path::new("."));
    let check = || match fs::metadata(existing)?.is_dir() {
        true => temporary_in(existing).map(drop),
        false => Err(io::ErrorKind::NotADirectory.into()),
    };
    check().map_err(|e| OutputError::writing(dir, e))
}

/// Makes the directory `dir` and those above it, and finds out whether files can be made in it.
/// Removes what killed runs left there.
pub fn prepare_dir(dir: &Path) -> Result<(), OutputError> {
    let prepare = || {
        fs::create_dir_all(dir)?;
        let _ = remove_abandoned(dir);
        temporary_in(dir).map(drop)
    };
    prepare().map_err(|e| OutputError::writing(dir, e))
}

#[cfg(unix)]
fn is_pipe(path: &Path) -> io::Result<bool> {
    Ok(fs::metadata(path)?.file_type().is_fifo())
}

#[cfg(not(unix))]
fn is_pipe(_: &Path) -> io::Result<bool> {
    Ok(false)
}

/// The file that a path names or would name, links followed; `None` for a device, a pipe or a socket.
fn plain_target(path: &Path) -> io::Result<Option<PathBuf>> {
    match fs::metadata(path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(Some(path.to_owned())),
        Err(e) => Err(e),
        Ok(m) if m.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
        Ok(m) if m.is_file() => fs::canonicalize(path).map(Some),
        Ok(_) => Ok(None),
    }
}

fn fill_and_finish(
    mut file: UnfinishedFile,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let mut out = BufWriter::with_capacity(BUFFER, file.temporary.1.as_file_mut());
    fill(&mut out)?;
    out.flush()?;
    drop(out);
    file.finish()
}

/// Removes what runs that were killed left in `dir`: temporary files that no living process holds.
fn remove_abandoned(dir: &Path) -> io::Result<()> {
    for entry in fs::read_dir(dir)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if !name.starts_with(PREFIX) || !name.ends_with(SUFFIX) {
            continue;
        }
        // Who writes a file holds its lock; where there are no locks, nobody can tell.
        let file = fs::OpenOptions::new().write(true).open(&path);
        if file.is_ok_and(|file| file.try_lock().is_ok()) {
            fs::remove_file(&path)?;
        }
    }
    Ok(())
}

/// Removes a link, a pipe or a device that stands where a file is to be written, so that nothing is written where it leads.
pub fn remove_special_file(path: &Path) -> Result<(), OutputError> {
    match fs::symlink_metadata(path) {
        Ok(about) if !about.is_file() && !about.is_dir() => {
            fs::remove_file(path).map_err(|e| OutputError::writing(path, e))
        }
        _ => Ok(()),
    }
}

/// A temporary file that is locked as long as it is open, so that nobody takes it for abandoned.
fn temporary_in(dir: &Path) -> io::Result<(UnfinishedName, NamedTempFile)> {
    loop {
        let mut files = unfinished();
        let file = unlocked_in(dir)?;
        files.insert(file.path().to_owned());
        drop(files);
        let known = UnfinishedName(file.path().to_owned());
        // Locked or removed in between by somebody who tidies up: another one is made.
        let is_ours = match file.as_file().try_lock() {
            Ok(()) => file.path().exists(),
            Err(fs::TryLockError::WouldBlock) => false,
            Err(fs::TryLockError::Error(_)) => true,
        };
        if is_ours {
            return Ok((known, file));
        }
    }
}

fn unlocked_in(dir: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX);
    // Temporary files are private by default; results are as readable as the user's mask allows.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(dir).map_err(without_path)
}

/// `tempfile` adds the temporary name to its errors; the final name says more.
fn without_path(e: io::Error) -> io::Error {
    match e.to_string().split_once(" at path ") {
        Some((reason, _)) => io::Error::new(e.kind(), reason),
        None => e,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(dir: &Path) -> Vec<String> {
        let entries = fs::read_dir(dir).unwrap();
        let names = entries.map(|e| e.unwrap().file_name());
        names.map(|name| name.into_string().unwrap()).collect()
    }

    #[test]
    fn a_file_that_fails_halfway_leaves_nothing_new() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        let fail = |out: &mut dyn Write| {
            out.write_all(&vec![7; 3 * BUFFER])?;
            Err(io::ErrorKind::StorageFull.into())
        };
        write_with(&path, fail).unwrap_err();
        assert!(names(dir.path()).is_empty());
        write_whole(&path, b"old").unwrap();
        write_with(&path, fail).unwrap_err();
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(dir.path()), ["a"]);
        write_whole(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn what_a_killed_run_left_is_removed_and_what_a_living_one_writes_is_not() {
        let dir = tempfile::tempdir().unwrap();
        let left = unlocked_in(dir.path()).unwrap();
        let (_, left) = left.keep().unwrap();
        let (_known, living) = temporary_in(dir.path()).unwrap();
        fs::write(dir.path().join(".abvh-notes"), b"mine").unwrap();
        remove_abandoned(dir.path()).unwrap();
        assert!(!left.exists() && living.path().exists());
        assert_eq!(names(dir.path()).len(), 2);
        for prepare in [
            |dir: &Path| check_writable(&dir.join("c")),
            |dir: &Path| prepare_dir(dir),
        ] {
            let left = unlocked_in(dir.path()).unwrap();
            let (_, left) = left.keep().unwrap();
            prepare(dir.path()).unwrap();
            assert!(!left.exists() && living.path().exists());
        }
    }

    #[test]
    fn a_directory_in_the_way_is_found_early() {
        let dir = tempfile::tempdir().unwrap();
        let e = check_writable(dir.path()).unwrap_err();
        assert!(e.to_string().contains("directory"), "{e}");
        let e = check_writable(&dir.path().join("no/such/file")).unwrap_err();
        assert!(e.to_string().contains("no/such/file: "), "{e}");
        assert!(!e.to_string().contains(".part"), "{e}");
        let file = dir.path().join("file");
        check_writable(&file).unwrap();
        assert!(!file.exists() && names(dir.path()).is_empty());
        write_whole(&file, b"").unwrap();
        assert!(prepare_dir(&file.join("below")).is_err());
        prepare_dir(&dir.path().join("x/y")).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn devices_stay_devices_and_links_stay_links() {
        use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
        write_whole(Path::new("/dev/null"), b"x").unwrap();
        let null = fs::metadata("/dev/null").unwrap().file_type();
        assert!(null.is_char_device());
        assert!(write_whole(Path::new("/dev/full"), b"x").is_err());
        let dir = tempfile::tempdir().unwrap();
        let [file, link] = ["file", "link"].map(|n| dir.path().join(n));
        write_whole(&file, b"old").unwrap();
        symlink(&file, &link).unwrap();
        write_whole(&link, b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"new");
        remove_special_file(&link).unwrap();
        remove_special_file(&file).unwrap();
        write_whole(&link, b"newer").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        let mode = fs::metadata(&file).unwrap().permissions().mode();
        assert_ne!(mode & 0o077, 0, "others may read: {mode:o}");
    }
}
