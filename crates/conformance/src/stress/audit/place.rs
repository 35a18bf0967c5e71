//! How large a mesh is and how far from the origin.

use crate::stress::scenes::Scene;
use fastrand::Rng;
use geom::Animation;
use std::sync::Arc;

/// Where a mesh is put.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Placement {
    /// So far from the origin along each axis.
    Offset(u32),
    /// About the origin, between `2^40` and `2^124` times as large.
    Huge,
    /// About the origin, between `2^40` and `2^145` times as small.
    Tiny,
}

impl Placement {
    pub(super) const ALL: [Self; 6] = [
        Self::Offset(0),
        Self::Offset(10),
        Self::Offset(1000),
        Self::Offset(100_000),
        Self::Huge,
        Self::Tiny,
    ];

    pub(super) fn name(self) -> String {
        match self {
            Self::Offset(by) => format!("moved by {by}"),
            Self::Huge => "huge".to_owned(),
            Self::Tiny => "tiny".to_owned(),
        }
    }

    /// Puts the scene there; each coordinate is rounded once.
    pub(super) fn put(self, scene: Scene, rng: &mut Rng) -> Scene {
        let sign = |rng: &mut Rng| if rng.bool() { 1.0 } else { -1.0 };
        // Multiples of a power of two keep what is exact in a mesh, others do not.
        let by = if rng.bool() { 1.0 } else { 1.0 + rng.f64() };
        let (scale, offset) = match self {
            Self::Offset(0) => return scene,
            Self::Offset(far) => (1.0, f64::from(far)),
            Self::Huge => (by * 2.0_f64.powi(rng.i32(40..124)), 0.0),
            Self::Tiny => (by * 2.0_f64.powi(-rng.i32(40..146)), 0.0),
        };
        let offset = [(); 3].map(|()| sign(rng) * offset);
        let put = |p: &[f32; 3]| {
            std::array::from_fn(|i| {
                let x = f64::from(p[i]) * scale;
                // A zero keeps its sign where nothing is added to it.
                (if offset[i] == 0.0 { x } else { x + offset[i] }) as f32
            })
        };
        let keys = scene.animation.keys().iter();
        let keys = keys.map(|key| key.iter().map(put).collect()).collect();
        let animation = Animation::new(keys, scene.animation.triangles().to_vec());
        Scene {
            animation: Arc::new(animation.expect("the mesh is the same")),
            ..scene
        }
    }
}
