//! Placeholder.
use crate::{Options, Scene, SceneError};
use std::path::Path;
pub(crate) fn open(_: String, path: &Path, _: &Options) -> Result<Scene, SceneError> {
    Err(SceneError::UnsupportedExtension {
        path: path.to_owned(),
    })
}
