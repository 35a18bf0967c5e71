//! What a scene takes, compared with what there is before it is allocated.

use crate::{Options, SceneError};
use geom::Point;
use host::Free;
use std::fmt::Display;
use std::path::Path;

/// Refuses key frames that memory does not hold.
pub(crate) fn check_keys(
    place: impl Display,
    keys: usize,
    vertices: usize,
    options: &Options,
) -> Result<(), SceneError> {
    let bytes = (keys as u64)
        .saturating_mul(vertices as u64)
        .saturating_mul(size_of::<Point>() as u64);
    let what = format!(
        "{keys} key frame{} of {vertices} vertices",
        if keys == 1 { "" } else { "s" }
    );
    check(place, what, bytes, options)
}

/// Refuses a mesh whose reading memory does not hold.
pub(crate) fn check_mesh(
    path: &Path,
    [vertices, faces]: [usize; 2],
    bytes: usize,
) -> Result<(), SceneError> {
    host::check(bytes as u64).map_err(|source| SceneError::NotEnoughMemory {
        place: path.display().to_string(),
        what: format!("reading {vertices} vertices and {faces} faces"),
        source,
    })
}

/// Refuses what memory does not hold.
pub(crate) fn check(
    place: impl Display,
    what: String,
    bytes: u64,
    options: &Options,
) -> Result<(), SceneError> {
    let by = "limit given";
    let checked = match options.memory {
        Some(limit) => host::within(bytes, Some(Free { bytes: limit, by })),
        None => host::check(bytes),
    };
    checked.map_err(|source| SceneError::NotEnoughMemory {
        place: place.to_string(),
        what,
        source,
    })
}
