//! Cases to test properties on, with the scale and position of each scene.

use super::bodies::{BODIES, BodyRay, BodyRayKind, PlacedBody, body_rays, placed_body};
use super::commands::{BackendCommand, commands};
use super::rays::{RayKind, TargetTriangles, nth_ray};
use super::scenes::{KEYS, MovingMesh, SceneKind, grid_point, scenes};
use super::strategies::{Precision, last_of, precision, runner, shrinking_list, value_tree};
use super::topologies::TreeDescription;
use crate::compare::ray_text;
use geom::{Animation, Camera, CameraPose, Point, Ray};
use proptest::prelude::*;
use proptest::sample::select;
use proptest::strategy::ValueTree;
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
    /// Times to visit, in key frames. Generated cases have three. Most properties build their first tree at the first.
    pub times: Vec<f64>,
    /// Rays to trace. Consecutive rays cycle through the [kinds](crate::RayKind).
    pub rays: Vec<Ray>,
    /// Kinds of the rays.
    pub kinds: Vec<RayKind>,
    /// A camera that sees the scene.
    pub camera: Camera,
    /// A point light.
    pub light: Point,
    /// Trees that no builder makes.
    pub(crate) trees: Vec<TreeDescription>,
    /// Commands between frames.
    pub(crate) commands: Vec<BackendCommand>,
    /// Random bits, for properties that make random choices.
    pub random_bits: u64,
    /// A closed body, for the property that rays do not leak.
    pub(crate) body: PlacedBody,
    /// Rays at the body.
    pub(crate) body_rays: Vec<BodyRay>,
}

/// Maximum number of triangles and of rays that are printed per case.
const PRINTED: usize = 8;

/// Prints the size of a case, and the coordinates of its first triangles and rays.
impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (a, about, times) = (&self.animation, &self.about, &self.times);
        let [triangles, live] = [a.triangle_count(), a.live_count()];
        let [vertices, keys] = [a.vertex_count(), a.key_count()];
        write!(
            f,
            "{about} ({triangles} triangles, {live} of them active in some key frame, {vertices} vertices, \
             {keys} key frames, times {times:?})"
        )?;
        for key in 0..keys {
            let moment = a.at(key as f64).map_err(|_| fmt::Error)?;
            for triangle in 0..triangles.min(PRINTED) {
                let corners = moment.corners(triangle as u32);
                write!(f, "\n  key frame {key}, triangle {triangle}: {corners:?}")?;
            }
        }
        if triangles == 0 {
            write!(f, "\n  vertices {:?}", a.first())?;
        }
        let rays = self.kinds.iter().zip(&self.rays).enumerate();
        for (i, (kind, ray)) in rays.take(PRINTED) {
            write!(f, "\n  ray {i} ({kind}): {}", ray_text(ray))?;
        }
        let eye = self.camera.eye;
        write!(f, "\n  camera at {eye:?}, light at {:?}", self.light)?;
        let more = [triangles, self.rays.len()].map(|n| n.saturating_sub(PRINTED));
        match more {
            [0, 0] => Ok(()),
            [triangles, rays] => write!(f, "\n  and {triangles} more triangles, {rays} more rays"),
        }
    }
}

/// Number of rays of each kind per case.
const ROUNDS: u64 = 6;
/// Number of rays per case at a closed body.
const BODY_RAYS: usize = 240;
/// Distances by which closed bodies are moved from the origin.
const BODY_OFFSETS: [f32; 4] = [0.0, 10.0, 1e3, 1e5];
/// Maximum number of triangles of a scene.
const TRIANGLES: u32 = 2400;

