//! What is known of a scene and of its frames, as the statistics file says it.

use scene::Scene;
use serde_json::{Value, json};

/// The command line, program first.
pub(crate) fn command_line() -> Vec<String> {
    std::env::args_os()
        .map(|a| a.to_string_lossy().into_owned())
        .collect()
}

/// What was rendered, and what else its source told. `live` triangles are active in some key frame. Those that never move
/// are interpolated, preprocessed and refitted once.
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
            "notes": facts.notes,
        },
    })
}
