//! What can go wrong between memory and files.

use std::io;
use std::path::{Path, PathBuf};

/// A file that could not be written. Nothing is left under its name but what was there before.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {cause}", path.display())]
pub struct WriteError {
    path: PathBuf,
    cause: io::Error,
}

impl WriteError {
    pub(crate) fn new(path: &Path, cause: io::Error) -> Self {
        Self {
            path: path.to_owned(),
            cause,
        }
    }

    /// The file (or the directory) in question.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Why a file holds no rays.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RaysError {
    /// The file cannot be opened or read.
    #[error("cannot read {}: {cause}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        cause: io::Error,
    },
    /// The file is no `.npy` array at all.
    #[error("{}: not a .npy array: {reason}", path.display())]
    NotAnArray {
        /// The file.
        path: PathBuf,
        /// What is amiss.
        reason: String,
    },
    /// The array has another element type.
    #[error("{}: rays must be float32 ('<f4' or '>f4'), found {found}{hint}", path.display())]
    ElementType {
        /// The file.
        path: PathBuf,
        /// The type it has, as numpy spells it.
        found: String,
        /// What to do about it, if that is plain; else empty.
        hint: &'static str,
    },
    /// The array has another shape.
    #[error("{}: rays must have shape (N, 6) or (N, 8), found {found}", path.display())]
    Shape {
        /// The file.
        path: PathBuf,
        /// The shape it has, as Python writes it.
        found: String,
    },
    /// The file ends before its array does.
    #[error("{}: truncated: shape {shape} takes {wanted} bytes of data, found {found}", path.display())]
    Truncated {
        /// The file.
        path: PathBuf,
        /// The shape its header promises.
        shape: String,
        /// Bytes that takes.
        wanted: u128,
        /// Bytes there are.
        found: u64,
    },
}