/// Cases with this number, which selects the kind of scene.
///
/// Shrinking removes triangles, key frames and rays, and then simplifies the rest. Rays do not change while triangles
/// are removed.
pub(crate) fn cases(number: u32) -> impl Strategy<Value = Case> {
    let kind = SceneKind::ALL[number as usize % SceneKind::ALL.len()];
    let rays = shrinking_list((0..ROUNDS * RayKind::ALL.len() as u64).map(nth_ray));
    let sizes = (
        shrinking_list((0..TRIANGLES).map(Just)),
        last_of((1..=KEYS).collect::<Vec<_>>()),
    );
    let scene = (sizes, placements(), precision(), scenes(kind));
    let rest = (
        times(),
        lights(),
        TreeDescription::all(),
        grid_point().no_shrink(),
        any::<u64>().no_shrink(),
        commands(),
        bodies(),
        shrinking_list((0..BODY_RAYS).map(|i| body_rays(BodyRayKind::nth(i)))),
    );
    (scene, rays, rest).prop_map(move |(scene, rays, rest)| {
        // `kept` contains indices below `TRIANGLES`. Indices that the scene does not have are ignored.
        let ((kept, key_count), place, precision, (mut keys, triangles)) = scene;
        // The eye is computed from the random point `anywhere`, and so is the light if it is not placed at a triangle.
        let (times, light, trees, anywhere, random_bits, commands, body, body_rays) = rest;
        for p in keys.iter_mut().flatten() {
            *p = precision.point(*p);
        }
        keys.truncate(key_count);
        let end = (keys.len() - 1) as f64;
        let times = times.map(|time| time.min(end));
        let whole = place.animation((keys.clone(), triangles.clone()));
        let targets = TargetTriangles::of(&whole, times[1]);
        let light = light.at_triangle(&whole, times[1]);
        Case {
            number,
            about: format!("{kind}, {place:?}"),
            rays: rays
                .iter()
                .map(|ray| TargetTriangles::pick(&targets, ray))
                .collect(),
            kinds: rays.iter().map(|ray| ray.kind).collect(),
            camera: place.camera(anywhere),
            light: light.unwrap_or_else(|| place.put(anywhere.map(|x| 3.0 * x))),
            animation: if kept.len() < TRIANGLES as usize {
                place.animation(keep_triangles((keys, triangles), &kept))
            } else {
                whole
            },
            times: times.to_vec(),
            trees,
            commands,
            random_bits,
            body,
            body_rays,
        }
    })
}

/// Closed bodies near the origin and far from it, half of which are turned.
fn bodies() -> impl Strategy<Value = PlacedBody> {
    let numbers = (0..BODIES.len(), select(&BODY_OFFSETS[..]), any::<bool>());
    let placed = numbers
        .prop_flat_map(|(body, offset, is_turned)| placed_body(&BODIES[body], offset, is_turned));
    placed.no_shrink()
}

/// Returns case `number` of a seed.
pub fn nth_case(seed: u64, number: u32) -> Case {
    value_tree(&cases(number), &mut runner(seed, number, 0)).current()
}

/// Returns the `kept` triangles of a scene, with only the vertices that they use.
fn keep_triangles((keys, triangles): MovingMesh, kept: &[u32]) -> MovingMesh {
    let numbers = kept.iter().map(|&t| t as usize);
    let some: Vec<[u32; 3]> = numbers.filter_map(|t| triangles.get(t).copied()).collect();
    let mut used = some.as_flattened().to_vec();
    // A scene without triangles keeps one vertex.
    used.extend(some.is_empty().then_some(0));
    used.sort_unstable();
    used.dedup();
    let renamed = |v: u32| used.partition_point(|&u| u < v) as u32;
    let vertices = |key: &Vec<Point>| used.iter().map(|&v| key[v as usize]).collect();
    (
        keys.iter().map(vertices).collect(),
        some.iter().map(|t| t.map(renamed)).collect(),
    )
}

/// Three random times, one of which may be replaced by a key frame. They may be beyond the last key frame of the case.
fn times() -> impl Strategy<Value = [f64; 3]> {
    let end = (KEYS - 1) as f64;
    let numbers = (
        [0.0..end, 0.0..end, 0.0..end],
        proptest::option::of((0..3_usize, 0..KEYS as u8)),
    );
    (precision(), numbers.no_shrink()).prop_map(|(precision, (all, replacement))| {
        // Times are rounded differently from coordinates: `Eighths` rounds to key frames, `ThreeBits` to eighths.
        let mut times = all.map(|time| match precision {
            Precision::Eighths => time.round(),
            Precision::ThreeBits => (8.0 * time).round() / 8.0,
            Precision::Full => time,
        });
        if let Some((i, key)) = replacement {
            times[i] = key.into();
        }
        times
    })
}

