//! What can be wrong with a scene, in one clear line each.

use geom::AnimationError;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Why a scene cannot be opened. Every message is one line and names the file and the place where there is one.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// No demo has that name.
    #[error("unknown demo {name:?}; there are {}", crate::demo::DEMOS.join(", "))]
    UnknownDemo {
        /// The name asked for.
        name: String,
    },
    /// What follows `@` is no place.
    #[error("bad place {text:?} for {input}: give @x,y,z or @x,y,z*scale, with a scale above 0")]
    BadPlace {
        /// The input to be placed.
        input: String,
        /// What was given for a place.
        text: String,
    },
    /// Inputs of one scene move through different numbers of key frames.
    #[error(
        "{first} has {expected} key frames and {other} {found}: inputs that move must have equally many; \
         one with a single key frame is repeated"
    )]
    OtherKeys {
        /// The first input that moves.
        first: String,
        /// Its key frames.
        expected: usize,
        /// The input that differs.
        other: String,
        /// Its key frames.
        found: usize,
    },
    /// The number after a demo's name is none.
    #[error(
        "bad triangle count {text:?} for demo:{demo}: give a whole number in 1..={}",
        crate::demo::MAX_DEMO_TRIANGLES
    )]
    BadTriangleCount {
        /// The demo.
        demo: String,
        /// What was given for a number.
        text: String,
    },
    /// The rate asked for samples nothing.
    #[error(
        "bad frame rate {fps}: give frames a second above 0 and at most {}",
        crate::MAX_FPS
    )]
    BadFrameRate {
        /// The rate asked for.
        fps: f64,
    },
    /// The file that says when key frames are does not suit them.
    #[error("{}: {cause}", path.display())]
    BadTimes {
        /// The file.
        path: PathBuf,
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
    /// A pattern that is none.
    #[error("{pattern}: not a pattern of paths: {cause}")]
    BadPattern {
        /// The pattern.
        pattern: String,
        /// What is wrong with it.
        cause: String,
    },
    /// A pattern without a match.
    #[error("{pattern}: matches no file")]
    NoMatch {
        /// The pattern.
        pattern: String,
    },
    /// A directory that holds nothing.
    #[error("{}: the directory is empty", path.display())]
    EmptyDirectory {
        /// The directory.
        path: PathBuf,
    },
    /// A directory or pattern with files but no meshes to make key frames of.
    #[error("{place}: no .obj or .ply file among {files} files{hint}")]
    NoMeshes {
        /// The directory or pattern.
        place: String,
        /// Files there are.
        files: usize,
        /// What else might be meant; empty if nothing.
        hint: String,
    },
    /// Key frames of two formats.
    #[error(
        "{place}: {obj} .obj and {ply} .ply files are mixed; key frames must be of one format (a pattern such as '*.obj' picks some)"
    )]
    MixedFormats {
        /// The directory or pattern.
        place: String,
        /// Files of one format.
        obj: usize,
        /// Files of the other.
        ply: usize,
    },
    /// A file of a format that is not read.
    #[error("{}: unsupported file type; a scene is a .obj, .ply, .gltf or .glb file", path.display())]
    UnsupportedExtension {
        /// The file.
        path: PathBuf,
    },
    /// A file that breaks its format's rules.
    #[error("{}: {place}{cause}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where in it.
        place: FileLocation,
        /// What is wrong there.
        cause: String,
    },
    /// A key frame with another number of vertices or triangles than the first.
    #[error("{}: {found} {what}, but {} has {expected}; all key frames must have the same topology", path.display(), first.display())]
    OtherCount {
        /// The key frame's file.
        path: PathBuf,
        /// The first key frame's file.
        first: PathBuf,
        /// `vertices` or `triangles`.
        what: &'static str,
        /// How many the key frame has.
        found: usize,
        /// How many the first has.
        expected: usize,
    },
    /// A key frame whose faces join other vertices than the first's.
    #[error("{}: face {face} joins other vertices than in {}; all key frames must have the same topology", path.display(), first.display())]
    OtherFaces {
        /// The key frame's file.
        path: PathBuf,
        /// The first key frame's file.
        first: PathBuf,
        /// The first face that differs, counted from 1.
        face: usize,
    },
    /// A file without triangles.
    #[error("{}: no triangles{hint}", path.display())]
    NoTriangles {
        /// The file.
        path: PathBuf,
        /// What there was instead; empty if nothing.
        hint: String,
    },
    /// More than can be numbered.
    #[error("{}: {found} {what} are more than the limit of {limit}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// What there are too many of.
        what: &'static str,
        /// How many there are.
        found: u64,
        /// How many there may be.
        limit: u64,
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
    /// No clip has that name or index.
    #[error("{}: no clip {asked:?}; {}", path.display(), listed(clips))]
    UnknownClip {
        /// The file.
        path: PathBuf,
        /// The clip asked for.
        asked: String,
        /// Names of the clips there are.
        clips: Vec<String>,
    },
    /// A clip was asked for where there can be none.
    #[error("{place}: no clip {asked:?}: only .gltf and .glb files have clips")]
    NoClips {
        /// The demo, the file, the directory or the pattern.
        place: String,
        /// The clip asked for.
        asked: String,
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

impl SceneError {
    /// A file at `path` is wrong at `place`. Line breaks in `cause` become spaces.
    pub(crate) fn malformed(path: &Path, place: FileLocation, cause: impl fmt::Display) -> Self {
        const LONGEST: usize = 240;
        let words = cause.to_string();
        let mut cause = words.split_whitespace().collect::<Vec<_>>().join(" ");
        if let Some((end, _)) = cause.char_indices().nth(LONGEST) {
            cause.truncate(end);
            cause.push('…');
        }
        let path = path.to_owned();
        Self::Malformed { path, place, cause }
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

fn listed(clips: &[String]) -> String {
    if clips.is_empty() {
        return "the file has no clips".to_owned();
    }
    let names = clips
        .iter()
        .enumerate()
        .map(|(i, name)| format!("{i} {name:?}"));
    format!("there are {}", names.collect::<Vec<_>>().join(", "))
}
