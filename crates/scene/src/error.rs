//! What can be wrong with a scene, in one clear line each.

use geom::AnimationError;

/// Why a scene cannot be opened. Every message is one line and names the file and the place where there is one.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// No demo has that name.
    #[error("unknown demo {name:?}; there are {}", crate::demo::DEMOS.join(", "))]
    UnknownDemo {
        /// The name asked for.
        name: String,
    },
    /// The number after a demo's name is none.
    #[error(
        "bad triangle count {text:?} in demo:{demo}:{text}: give a whole number in 1..={}",
        crate::demo::MAX_DEMO_TRIANGLES
    )]
    BadTriangleCount {
        /// The demo.
        demo: String,
        /// What was given for a number.
        text: String,
    },
    /// Key frames and triangles do not fit together.
    #[error(transparent)]
    Animation(#[from] AnimationError),
}
