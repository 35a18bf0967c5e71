//! What is charted: numbers that somebody else measured.
//!
//! Everything that may be unknown is an `Option`. A number that is not finite
//! counts as unknown too: it is written as `null` and read back as `None`.

use serde::{Deserialize, Serialize};

/// All that one chart shows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Chart {
    /// Heading.
    pub title: String,
    /// What did the work.
    pub machine: Machine,
    /// What was traced; one panel each, in this order. A scene that only points name gets a panel, too.
    pub scenes: Vec<Scene>,
    /// What was measured, in any order.
    pub points: Vec<Point>,
    /// What else is known.
    #[serde(default)]
    pub companions: Companions,
}

/// What did the work.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// Name of the host's processor.
    pub cpu: Option<String>,
    /// Version of the program.
    pub version: String,
    /// The day of the measurement, as the caller wants it read.
    pub date: String,
    /// Who stands behind the names of the backends.
    pub adapters: Vec<Adapter>,
}

/// Who stands behind a backend's name.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Adapter {
    /// The backend.
    pub backend: String,
    /// The device's own name.
    pub adapter: String,
    /// Driver and version; empty where there is none.
    pub driver: String,
}

/// What was traced.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// Its name, as in [`Point::scene`].
    pub name: String,
    /// Triangles.
    pub triangles: u64,
    /// Pixels of a frame: width, height.
    pub size: [u32; 2],
    /// Frames that each run traced.
    pub frames: u64,
}

/// One way of tracing one scene: how fast it was, and how often wrong.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Name of the backend; shown by colour.
    pub backend: String,
    /// Name of the tree's layout; shown by label.
    pub layout: String,
    /// Name of the intersector; shown by shape.
    pub intersector: String,
    /// Name of the update policy; shown by fill.
    pub update: String,
    /// The scene.
    pub scene: String,
    /// Milliseconds a frame.
    pub ms_per_frame: Spread,
    /// Million rays a second.
    pub mrays_per_s: Option<f64>,
    /// Rays whose answers were compared with those of exact arithmetic.
    pub rays_tested: u64,
    /// How many of them got another closest hit.
    pub wrong: u64,
    /// How many of them got another answer to whether the hit is in shadow.
    pub wrong_shadow: u64,
    /// Rays aimed at edges and vertices of the scene itself, which [`Self::rays_tested`] leaves out.
    #[serde(default)]
    pub aimed: Aimed,
    /// How far `t` was off where the hit was right.
    pub t_error_ulp: Option<TError>,
    /// What became of rays aimed at edges and vertices of a closed mesh.
    pub leaks: Vec<Leaks>,
    /// Answers in scenes of mixed range: sizes or places of very different magnitude in one scene.
    #[serde(default)]
    pub mixed_range: Vec<FamilyCounts>,
    /// Bytes of memory that the backend held.
    pub memory_bytes: Option<u64>,
    /// Frames that were timed.
    pub samples: u64,
    /// Seconds that the device was warmed up before them.
    #[serde(default)]
    pub warm_up_s: Option<f64>,
    /// The command that measures this point again.
    pub command: String,
}

/// How a time was spread over the frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// The middle one. Without it, or if it is not above zero, a point is not drawn.
    pub median: Option<f64>,
    /// 5 of 100 were less.
    pub p5: Option<f64>,
    /// 95 of 100 were less.
    pub p95: Option<f64>,
}

/// Errors of `t`, in units in the last place of the exact `t` rounded to f32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TError {
    /// The middle one.
    pub median: Option<f64>,
    /// 999 of 1000 were less.
    pub p999: Option<f64>,
    /// The largest.
    pub worst: Option<f64>,
}

/// Rays for which a hit is hardest to tell, counted apart from all others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Aimed {
    /// Rays.
    pub rays: u64,
    /// How many of them got another closest hit than by exact arithmetic.
    pub wrong: u64,
}

/// How many of a family's rays got another closest hit than by exact arithmetic.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FamilyCounts {
    /// Name of the family, as `abvh stability` lists it.
    pub family: String,
    /// Rays.
    pub rays: u64,
    /// How many were wrong.
    pub wrong: u64,
}

/// Rays aimed from inside at edges and vertices of a closed mesh that was moved away from the origin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Leaks {
    /// How far the mesh was moved, in units of its size; `None` if that is not finite.
    pub offset: Option<f64>,
    /// Rays.
    pub rays: u64,
    /// How many met nothing.
    pub leaks: u64,
    /// Rays of those whose crossings were counted.
    pub counted: u64,
    /// How many of the counted met two triangles where a generic ray meets one.
    pub double_hits: u64,
}

/// What stands below the main panels, beside what the points themselves tell.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Companions {
    /// How many key frames a scene needs; one curve a scene.
    pub key_frames: Vec<KeyFrames>,
}

/// How many key frames one scene needs, and what they cost.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KeyFrames {
    /// The scene.
    pub scene: String,
    /// In any order.
    pub steps: Vec<KeyFrameStep>,
}

/// A scene reduced to the key frames that a tolerance asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KeyFrameStep {
    /// How far a vertex may be from its place, as a fraction of the scene's diagonal.
    pub tolerance: Option<f64>,
    /// Key frames that were kept.
    pub key_frames: u64,
    /// How far a vertex is at most, as a fraction of the scene's diagonal.
    pub max_error: Option<f64>,
    /// Milliseconds a frame with these key frames.
    pub ms: Option<f64>,
}

/// The number if it is one.
pub(crate) fn known(x: Option<f64>) -> Option<f64> {
    x.filter(|x| x.is_finite())
}

impl Point {
    /// Everything that tells it from others of its scene.
    pub(crate) fn name(&self) -> String {
        [
            &*self.backend,
            &self.layout,
            &self.intersector,
            &self.update,
        ]
        .join(" ")
    }
}
