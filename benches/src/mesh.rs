//! Meshes to measure with.

use geom::{Animation, Point, Pose, Triangle};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Environment variable with the folder of real meshes.
const FOLDER: &str = "ABVH_MESHES";
/// Scenes that require no file.
const DEMOS: [&str; 3] = ["demo:grove", "demo:collide", "demo:shatter"];

/// An animation whose start is used for builds, and its middle for refits.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Name and number of triangles, such as `grove 174020`.
    pub label: String,
    /// The animation.
    pub animation: Arc<Animation>,
}

impl Mesh {
    /// Opens a scene by its name, as `abvh` does.
    ///
    /// # Errors
    /// The scene cannot be opened.
    pub fn open(spec: &str) -> Result<Self, scene::SceneError> {
        let scene = scene::open(spec, &scene::SceneOptions::default())?;
        let triangles = scene.animation.triangle_count();
        Ok(Self {
            label: format!("{} {triangles}", scene.name),
            animation: scene.animation,
        })
    }

    /// Returns the number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.animation.triangle_count()
    }

    /// Returns the pose at which trees are built.
    pub fn start(&self) -> Pose {
        self.animation.pose(0.0)
    }

    /// Returns the pose at which trees are refitted.
    pub fn middle(&self) -> Pose {
        self.animation.pose(self.animation.end() / 2.0)
    }

    /// Returns all vertices at `pose`: a key frame, and the weight that blends it with the next one.
    pub fn positions(&self, pose: Pose) -> Vec<Point> {
        let vertices = 0..self.animation.vertex_count() as u32;
        // A moment gives access to the positions at a pose.
        let moment = self.animation.moment(pose).unwrap();
        vertices.map(|v| moment.vertex(v)).collect()
    }

    /// Returns all triangles at `pose`.
    pub fn triangles(&self, pose: Pose) -> Vec<Triangle> {
        let triangles = 0..self.triangle_count() as u32;
        let moment = self.animation.moment(pose).unwrap();
        triangles.map(|t| moment.corners(t)).collect()
    }
}

/// Opens each entry of the folder in `ABVH_MESHES` that `abvh` can open: a mesh file, or a directory of key frames.
///
/// If there is no such entry, opens demos of about 174,000, 252,000 and 1.6 million triangles.
pub fn meshes() -> Vec<Mesh> {
    let files = entries().into_iter().map(|path| path.display().to_string());
    let meshes: Vec<Mesh> = files.filter_map(opened).collect();
    if meshes.is_empty() {
        return DEMOS.into_iter().filter_map(opened).collect();
    }
    meshes
}

fn opened(spec: impl AsRef<str>) -> Option<Mesh> {
    let mesh = Mesh::open(spec.as_ref());
    mesh.inspect_err(|error| say(&format!("skipped: {error}")))
        .ok()
}

fn entries() -> Vec<PathBuf> {
    let Some(folder) = std::env::var_os(FOLDER) else {
        say(&format!("{FOLDER} is not set: only demos are measured"));
        return Vec::new();
    };
    let read = Path::new(&folder).read_dir();
    let read = read.inspect_err(|error| say(&format!("{FOLDER}: {}: {error}", folder.display())));
    let all = read.into_iter().flatten().flatten();
    let mut entries: Vec<PathBuf> = all.map(|entry| entry.path()).collect();
    entries.sort();
    entries
}

#[expect(clippy::print_stderr, reason = "a message to the user")]
fn say(remark: &str) {
    eprintln!("{remark}");
}
