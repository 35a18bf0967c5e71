//! When key frames are: `times.json` beside them, as `abvh inspect --reduced-out` writes it.

use crate::{Scene, SceneError};
use geom::Animation;
use serde::Deserialize;
use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;

/// The file.
pub(crate) const FILE: &str = "times.json";

#[derive(Deserialize)]
struct Times {
    end: f64,
    seconds_per_key: Option<f64>,
    frames: Vec<Frame>,
}

#[derive(Deserialize)]
struct Frame {
    file: String,
    time: f64,
}

/// Gives the key frames of a directory the times that are written there, if any are.
///
/// # Errors
/// The file cannot be read, is none of ours, or tells of other files than there are.
pub(crate) fn apply(directory: &Path, scene: Scene) -> Result<Scene, SceneError> {
    let path = directory.join(FILE);
    let bytes = match host::read(&path) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(scene),
        Err(e) => return Err(SceneError::unreadable(&path, e)),
    };
    let bad = |cause: String| SceneError::BadTimes {
        path: path.clone(),
        cause,
    };
    let times: Times = serde_json::from_slice(&bytes).map_err(|e| bad(e.to_string()))?;
    let files = &scene.facts.files;
    let told = times.frames.iter().map(|f| f.file.as_str());
    let there = files.iter().map(|f| f.file_name().unwrap_or_default());
    if !told.eq(there) {
        let (told, there) = (times.frames.len(), files.len());
        return Err(bad(format!(
            "it tells when {told} key frames are, but not of the {there} files beside it, in their order"
        )));
    }
    let animation = Arc::unwrap_or_clone(scene.animation);
    let timed = timed(animation, &times).map_err(bad)?;
    let mut facts = scene.facts;
    facts.seconds_per_key = times.seconds_per_key.or(facts.seconds_per_key);
    Ok(Scene {
        animation: Arc::new(timed),
        facts,
        ..scene
    })
}

fn timed(animation: Animation, times: &Times) -> Result<Animation, String> {
    let keys: Vec<f64> = times.frames.iter().map(|f| f.time).collect();
    animation.timed(keys, times.end).map_err(|e| e.to_string())
}
