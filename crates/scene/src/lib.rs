//! Reads animated triangle meshes, with colours, from files or from the name of a built-in demo.
//!
//! A scene is named by a string. It is `demo:NAME[:TRIANGLES]`, one `.obj`, `.ply`, `.gltf` or `.glb` file, or a
//! directory or glob of `.obj` or `.ply` files. Each file of a directory or glob is one key frame, in natural order.
//! Several names joined by `+` make one scene. Each may be followed by a placement: `@x,y,z` or `@x,y,z*scale`. The
//! placement moves each point `p` of that input to `p * scale + (x, y, z)`.
//!
//! [`Viewpoint`] chooses a camera and a light for any scene.
//!
//! Every error is one line of text, unless a path contains a line break. No input makes this crate panic.

mod demo;
mod files;
mod folder;
mod gltf;
mod join;
mod mesh;
mod obj;
mod paging;
mod paths;
mod ply;
mod polygon;
mod rounding;
mod sequence;
mod source;
mod text;
mod viewpoint;

pub use files::{files, protected_files};
pub use join::{is_joined, open};
pub use paths::encode_path;
use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
pub use viewpoint::Viewpoint;

/// A colour in sRGB.
pub type Rgb = [u8; 3];

/// Moving triangles with colours.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Short name of the demo, the directory or the file, for captions.
    pub name: String,
    /// Triangles and their motion.
    pub animation: Arc<geom::Animation>,
    /// sRGB colour of each triangle.
    pub colours: Arc<[Rgb]>,
    /// Description of the source.
    pub facts: Facts,
}

/// Description of a scene's source, with remarks from reading it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// `demo`, `obj`, `ply`, `gltf` or `glb`. Joined inputs give their formats joined by `+`.
    pub format: String,
    /// Files read as key frames, in order. Buffers and material libraries are not listed.
    pub files: Vec<PathBuf>,
    /// Name of the sampled animation clip.
    pub clip: Option<String>,
    /// Seconds between key frames, if the source specifies them.
    pub seconds_per_key: Option<f64>,
    /// The point that was subtracted from all coordinates, in the units of the files. `None` if
    /// [`SceneOptions::recentre`] is not set, or if the scene is a single demo without a placement.
    pub offset: Option<[f64; 3]>,
    /// Remarks for the user: data that was skipped, assumed or missing.
    pub notes: Vec<String>,
}

/// Highest supported sampling rate of a clip, in key frames per second.
pub const MAX_FPS: f64 = 10_000.0;

/// Options for reading a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneOptions {
    /// Key frames sampled per second of a clip.
    pub fps: f64,
    /// Name or index of the clip to sample. `None` selects the first clip.
    pub clip: Option<String>,
    /// Whether the files of a scene may refer to files outside its folder.
    pub allow_outside: bool,
    /// Whether a fixed point is subtracted from all coordinates before they are rounded to single precision: the centre
    /// of the first key frame, or for joined inputs that of the first input after its placement. For a demo, its origin
    /// counts as its centre. [`Facts::offset`] holds the point.
    pub recentre: bool,
    /// Size of all key frames, in bytes, above which an animation is paged, if it has more than eight key frames. A
    /// paged animation holds a few key frames, and reads or computes the others during playback.
    pub key_bytes: u64,
    /// Bytes that the caller needs in addition to the scene. Opening fails if they are not free.
    pub more_bytes: u64,
    /// Bytes that the caller needs per triangle, for example for trees. Opening fails if they are not free.
    pub triangle_bytes: u64,
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self {
            fps: 24.0,
            clip: None,
            allow_outside: false,
            recentre: false,
            key_bytes: 512 << 20,
            more_bytes: 0,
            triangle_bytes: 0,
        }
    }
}

/// Reason why a scene cannot be opened, with the file and the location if known.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct SceneError(pub(crate) String);

/// Result of reading a scene.
pub type Result<T, E = SceneError> = std::result::Result<T, E>;

/// Location of an error in a file: its kind, such as `line`, `byte` or `face`, and its number. Lines count from 1,
/// bytes and list items from 0.
pub(crate) type Location = (&'static str, usize);

impl SceneError {
    /// Creates an error for `place`, which is a path or the name of a scene.
    pub(crate) fn unusable(place: impl AsRef<Path>, cause: impl Display) -> Self {
        Self(format!("{}: {cause}", place.as_ref().display()))
    }

    /// Creates an error for a file that violates its format. Line breaks in `cause` become spaces.
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

    /// Creates an error for a path that the operating system cannot read.
    pub(crate) fn unreadable(path: &Path, source: io::Error) -> Self {
        match source.kind() {
            io::ErrorKind::NotFound => Self::unusable(path, "no such file or directory"),
            _ => Self::unusable(path, format_args!("cannot read: {source}")),
        }
    }
}

#[cfg(test)]
mod testing {
    use crate::mesh::{PolygonMesh, renumber_used_vertices};
    use crate::rounding::Rounding;
    use crate::{Result, Scene, SceneOptions, polygon};
    use geom::Point;
    use std::fs;
    use std::path::PathBuf;
    use tempfile::TempDir;

    /// Writes a file in `folder` and creates its parent directories.
    pub(crate) fn put(folder: &TempDir, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, bytes).unwrap();
        path
    }

    /// Returns the text of an ASCII PLY file. Each line of `vertices` is a vertex, and each line of `faces` is a face.
    pub(crate) fn ascii_ply(vertices: &str, faces: &str) -> String {
        let (v, f) = (vertices.lines().count(), faces.lines().count());
        format!(
            "ply\nformat ascii 1.0\ncomment made here\nelement vertex {v}\nproperty float x\nproperty float y\n\
             property float z\nelement face {f}\nproperty list uchar int vertex_index\nend_header\n{vertices}{faces}"
        )
    }

    /// Triangles with the vertices that they use.
    pub(crate) struct Surface {
        pub(crate) points: Vec<Point>,
        pub(crate) triangles: Vec<[u32; 3]>,
    }

    pub(crate) fn surface(mesh: &PolygonMesh) -> Surface {
        let found = polygon::triangulate(&mesh.polygons, &mesh.points).unwrap();
        let mut triangles = found.triangles;
        let kept = renumber_used_vertices(&mut triangles, mesh.points.len());
        let points = kept.iter().map(|&v| mesh.points[v as usize]);
        let points = points.map(|p| Rounding::default().point(p)).collect();
        Surface { points, triangles }
    }

    /// Opens the inputs `names`, joined by `+`, in `folder`.
    pub(crate) fn open_in(folder: &TempDir, names: &str, options: &SceneOptions) -> Result<Scene> {
        let root = folder.path().to_str().unwrap();
        let spec: Vec<String> = names.split('+').map(|n| format!("{root}/{n}")).collect();
        crate::open(&spec.join("+"), options)
    }

    /// Asserts that a remark on the mesh contains `says`.
    #[track_caller]
    pub(crate) fn assert_note(mesh: &PolygonMesh, says: &str) {
        let has_note = mesh.notes.iter().any(|note| note.contains(says));
        assert!(has_note, "{says:?} is not in {:?}", mesh.notes);
    }

    /// Asserts that `tried` failed with a message of one line that contains all of `says`.
    #[track_caller]
    pub(crate) fn refused<T>(tried: Result<T>, says: &[&str]) {
        let message = tried.err().expect("it is refused").to_string();
        let has_all = says.iter().all(|part| message.contains(part));
        assert!(
            has_all && !message.contains('\n'),
            "{says:?} is not in {message:?}"
        );
    }
}
