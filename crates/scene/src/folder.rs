//! The folder of a scene's file, and the files in it that the file refers to.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// Folder of a file that refers to other files.
#[derive(Clone, Debug)]
pub(crate) struct Folder {
    folder: PathBuf,
    allow_outside: bool,
}

impl Folder {
    /// Returns the folder of `file`. With `allow_outside`, references may lead to files anywhere.
    #[must_use]
    pub(crate) fn of(file: &Path, allow_outside: bool) -> Self {
        Self {
            folder: host::parent(file).to_owned(),
            allow_outside,
        }
    }

    /// Returns the path of a name relative to the folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Reads a regular file by its name relative to the folder.
    ///
    /// # Errors
    /// Returns errors of [`host::read`], and [`ErrorKind::PermissionDenied`] for a file that is outside the folder after
    /// following links, unless that is allowed.
    pub(crate) fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        let path = self.path(name);
        if self.allow_outside {
            return host::read(&path);
        }
        let (file, folder) = (fs::canonicalize(&path)?, fs::canonicalize(&self.folder)?);
        if !file.starts_with(&folder) {
            let message = "it lies outside the scene's folder (--allow-outside reads it)";
            return Err(io::Error::new(ErrorKind::PermissionDenied, message));
        }
        host::read(&file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn outside_files_require_permission() {
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
