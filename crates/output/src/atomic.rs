//! Atomic writing of output files.
//!
//! A file is written under a temporary name in its own directory and renamed to its final name. Renaming over a device
//! or a pipe would destroy it. Renaming over the file behind `/dev/stdout` would discard other output. Such targets are
//! written directly: videos frame by frame, all other files once their bytes are complete.

use geom::lock;
use std::collections::BTreeSet;
use std::fmt::Display;
use std::fs;
use std::io::{self, BufWriter, Write};
use std::iter;
#[cfg(unix)]
use std::os::fd::{AsFd, OwnedFd};
#[cfg(unix)]
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use tempfile::NamedTempFile;

/// Size of the write buffer in bytes.
const BUFFER: usize = 1 << 18;

/// Failure to read or write a file or a folder, with the cause. A file that could not be written keeps its previous
/// content, or remains absent. Pipes, devices and open descriptors are written directly, so they may receive a part.
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

/// Naming scheme of temporary files.
const PREFIX: &str = ".abvh-";
const SUFFIX: &str = ".part";

/// Existing temporary files of this process.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Removes all temporary files of this process, which is about to exit. While the caller holds the returned guard, no
/// temporary file can be created.
#[must_use]
pub fn remove_unfinished() -> impl Sized {
    let files = lock(&UNFINISHED);
    for file in files.iter() {
        // Fails harmlessly for a file that has just been renamed.
        let _ = fs::remove_file(file);
    }
    files
}

/// File under a temporary name in the directory of its final path.
#[derive(Debug)]
pub(crate) struct UnfinishedFile {
    path: PathBuf,
    // Dropping the temporary file on an error path removes it. Its registration is dropped after that.
    temporary: (NamedTempFile, Registration),
}

impl UnfinishedFile {
    /// Creates a temporary file in the directory of `path`, after following symbolic links. [`Self::finish`] renames
    /// it. Returns `None` for a device, a pipe, a socket or a descriptor, which must be written to directly.
    pub(crate) fn beside(path: &Path) -> io::Result<Option<Self>> {
        let begin = |path: PathBuf| {
            let temporary = temporary_in(host::parent(&path))?;
            Ok(Self { path, temporary })
        };
        plain_target(path)?.map(begin).transpose()
    }

    /// Returns the temporary path.
    pub(crate) fn path(&self) -> &Path {
        self.temporary.0.path()
    }

    /// Renames the file to its final name. On failure, a file with that name is unchanged.
    pub(crate) fn finish(self) -> io::Result<()> {
        let (file, _registration) = self.temporary;
        file.persist(&self.path).map(drop).map_err(|e| e.error)
    }

    /// Renames the file to its final name, unless a file with that name exists.
    fn finish_new(self) -> io::Result<()> {
        let (file, _registration) = self.temporary;
        let Err(e) = file.persist_noclobber(&self.path) else {
            return Ok(());
        };
        if fs::symlink_metadata(&self.path).is_ok() {
            return Ok(());
        }
        // Some file systems support only renaming that replaces files.
        e.file.persist(&self.path).map(drop).map_err(|e| e.error)
    }
}

/// Registration of a temporary file in [`UNFINISHED`] while the file exists.
#[derive(Debug)]
struct Registration(PathBuf);

impl Drop for Registration {
    fn drop(&mut self) {
        lock(&UNFINISHED).remove(&self.0);
    }
}

/// Writes `bytes` to `path` atomically.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    write_with(path, |out| out.write_all(bytes))
}

/// Writes `bytes` to `path` atomically, unless a file exists there.
pub(crate) fn write_new(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let write = || {
        let mut file = UnfinishedFile {
            path: path.to_owned(),
            temporary: temporary_in(host::parent(path))?,
        };
        file.temporary.0.as_file_mut().write_all(bytes)?;
        file.finish_new()
    };
    write().map_err(|e| OutputError::writing(path, e))
}

/// Writes a file with `fill`. The file appears at `path` only if `fill` succeeds.
pub fn write_with(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), OutputError> {
    let write = || match UnfinishedFile::beside(path)? {
        Some(mut file) => {
            let mut out = BufWriter::with_capacity(BUFFER, file.temporary.0.as_file_mut());
            fill(&mut out)?;
            out.flush()?;
            drop(out);
            file.finish()
        }
        None => {
            let mut bytes = Vec::new();
            fill(&mut bytes)?;
            open_existing(path)?.write_all(&bytes)
        }
    };
    write().map_err(|e| OutputError::writing(path, e))
}

