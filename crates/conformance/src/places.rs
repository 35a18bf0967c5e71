//! How large a scene is and where it stands.

use geom::{Camera, Point};
use proptest::prelude::*;

/// A scene of about unit size is moved by `offset`, then multiplied by `scale`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placement {
    pub(crate) scale: f32,
    pub(crate) offset: f32,
}

const AT_HOME: Placement = Placement {
    scale: 1.0,
    offset: 0.0,
};

/// Far from the origin, and at sizes whose products overflow or vanish.
const ELSEWHERE: [[f32; 2]; 12] = [
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
const TINIEST: [[f32; 2]; 4] = [[1e-36, 0.0], [1e-38, 0.0], [1e-41, 10.0], [1e-43, 0.0]];

pub(crate) fn place() -> impl Strategy<Value = Placement> {
    let all = |list: &'static [[f32; 2]]| {
        prop::sample::select(list).prop_map(|[scale, offset]| Placement { scale, offset })
    };
    prop_oneof![5 => Just(AT_HOME), 6 => all(&ELSEWHERE), 1 => all(&TINIEST)]
}

impl Placement {
    /// Where a point of the unit scene comes to stand. A zero keeps its sign where nothing is added to it.
    pub(crate) fn put(self, p: Point) -> Point {
        match self.offset {
            0.0 => p.map(|x| x * self.scale),
            offset => p.map(|x| (x + offset) * self.scale),
        }
    }

    /// A point in the scene's neighbourhood, `reach` times its size.
    pub(crate) fn at(self, unit: Point, reach: f32) -> Point {
        unit.map(|x| self.centre() + x * reach * self.scale)
    }

    /// Each coordinate of the scene's middle.
    pub(crate) fn centre(self) -> f32 {
        self.offset * self.scale
    }

    pub(crate) fn camera(self, unit: Point) -> Camera {
        let away = [2.5 + unit[0], 1.5 + unit[1], 3.0 + unit[2]];
        let eye = self.at(away, 1.0);
        let target = self.at([0.0; 3], 1.0);
        let up = [0.0, 1.0, 0.0];
        Camera::look_at(eye, target, up, 50.0, [24, 17]).expect("the camera sees the scene")
    }
}
