//! Files or demo names in; animations with colours out.
//!
//! A scene is named by one word: `demo:NAME[:TRIANGLES]`, a directory or a glob of `.obj` or `.ply` files (one key
//! frame each, in natural order), or one `.obj`, `.ply`, `.gltf` or `.glb` file; or by several such words with `+`
//! between them, each with its place after an `@` if it is to stand elsewhere (`@x,y,z` or `@x,y,z*scale`). Whatever is
//! wrong with it comes back as one clear line; no input makes this crate panic.

mod clip;
mod demo;
mod files;
mod join;
pub mod keys;
mod mesh;
mod obj;
mod ply;
mod polygon;
mod rounding;
mod sequence;
mod source;
mod stream;
mod text;

pub use files::{files, word};
pub use ply::write_ply;
pub use source::open;
use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A colour in sRGB.
pub type Rgb = [u8; 3];

/// Moving triangles with colours.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Short name, for captions: of the demo, the directory or the file.
    pub name: String,
    /// What rays hit.
    pub animation: Arc<geom::Animation>,
    /// sRGB, one a triangle.
    pub colours: Arc<[Rgb]>,
    /// Where it came from.
    pub facts: Facts,
}

/// Where a scene came from and what was noticed on the way.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// `demo`, `obj`, `ply`, `gltf` or `glb`; of several inputs, theirs with `+` between them.
    pub format: String,
    /// The files read as key frames, in order; buffers and materials beside them are not listed.
    pub files: Vec<PathBuf>,
    /// The animation clip that was sampled.
    pub clip: Option<String>,
    /// Seconds between key frames, where the source tells.
    pub seconds_per_key: Option<f64>,
    /// The point that was subtracted from all coordinates, in the units of the files. Absent unless
    /// [`Options::recentre`] requested it; demos have no offset.
    pub offset: Option<[f64; 3]>,
    /// Remarks for the reader: what was skipped, assumed or missing.
    pub notes: Vec<String>,
}

/// The highest rate a clip is sampled at.
pub const MAX_FPS: f64 = 10_000.0;

/// How to read sources that leave a choice.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Key frames sampled from each second of a clip.
    pub fps: f64,
    /// Name or index of the clip to sample; the first if absent.
    pub clip: Option<String>,
    /// Whether a scene's files may name files outside its folder.
    pub allow_outside: bool,
    /// Whether the centre of the first key frame is subtracted from all coordinates, before they are rounded to single
    /// precision. [`Facts::offset`] returns it.
    pub recentre: bool,
    /// Bytes that all key frames may take to be held. Those of larger scenes are read while they are played.
    pub key_bytes: u64,
    /// Bytes that may be taken; what the host has free, if absent.
    pub memory: Option<u64>,
    /// Bytes that whoever opens the scene takes besides, whatever it holds: there must be room for them too.
    pub more_bytes: u64,
    /// The same for each triangle, as for trees.
    pub triangle_bytes: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            fps: 24.0,
            clip: None,
            allow_outside: false,
            recentre: false,
            key_bytes: 512 << 20,
            memory: None,
            more_bytes: 0,
            triangle_bytes: 0,
        }
    }
}

/// Why a scene cannot be opened: one clear line, which names the file and the place where there is one.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct SceneError(pub(crate) String);

/// What comes of reading a scene.
pub type Result<T, E = SceneError> = std::result::Result<T, E>;

/// Where in a file something is wrong: a line counted from 1, or a byte or an item of a list counted from 0.
pub(crate) type Location = (&'static str, usize);

impl SceneError {
    /// What is at `place`, a path or a scene's name, cannot be used.
    pub(crate) fn unusable(place: impl AsRef<Path>, cause: impl Display) -> Self {
        Self(format!("{}: {cause}", place.as_ref().display()))
    }

    /// A file breaks its format's rules. Line breaks in `cause` become spaces.
    pub(crate) fn malformed(
        path: &Path,
        location: impl Into<Option<Location>>,
        cause: impl Display,
    ) -> Self {
        const LONGEST: usize = 240;
        let words = cause.to_string();
        let mut cause = words.split_whitespace().collect::<Vec<_>>().join(" ");
        if let Some((end, _)) = cause.char_indices().nth(LONGEST) {
            cause.truncate(end);
            cause.push('…');
        }
        let location = location.into().map(|(what, at)| format!("{what} {at}: "));
        Self::unusable(path, location.unwrap_or_default() + &cause)
    }

    /// The system refused `path`.
    pub(crate) fn unreadable(path: &Path, source: io::Error) -> Self {
        match source.kind() {
            io::ErrorKind::NotFound => Self::unusable(path, "no such file or directory"),
            _ => Self::unusable(path, format_args!("cannot read: {source}")),
        }
    }
}

#[cfg(test)]
mod testing {
    use crate::mesh::{Mesh, compact};
    use crate::rounding::Rounding;
    use crate::{Options, Result, Scene, polygon};
    use geom::Point;
    use std::fs;
    use std::path::PathBuf;
    use tempfile::TempDir;

    /// Writes a file of a folder, and the folders on the way to it.
    pub(crate) fn put(folder: &TempDir, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, bytes).unwrap();
        path
    }

    /// Triangles over the vertices that they use.
    pub(crate) struct Surface {
        pub(crate) points: Vec<Point>,
        pub(crate) triangles: Vec<[u32; 3]>,
    }

    pub(crate) fn surface(mesh: &Mesh) -> Surface {
        let mut triangles = polygon::triangulate(&mesh.topology, &mesh.points).triangles;
        let kept = compact(&mut triangles, mesh.points.len());
        let points = kept.iter().map(|&v| mesh.points[v as usize]);
        let points = points.map(|p| Rounding::default().point(p)).collect();
        Surface { points, triangles }
    }

    /// Opens the inputs of a folder with these names.
    pub(crate) fn open_in(folder: &TempDir, names: &str, options: &Options) -> Result<Scene> {
        let root = folder.path().to_str().unwrap();
        let spec: Vec<String> = names.split('+').map(|n| format!("{root}/{n}")).collect();
        crate::open(&spec.join("+"), options)
    }

    /// It was refused in one line, with all these words.
    #[track_caller]
    pub(crate) fn refused<T>(tried: Result<T>, says: &[&str]) {
        let message = tried.err().expect("it is refused").to_string();
        let told = says.iter().all(|part| message.contains(part));
        assert!(
            told && !message.contains('\n'),
            "{says:?} is not in {message:?}"
        );
    }
}