/// Opens an existing file, device or pipe for writing, without truncating it. Output to a descriptor follows earlier
/// output.
pub(crate) fn open_existing(path: &Path) -> io::Result<fs::File> {
    let descriptor = descriptor(path);
    #[cfg(unix)]
    if let Some(stream) = descriptor.as_deref().and_then(standard_stream) {
        return Ok(stream.into());
    }
    let mut options = fs::OpenOptions::new();
    options.write(true).append(descriptor.is_some()).open(path)
}

/// Duplicates a descriptor of this process that is standard output or standard error. The duplicate shares the position
/// in the file, so that later output of the program follows.
#[cfg(unix)]
fn standard_stream(descriptor: &Path) -> Option<OwnedFd> {
    let own = fs::canonicalize("/dev/fd").ok()?;
    match descriptor.strip_prefix(own).ok()?.to_str()? {
        "1" => io::stdout().as_fd().try_clone_to_owned().ok(),
        "2" => io::stderr().as_fd().try_clone_to_owned().ok(),
        _ => None,
    }
}

/// Checks, before a long computation, that a file can be written at `path`. Does not change the file.
///
/// Fails if the directory is missing or not writable, or if `path` is a directory. Removes temporary files of killed
/// runs in that directory.
pub fn check_writable(path: &Path) -> Result<(), OutputError> {
    let check = || match plain_target(path)? {
        Some(file) => {
            // Errors are ignored, because a writable folder may be unreadable.
            let _ = remove_abandoned(host::parent(&file));
            temporary_in(host::parent(&file)).map(drop)
        }
        // Opening and closing a pipe would look like the end of the file to its reader.
        None if is_pipe(path)? => Ok(()),
        None => open_existing(path).map(drop),
    };
    check().map_err(|e| OutputError::writing(path, e))
}

/// Checks, before a long computation, that files can be created in the directory `dir`. Does not create it.
pub fn check_dir(dir: &Path) -> Result<(), OutputError> {
    let mut above = dir.ancestors().filter(|d| !d.as_os_str().is_empty());
    let existing = above.find(|d| fs::symlink_metadata(d).is_ok());
    let existing = existing.unwrap_or(Path::new("."));
    let check = || {
        if fs::metadata(existing)?.is_dir() {
            temporary_in(existing).map(drop)
        } else {
            Err(io::ErrorKind::NotADirectory.into())
        }
    };
    check().map_err(|e| OutputError::writing(dir, e))
}

/// Creates the directory `dir` with its parents, and checks that files can be created in it. Removes temporary files
/// that killed runs left in it.
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

/// Returns the regular file, existing or new, that a path leads to. Returns `None` for a device, a pipe, a socket or a
/// descriptor.
fn plain_target(path: &Path) -> io::Result<Option<PathBuf>> {
    match fs::metadata(path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(Some(follow_links(path))),
        Err(e) => Err(e),
        Ok(m) if m.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
        Ok(m) if m.is_file() && descriptor(path).is_none() => fs::canonicalize(path).map(Some),
        Ok(_) => Ok(None),
    }
}

/// Returns the path of the open file descriptor that `path` leads to. Its folder is canonical. For example,
/// `/dev/stdout` leads to `/proc/PID/fd/1`. Returns `None` for other paths.
fn descriptor(path: &Path) -> Option<PathBuf> {
    links(path).find_map(|link| {
        let folder = fs::canonicalize(host::parent(&link)).ok()?;
        let is_of_process = folder.starts_with("/proc") && folder.ends_with("fd");
        let holds_descriptors = is_of_process || folder == Path::new("/dev/fd");
        holds_descriptors.then(|| folder.join(link.file_name().unwrap_or_default()))
    })
}

/// Follows symbolic links at `path`, even if the last one leads to no file. Stops after 40 links, like Linux, because
/// links can form a cycle.
#[must_use]
pub fn follow_links(path: &Path) -> PathBuf {
    links(path).last().unwrap_or_default()
}

