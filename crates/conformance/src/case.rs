//! What a law is tried on.

use geom::{Animation, Camera, Point, Ray};
use std::fmt;
use std::sync::Arc;

/// A scene in motion with rays to trace in it.
#[derive(Clone, Debug)]
pub struct Case {
    /// What it is made of, its scale and how far from the origin it was moved, for messages.
    pub about: String,
    /// The scene.
    pub animation: Arc<Animation>,
    /// Moments to visit, in key frames, at least three; the first is where the first tree is built.
    pub times: Vec<f64>,
    /// Rays given one by one, of each [`crate::RayKind`] in turn.
    pub rays: Vec<Ray>,
    /// A camera that sees the scene.
    pub camera: Camera,
    /// A point light.
    pub light: Point,
    /// Bits at random, for laws with choices of their own.
    pub chance: u64,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let a = &self.animation;
        write!(
            f,
            "{} ({} triangles, {} live, {} vertices, {} key frames, times {:?})",
            self.about,
            a.triangle_count(),
            a.live_count(),
            a.vertex_count(),
            a.key_count(),
            self.times,
        )
    }
}
