//! How large a scene is and where it stands.

use super::scenes::Moving;
use fastrand::Rng;
use geom::{Animation, Camera, Point};
use std::sync::Arc;

/// A scene of about unit size is multiplied by `scale`, then moved by `offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placement {
    scale: f64,
    offset: [f64; 3],
}

/// Scale and, in units of the scaled scene, offset: far from the origin, and at sizes whose products overflow or vanish.
const ELSEWHERE: [[f64; 2]; 16] = [
    [1.0, 10.0],
    [1.0, 1e3],
    [1.0, 1e5],
    [1.0, -3e6],
    [1e-3, 0.0],
    [1e6, 1e3],
    [1e-12, 0.0],
    [1e-12, 1e3],
    [1e15, 0.0],
    [1e15, 1e5],
    [1e30, 10.0],
    [3e37, 0.0],
    // Coordinates that are subnormal, or nearly: devices that flush them must answer as those that do not.
    [1e-36, 0.0],
    [1e-38, 0.0],
    [1e-41, 10.0],
    [1e-43, 0.0],
];

impl Placement {
    /// At home or elsewhere.
    pub(crate) fn any(rng: &mut Rng) -> Self {
        let [scale, offset] = match rng.usize(..12) {
            0..5 => [1.0, 0.0],
            _ => ELSEWHERE[rng.usize(..ELSEWHERE.len())],
        };
        Self {
            scale,
            offset: [offset * scale; 3],
        }
    }

    /// A scene put there.
    pub(crate) fn animation(&self, (mut keys, triangles): Moving) -> Arc<Animation> {
        for p in keys.iter_mut().flatten() {
            *p = self.put(*p);
        }
        let animation = Animation::new(keys, triangles);
        Arc::new(animation.expect("scenes made here are sound"))
    }

    /// Where a point of the unit scene is put, rounded once. A zero keeps its sign where nothing is added to it.
    pub(crate) fn put(&self, p: Point) -> Point {
        std::array::from_fn(|i| {
            let x = f64::from(p[i]) * self.scale;
            (if self.offset[i] == 0.0 {
                x
            } else {
                x + self.offset[i]
            }) as f32
        })
    }

    /// A camera that sees the scene.
    pub(crate) fn camera(&self, unit: Point) -> Camera {
        let eye = self.put([2.5 + unit[0], 1.5 + unit[1], 3.0 + unit[2]]);
        let target = self.put([0.0; 3]);
        let up = [0.0, 1.0, 0.0];
        Camera::look_at(eye, target, up, 50.0, [24, 17]).expect("the camera sees the scene")
    }
}
