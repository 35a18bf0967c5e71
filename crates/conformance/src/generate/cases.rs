//! What laws are tried on: every case.

use super::mixed;
use super::placement::Placement;
use super::rays::{Aims, RayKind, turn};
use super::scenes::{SceneKind, scene, unit};
use fastrand::Rng;
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

/// Rays of a case: so many of each kind.
const ROUNDS: u64 = 6;

/// The `i`-th case of a seed.
#[must_use]
pub fn nth_case(seed: u64, i: u32) -> Case {
    let rng = &mut Rng::with_seed(mixed(mixed(seed) ^ u64::from(i)));
    let kind = SceneKind::ALL[i as usize % SceneKind::ALL.len()];
    let place = Placement::any(rng);
    let animation = place.animation(scene(kind, rng));
    // One of them is often a key frame.
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
        about: format!("{kind}, {place:?}"),
        rays,
        camera: place.camera(anywhere),
        light: hard_light(&animation, times[1], rng).unwrap_or(light),
        animation,
        times: times.to_vec(),
        chance: rng.u64(..),
    }
}

/// Half the time, a light where shadows are hardest: in a triangle's plane beyond it, or at one of its vertices.
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
