//! Access to the files that a scene's file refers to. Files outside its folder are read only if the options allow it.

use crate::paths;
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
    /// Returns the folder of `file`. With `allow_outside`, [`Self::read`] also reads files outside the folder.
    #[must_use]
    pub(crate) fn of(file: &Path, allow_outside: bool) -> Self {
        Self {
            folder: host::parent(file).to_owned(),
            allow_outside,
        }
    }

    /// Returns the folder's path joined with `name`, which [`paths::encode`] may have encoded.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(paths::decode_path(name))
    }

    /// Reads a regular file by its name relative to the folder.
    ///
    /// # Errors
    /// Returns the errors of [`Self::permitted`] and [`host::read`].
    pub(crate) fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        host::read(&self.permitted(name)?)
    }

    /// Returns the path of the file with this name relative to the folder.
    ///
    /// # Errors
    /// Returns [`ErrorKind::PermissionDenied`] if the file, after links are resolved, is outside the folder and
    /// `allow_outside` is not set. Also returns errors of the operating system.
    pub(crate) fn permitted(&self, name: &str) -> io::Result<PathBuf> {
        let path = self.path(name);
        if self.allow_outside {
            return Ok(path);
        }
        let (file, folder) = (fs::canonicalize(&path)?, fs::canonicalize(&self.folder)?);
        if !file.starts_with(&folder) {
            let message = "it is outside the scene's folder; --allow-outside permits it";
            return Err(io::Error::new(ErrorKind::PermissionDenied, message));
        }
        Ok(file)
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
