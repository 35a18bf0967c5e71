//! Options that control how scenes are read, and the description of a scene in statistics.

use crate::command::Requirement;
use crate::error::CliError;
use crate::parsers;
use clap::Args;
use pipeline::{HOST_BYTES_PER_TRIANGLE, trees_and_rays_bytes};
use scene::{Scene, SceneOptions};
use serde_json::{Value, json};

/// How a scene is read.
#[derive(Args, Debug)]
pub(crate) struct SceneSettings {
    /// Key frames per second that are sampled from a glTF clip
    #[arg(long, value_name = "N", default_value = "24", value_parser = parsers::number(|fps: f64| fps > 0.0 && fps <= 1000.0,
        "the number of samples per second must be above 0 and at most 1000"))]
    pub(crate) fps: f64,
    /// glTF clip to sample [default: the first]
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) clip: Option<String>,
    /// Let a scene's files refer to files outside its folder (mtllib of OBJ, URIs of glTF)
    #[arg(long)]
    pub(crate) allow_outside: bool,
    /// Subtract the scene's centre in double precision before coordinates are rounded to single precision. Points and
    /// rays on the command line and in files are still given in the scene's original coordinates
    #[arg(long)]
    pub(crate) recentre: bool,
    /// Memory for key frames, in MiB. Larger sequences of more than 8 key frames are read from disk during playback
    #[arg(long, value_name = "MIB", default_value = "512")]
    pub(crate) key_memory: u32,
}

impl SceneSettings {
    /// Opens a scene for a run that builds trees and traces `rays` rays at a time. The memory for both counts towards
    /// the limit that is checked before key frames are read.
    pub(crate) fn open(&self, name: &str, rays: usize) -> Result<Scene, CliError> {
        let options = SceneOptions {
            // Only the memory of the rays: `triangle_bytes` covers the trees.
            more_bytes: trees_and_rays_bytes(0, rays),
            triangle_bytes: HOST_BYTES_PER_TRIANGLE,
            fps: self.fps,
            clip: self.clip.clone(),
            allow_outside: self.allow_outside,
            recentre: self.recentre,
            key_bytes: u64::from(self.key_memory) << 20,
        };
        Ok(scene::open(name, &options)?)
    }
}

/// Returns what `--fps` and `--recentre` require of the scenes.
pub(crate) fn requirements(scenes: &[impl AsRef<str>]) -> Vec<Requirement> {
    let mut scenes = scenes.iter().map(AsRef::as_ref);
    vec![
        Requirement::new(
            "fps",
            scenes.clone().any(may_have_clip),
            "applies only to a .gltf or .glb scene",
        ),
        Requirement::new(
            "recentre",
            scenes.any(has_file),
            "applies only to scenes that are read from files",
        ),
    ]
}

/// Returns whether a scene, or its first input, is a demo.
pub(crate) fn is_demo(scene: &str) -> bool {
    scene.starts_with("demo:")
}

/// Returns whether an input of the scene can be a file.
fn has_file(scene: &str) -> bool {
    !scene.split('+').all(is_demo)
}

/// Returns whether the scene can contain a glTF clip: its name has an extension of glTF, or it is a pattern.
pub(crate) fn may_have_clip(scene: &str) -> bool {
    let scene = scene.to_lowercase();
    let mut parts = [".gltf", ".glb", "*", "?", "["].iter();
    parts.any(|part| scene.contains(part))
}

/// Describes a scene and its source. `live` is the number of triangles that are active in some key frame. `moving` is
/// the number of live triangles that move. Other live triangles are interpolated, preprocessed and refitted only once.
pub(crate) fn scene_facts(scene: &Scene) -> Value {
    let (animation, facts) = (&scene.animation, &scene.facts);
    json!({
        "name": scene.name,
        "keys": animation.key_count(),
        "vertices": animation.vertex_count(),
        "triangles": animation.triangle_count(),
        "live": animation.live_count(),
        "moving": animation.moving_count(),
        "facts": {
            "format": facts.format,
            "files": facts.files.iter().map(|f| f.to_string_lossy()).collect::<Vec<_>>(),
            "clip": facts.clip,
            "seconds_per_key": facts.seconds_per_key,
            "offset": facts.offset,
            "notes": facts.notes,
        },
    })
}
