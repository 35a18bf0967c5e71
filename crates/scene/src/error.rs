//! What can be wrong with a scene, in one clear line each.

use geom::AnimationError;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Why a scene cannot be opened. Every message is one line and names the file and the place where there is one.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// What is requested names nothing, or its inputs do not fit together.
    #[error("{0}")]
    BadRequest(String),
    /// What is found there is no scene, or has not what is requested of it.
    #[error("{place}: {cause}")]
    Unusable {
        /// The demo, the file, the directory or the pattern.
        place: String,
        /// What is wrong with it.
        cause: String,
    },
    /// There is neither such a file nor such a directory.
    #[error("{}: no such file or directory", path.display())]
    NotFound {
        /// The path asked for.
        path: PathBuf,
    },
    /// The system refuses to read.
    #[error("{}: cannot read: {source}", path.display())]
    Unreadable {
        /// The file or directory.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// A file that breaks its format's rules.
    #[error("{}: {location}{cause}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where in it.
        location: FileLocation,
        /// What is wrong there.
        cause: String,
    },
    /// A file without a triangle.
    #[error("{}: no triangles{}", path.display(), though(*vertices))]
    NoTriangles {
        /// The file.
        path: PathBuf,
        /// How many vertices it has.
        vertices: usize,
    },
    /// More than memory holds.
    #[error("{place}: {what}: {source}")]
    NotEnoughMemory {
        /// The demo, the file or the inputs.
        place: String,
        /// What does not fit.
        what: String,
        /// What it takes and what there is.
        source: host::NotEnough,
    },
    /// Key frames and triangles do not fit together.
    #[error(transparent)]
    Animation(#[from] AnimationError),
}

/// Where in a file something is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FileLocation {
    /// Nowhere in particular.
    File,
    /// A line of text, counted from 1.
    Line(usize),
    /// A byte, counted from 0.
    Byte(usize),
    /// An item of a list, such as (`vertex`, 7), counted from 0.
    Item(&'static str, usize),
}

impl fmt::Display for FileLocation {
    /// Writes the place and `": "`, or nothing for the whole file.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File => Ok(()),
            Self::Line(line) => write!(f, "line {line}: "),
            Self::Byte(byte) => write!(f, "byte {byte}: "),
            Self::Item(what, index) => write!(f, "{what} {index}: "),
        }
    }
}

fn though(vertices: usize) -> String {
    match vertices {
        0 => String::new(),
        n => format!(", though there are {n} vertices"),
    }
}

impl SceneError {
    /// What is at `place` cannot be used.
    pub(crate) fn unusable(place: impl fmt::Display, cause: impl fmt::Display) -> Self {
        Self::Unusable {
            place: place.to_string(),
            cause: cause.to_string(),
        }
    }

    /// A file is wrong at a location. Line breaks in `cause` become spaces.
    pub(crate) fn malformed(path: &Path, location: FileLocation, cause: impl fmt::Display) -> Self {
        const LONGEST: usize = 240;
        let words = cause.to_string();
        let mut cause = words.split_whitespace().collect::<Vec<_>>().join(" ");
        if let Some((end, _)) = cause.char_indices().nth(LONGEST) {
            cause.truncate(end);
            cause.push('…');
        }
        let path = path.to_owned();
        Self::Malformed {
            path,
            location,
            cause,
        }
    }

    /// The system refused `path`.
    pub(crate) fn unreadable(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            io::ErrorKind::NotFound => Self::NotFound { path },
            _ => Self::Unreadable { path, source },
        }
    }
}