/// Description of a light, which may be at a triangle: in its plane but outside it, or at its first vertex.
#[derive(Clone, Copy, Debug)]
struct LightDescription {
    is_at_triangle: bool,
    is_vertex: bool,
    triangle: u32,
}

/// Lights, half of which are at a triangle. They shrink to the others.
fn lights() -> impl Strategy<Value = LightDescription> {
    let numbers = (any::<bool>(), any::<u32>());
    (any::<bool>(), numbers.no_shrink()).prop_map(|(is_at_triangle, (is_vertex, triangle))| {
        LightDescription {
            is_at_triangle,
            is_vertex,
            triangle,
        }
    })
}

impl LightDescription {
    /// Returns the position, if the light is at a triangle and its coordinates are finite.
    fn at_triangle(self, animation: &Animation, time: f64) -> Option<Point> {
        let count = animation.triangle_count() as u32;
        if count == 0 || !self.is_at_triangle {
            return None;
        }
        let reach = if self.is_vertex { 0.0 } else { 3.0 };
        let [a, b, _] = animation.at(time).ok()?.corners(self.triangle % count);
        let light: Point = std::array::from_fn(|i| a[i] + reach * (b[i] - a[i]));
        light.iter().all(|x| x.is_finite()).then_some(light)
    }
}

/// Placement of a scene of about unit size, which is multiplied by `scale` and then moved by `offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ScenePlacement {
    scale: f64,
    offset: [f64; 3],
}

/// A scale, and an offset as a multiple of that scale: scenes far from the origin, and sizes whose products overflow or
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

/// Placements, often the identity, to which the others shrink.
pub(crate) fn placements() -> impl Strategy<Value = ScenePlacement> {
    let elsewhere = select(&ELSEWHERE[..]).no_shrink();
    let all = prop_oneof![5 => Just([1.0, 0.0]), 7 => elsewhere];
    all.prop_map(|[scale, offset]| ScenePlacement {
        scale,
        offset: [offset * scale; 3],
    })
}

impl ScenePlacement {
    /// Returns an animation of a scene with this placement.
    pub(crate) fn animation(&self, (mut keys, triangles): MovingMesh) -> Arc<Animation> {
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

    /// Returns a camera that sees the scene. `anywhere` is a random point in the cube `-1..=1`. It moves the eye and
    /// selects the picture's width.
    ///
    /// The picture has 408 or 255 pixels. GPU backends rasterize no picture of 255 pixels, and pictures of 408 pixels
    /// only if the scene has more than 102 triangles. So properties are tested with and without rasterization.
    pub(crate) fn camera(&self, anywhere: Point) -> Camera {
        let eye = self.put([2.5 + anywhere[0], 1.5 + anywhere[1], 3.0 + anywhere[2]]);
        let pose = CameraPose::new(eye, self.put([0.0; 3])).with_fov(50.0);
        let width = if anywhere[0] < 0.0 { 24 } else { 15 };
        Camera::look_at(pose, [width, 17]).expect("the camera sees the scene")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the smallest case to which case `number` shrinks.
    fn smallest(number: u32) -> Case {
        let mut tree = value_tree(&cases(number), &mut runner(1, number, 0));
        while tree.simplify() {}
        tree.current()
    }

    #[test]
    fn cases_shrink_to_one_triangle() {
        for number in 0..SceneKind::ALL.len() as u32 {
            let case = smallest(number);
            let animation = &case.animation;
            let sizes = [animation.key_count(), case.rays.len(), case.trees.len()];
            assert_eq!(sizes, [1; 3], "{case}");
            assert!(animation.triangle_count() <= 1, "{case}");
            assert_eq!(case.kinds, [RayKind::Random]);
            assert!(
                case.about
                    .ends_with("scale: 1.0, offset: [0.0, 0.0, 0.0] }")
            );
            assert_eq!(case.times, [0.0; 3]);
        }
    }

    #[test]
    fn scenes_respect_the_triangle_limit() {
        for number in 0..90 {
            let case = nth_case(3, number);
            assert!(
                case.animation.triangle_count() <= TRIANGLES as usize,
                "{case}"
            );
        }
    }
}
