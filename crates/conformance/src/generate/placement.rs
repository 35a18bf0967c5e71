//! How large a scene is and where it stands.

use fastrand::Rng;
use geom::{Camera, Point};

/// A scene of about unit size is multiplied by `scale`, then moved by `offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placement {
    scale: f64,
    offset: [f64; 3],
}

/// Scale and, in units of the scaled scene, offset: far from the origin, and at sizes whose products overflow or vanish.
const ELSEWHERE: [[f64; 2]; 12] = [
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
];

/// Coordinates that are subnormal, or nearly: devices that flush them must answer as those that do not.
const TINIEST: [[f64; 2]; 4] = [[1e-36, 0.0], [1e-38, 0.0], [1e-41, 10.0], [1e-43, 0.0]];

/// A name, and how to make a placement.
type Place = (&'static str, fn(&mut Rng) -> Placement);

/// Where an audit puts its meshes.
pub(crate) const PLACES: [Place; 6] = [
    ("moved by 0", |_| Placement::HOME),
    ("moved by 10", |rng| Placement::moved(10.0, rng)),
    ("moved by 1000", |rng| Placement::moved(1e3, rng)),
    ("moved by 100000", |rng| Placement::moved(1e5, rng)),
    ("huge", |rng| Placement::scaled(rng.i32(40..124), rng)),
    ("tiny", |rng| Placement::scaled(-rng.i32(40..146), rng)),
];

impl Placement {
    const HOME: Self = Self {
        scale: 1.0,
        offset: [0.0; 3],
    };

    /// At home, elsewhere or, now and then, so small that coordinates are subnormal.
    pub(crate) fn any(rng: &mut Rng) -> Self {
        let [scale, offset] = match rng.usize(..12) {
            0..5 => [1.0, 0.0],
            5..11 => ELSEWHERE[rng.usize(..ELSEWHERE.len())],
            _ => TINIEST[rng.usize(..TINIEST.len())],
        };
        Self {
            scale,
            offset: [offset * scale; 3],
        }
    }

    /// So far from the origin along each axis. Multiples of a power of two keep what is exact in a mesh, others do not.
    fn moved(far: f64, rng: &mut Rng) -> Self {
        Self {
            scale: 1.0,
            offset: [(); 3].map(|()| if rng.bool() { far } else { -far }),
        }
    }

    /// About the origin, so many powers of two as large, or up to twice that.
    fn scaled(power: i32, rng: &mut Rng) -> Self {
        let by = if rng.bool() { 1.0 } else { 1.0 + rng.f64() };
        Self {
            scale: by * 2.0_f64.powi(power),
            ..Self::HOME
        }
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
