//! Meshes from files.

use crate::{Error, Mesh, Result};
use scene::Scene;
use std::sync::Arc;

impl Mesh {
    /// The mesh of a file (`.obj`, `.ply`, `.gltf` or `.glb`), or of a folder or a pattern of files that are key frames, with
    /// its motion and colours; `demo:NAME` makes one. Key frames that take much memory are read while they are played.
    ///
    /// # Errors
    /// [`Error::KeyFrame`], with the file and the place in it.
    pub fn open(name: &str) -> Result<Self> {
        let found = scene::open(name, &scene::Options::default());
        let found = found.map_err(|e| Error::KeyFrame(e.to_string()))?;
        Ok(Self::from(&found))
    }
}

/// A scene that was read by other options than [`Mesh::open`] has. The crate promises nothing: it may change with each version.
impl From<&Scene> for Mesh {
    fn from(scene: &Scene) -> Self {
        let mesh = Self::animated(Arc::clone(&scene.animation));
        Self {
            colours: Arc::clone(&scene.colours),
            ..mesh
        }
    }
}
