//! Cases to test properties on, with the scale and position of each scene.

use super::mixed;
use super::rays::{Aims, RayKind, turn};
use super::scenes::{Moving, SceneKind, scene, unit};
use fastrand::Rng;
use geom::{Animation, Camera, Point, Ray};
use std::fmt;
use std::sync::Arc;

/// An animated scene with rays to trace in it.
#[derive(Clone, Debug)]
pub struct Case {
    /// Number of the case within its seed.
    pub number: u32,
    /// Description for messages: kind of scene, scale and offset from the origin.
    pub about: String,
    /// The scene.
    pub animation: Arc<Animation>,
    /// Times to visit, in key frames. There are at least three, and the first tree is built at the first one.
    pub times: Vec<f64>,
    /// List of rays, of each [`crate::RayKind`] in rotation.
    pub rays: Vec<Ray>,
    /// A camera that sees the scene.
    pub camera: Camera,
    /// A point light.
    pub light: Point,
    /// Random bits, for properties that make random choices.
    pub chance: u64,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (a, about, times) = (&self.animation, &self.about, &self.times);
        let [triangles, live] = [a.triangle_count(), a.live_count()];
        let [vertices, keys] = [a.vertex_count(), a.key_count()];
        write!(
            f,
            "{about} ({triangles} triangles, {live} live, {vertices} vertices, {keys} key frames, times {times:?})"
        )
    }
}

/// Number of rays of each kind per case.
const ROUNDS: u64 = 6;

/// Returns case `i` of a seed.
pub fn nth_case(seed: u64, i: u32) -> Case {
    let rng = &mut Rng::with_seed(mixed(mixed(seed) ^ u64::from(i)));
    let kind = SceneKind::ALL[i as usize % SceneKind::ALL.len()];
    let place = Placement::any(rng);
    let animation = place.animation(scene(kind, rng));
    // Often one of the times is a key frame.
    let mut times = [(); 3].map(|()| 2.0 * rng.f64());
    if rng.bool() {
        times[rng.usize(..3)] = f64::from(rng.u8(..3));
    }
    let aims = Aims::of(&animation, times[1]);
    let numbers = 0..ROUNDS * RayKind::ALL.len() as u64;
    let rays = numbers.map(|i| turn(&aims, i, rng)).collect();
    let anywhere = unit(rng);
    let light = place.put(anywhere.map(|x| 3.0 * x));
    Case {
        number: i,
        about: format!("{kind}, {place:?}"),
        rays,
        camera: place.camera(anywhere),
        light: hard_light(&animation, times[1], rng).unwrap_or(light),
        animation,
        times: times.to_vec(),
        chance: rng.u64(..),
    }
}

/// Returns, half of the time, a light where shadows are hardest: in a triangle's plane outside the triangle, or at one
/// of its vertices.
fn hard_light(animation: &Animation, time: f64, rng: &mut Rng) -> Option<Point> {
    let count = animation.triangle_count() as u32;
    let (hard, reach) = (rng.bool(), [0.0, 3.0][rng.usize(..2)]);
    if count == 0 || !hard {
        return None;
    }
    let [a, b, _] = animation.at(time).unwrap().corners(rng.u32(..count));
    let light: Point = std::array::from_fn(|i| a[i] + reach * (b[i] - a[i]));
    light.iter().all(|x| x.is_finite()).then_some(light)
}

/// Placement of a scene of about unit size, which is multiplied by `scale` and then moved by `offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placement {
    scale: f64,
    offset: [f64; 3],
}

/// Scales and offsets, in units of the scaled scene: far from the origin, and at sizes whose products overflow or
/// underflow.
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
    // Coordinates that are subnormal or nearly so. Devices that flush them must give the same results as those that do
    // not.
    [1e-36, 0.0],
    [1e-38, 0.0],
    [1e-41, 10.0],
    [1e-43, 0.0],
];

impl Placement {
    /// Returns a random placement, often the identity.
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

    /// Returns an animation of a scene with this placement.
    pub(crate) fn animation(&self, (mut keys, triangles): Moving) -> Arc<Animation> {
        for p in keys.iter_mut().flatten() {
            *p = self.put(*p);
        }
        let animation = Animation::new(keys, triangles);
        Arc::new(animation.expect("scenes made here are sound"))
    }

    /// Places a point of the unit scene, rounded once. A zero keeps its sign if the offset is 0.
    pub(crate) fn put(&self, p: Point) -> Point {
        std::array::from_fn(|i| {
            let (x, by) = (f64::from(p[i]) * self.scale, self.offset[i]);
            let moved = if by == 0.0 { x } else { x + by };
            moved as f32
        })
    }

    /// Returns a camera that sees the scene.
    pub(crate) fn camera(&self, unit: Point) -> Camera {
        let eye = self.put([2.5 + unit[0], 1.5 + unit[1], 3.0 + unit[2]]);
        let target = self.put([0.0; 3]);
        let up = [0.0, 1.0, 0.0];
        Camera::look_at(eye, target, up, 50.0, [24, 17]).expect("the camera sees the scene")
    }
}