/// Returns `path` and the targets of up to 40 symbolic links.
fn links(path: &Path) -> impl Iterator<Item = PathBuf> {
    let next = |link: &PathBuf| {
        let target = fs::read_link(link).ok()?;
        Some(host::parent(link).join(target))
    };
    iter::successors(Some(path.to_owned()), next).take(41)
}

/// Removes temporary files of killed runs in `dir`: those that no living process has locked.
fn remove_abandoned(dir: &Path) -> io::Result<()> {
    for entry in fs::read_dir(dir)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if !name.starts_with(PREFIX) || !name.ends_with(SUFFIX) {
            continue;
        }
        // The writer of a file holds its lock. Without support for locks, `try_lock` fails and the file is kept.
        let file = fs::OpenOptions::new().write(true).open(&path);
        if file.is_ok_and(|file| file.try_lock().is_ok()) {
            fs::remove_file(&path)?;
        }
    }
    Ok(())
}

/// Removes a link, a pipe or a device at `path`. A following write then creates a regular file there.
pub fn remove_special_file(path: &Path) -> Result<(), OutputError> {
    match fs::symlink_metadata(path) {
        Ok(metadata) if !metadata.is_file() && !metadata.is_dir() => {
            fs::remove_file(path).map_err(|e| OutputError::writing(path, e))
        }
        _ => Ok(()),
    }
}

/// Creates a temporary file that is locked while it is open, so that [`remove_abandoned`] keeps it.
fn temporary_in(dir: &Path) -> io::Result<(NamedTempFile, Registration)> {
    loop {
        let mut files = lock(&UNFINISHED);
        let file = unlocked_in(dir)?;
        let path = file.path().to_owned();
        files.insert(path.clone());
        drop(files);
        // A signal may arrive while this is dropped. So the file is removed before its registration.
        let temporary = (file, Registration(path));
        let file = &temporary.0;
        // Another process may lock or remove the file before it is locked here. Then another file is created.
        let is_ours = match file.as_file().try_lock() {
            Ok(()) => file.path().exists(),
            Err(fs::TryLockError::WouldBlock) => false,
            Err(fs::TryLockError::Error(_)) => true,
        };
        if is_ours {
            return Ok(temporary);
        }
    }
}

fn unlocked_in(dir: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX);
    // Temporary files are private by default. Results get the permissions that the user's mask allows.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(dir).map_err(without_path)
}

/// Removes the temporary path that `tempfile` adds to errors, since the caller adds the final path.
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
    fn failed_write_keeps_the_old_file() {
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
    fn removes_only_abandoned_temporary_files() {
        let dir = tempfile::tempdir().unwrap();
        let left = unlocked_in(dir.path()).unwrap();
        let (_, left) = left.keep().unwrap();
        let (living, _registration) = temporary_in(dir.path()).unwrap();
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
    fn file_is_removed_before_its_registration() {
        let dir = tempfile::tempdir().unwrap();
        let temporary = temporary_in(dir.path()).unwrap();
        // The registration cannot be removed while the list is locked.
        let files = lock(&UNFINISHED);
        let dropping = std::thread::spawn(|| drop(temporary));
        let mut waits = 0..1000;
        while !names(dir.path()).is_empty() && waits.next().is_some() {
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        drop(files);
        dropping.join().unwrap();
        assert!(!waits.is_empty(), "the registration was removed first");
    }

    #[test]
    fn detects_unwritable_paths_early() {
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
    fn preserves_devices_and_links() {
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
        let [dangling, absent] = ["dangling", "absent"].map(|n| dir.path().join(n));
        symlink("absent", &dangling).unwrap();
        check_writable(&dangling).unwrap();
        write_whole(&dangling, b"new").unwrap();
        assert!(fs::symlink_metadata(&dangling).unwrap().is_symlink());
        assert_eq!(fs::read(&absent).unwrap(), b"new");
        remove_special_file(&link).unwrap();
        remove_special_file(&file).unwrap();
        write_whole(&link, b"newer").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        let mode = fs::metadata(&file).unwrap().permissions().mode();
        assert_ne!(mode & 0o077, 0, "others may read: {mode:o}");
    }
}
