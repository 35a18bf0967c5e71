//! Regular files only: a pipe or a device may never end, or answer at all.

use std::fs::{self, File, FileType, Metadata, OpenOptions};
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};

/// Opens a regular file; never waits for a writer at the other end of a pipe.
///
/// # Errors
/// The system's, or [`ErrorKind::InvalidInput`] for what is no regular file.
pub fn open(path: &Path) -> io::Result<File> {
    // Opening some devices does something, so they are refused before.
    regular(&fs::metadata(path)?)?;
    let file = without_waiting().open(path)?;
    // What has the name may have changed since.
    regular(&file.metadata()?)?;
    Ok(file)
}

/// Reads a whole regular file.
///
/// # Errors
/// Those of [`open`], or [`ErrorKind::OutOfMemory`].
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut file = open(path)?;
    let size = usize::try_from(file.metadata()?.len()).unwrap_or(usize::MAX);
    crate::check(size as u64).map_err(|e| io::Error::new(ErrorKind::OutOfMemory, e))?;
    let mut bytes = crate::room(size).map_err(io::Error::from)?;
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn without_waiting() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.read(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        options.custom_flags(rustix::fs::OFlags::NONBLOCK.bits().cast_signed());
    }
    options
}

fn regular(about: &Metadata) -> io::Result<()> {
    if about.is_file() {
        return Ok(());
    }
    let what = kind(about.file_type());
    let message = format!("{what} is not a regular file");
    Err(io::Error::new(ErrorKind::InvalidInput, message))
}

fn kind(of: FileType) -> &'static str {
    #[cfg(unix)]
    use std::os::unix::fs::FileTypeExt;
    match of {
        t if t.is_dir() => "a directory",
        #[cfg(unix)]
        t if t.is_fifo() => "a pipe",
        #[cfg(unix)]
        t if t.is_socket() => "a socket",
        #[cfg(unix)]
        t if t.is_char_device() || t.is_block_device() => "a device",
        _ => "what has this name",
    }
}

/// The folder that a file is in.
#[must_use]
pub fn parent(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// The folder of a file that names others.
#[derive(Clone, Debug)]
pub struct Folder {
    folder: PathBuf,
    allow_outside: bool,
}

impl Folder {
    /// The folder that `file` is in. With `allow_outside` it may name files anywhere.
    #[must_use]
    pub fn of(file: &Path, allow_outside: bool) -> Self {
        Self {
            folder: parent(file).to_owned(),
            allow_outside,
        }
    }

    /// Where a name leads, seen from the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Reads a regular file in the folder or below, by its name seen from there.
    ///
    /// # Errors
    /// Those of [`read`], or [`ErrorKind::PermissionDenied`] for a file that is elsewhere, links followed.
    pub fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        let path = self.path(name);
        if self.allow_outside {
            return read(&path);
        }
        let (file, folder) = (fs::canonicalize(&path)?, fs::canonicalize(&self.folder)?);
        if !file.starts_with(&folder) {
            let message = "it lies outside the scene's folder (--allow-outside reads it)";
            return Err(io::Error::new(ErrorKind::PermissionDenied, message));
        }
        read(&file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn pipes_devices_and_directories_are_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let rw = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
        rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, rw).unwrap();
        for (path, says) in [
            (pipe.as_path(), "a pipe is not"),
            (Path::new("/dev/zero"), "a device is not"),
            (folder.path(), "a directory is not"),
        ] {
            let e = read(path).unwrap_err();
            assert_eq!(e.kind(), ErrorKind::InvalidInput);
            assert!(e.to_string().contains(says), "{e}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_file_outside_the_folder_is_read_only_if_that_is_allowed() {
        let all = tempfile::tempdir().unwrap();
        let inside = all.path().join("scene");
        fs::create_dir_all(inside.join("sub")).unwrap();
        fs::write(all.path().join("outside"), "out").unwrap();
        fs::write(inside.join("inside"), "in").unwrap();
        std::os::unix::fs::symlink("../outside", inside.join("link")).unwrap();
        let scene = inside.join("a.obj");
        let outside = all.path().join("outside").display().to_string();
        for name in ["../outside", "link", outside.as_str()] {
            let e = Folder::of(&scene, false).read(name).unwrap_err();
            assert_eq!(e.kind(), ErrorKind::PermissionDenied, "{name}");
            assert_eq!(Folder::of(&scene, true).read(name).unwrap(), b"out");
        }
        for name in ["inside", "sub/../inside", "../scene/inside"] {
            assert_eq!(Folder::of(&scene, false).read(name).unwrap(), b"in");
        }
    }
}
