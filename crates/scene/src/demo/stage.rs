//! Moving parts, their assembly into one animation, and ballistic fragments. Thrown fragments tumble, slow down by
//! drag, and bounce until they rest on the floor.

use super::shapes::{DemoMesh, sheet, sheet_size};
use crate::mesh::joined_triangles;
use crate::paging::KeySize;
use crate::{Result, Rgb, SceneOptions, paging};
use geom::{Animation, Point};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use rayon::prelude::*;

/// Number of vertices per parallel task.
const RUN: usize = 1 << 15;

/// Writes the positions of vertices at a time in `0.0..=1.0`, from their rest positions.
type MotionFunction = Box<dyn Fn(f64, &[DVec3], &mut [Point]) + Send + Sync>;

/// Mesh with one colour per triangle and a motion.
pub(super) struct DemoPart {
    mesh: DemoMesh,
    colours: Vec<Rgb>,
    motion: MotionFunction,
}

impl DemoPart {
    /// Creates a part whose vertex with rest position `p` moves to `motion(time)(p)`. `colour` receives the centroid of
    /// each triangle at rest.
    pub(super) fn new<F, G>(mesh: DemoMesh, colour: impl Fn(DVec3) -> Rgb + Sync, motion: F) -> Self
    where
        F: Fn(f64) -> G + Send + Sync + 'static,
        G: Fn(DVec3) -> DVec3,
    {
        let triangles = mesh.triangles.par_iter();
        let colours = triangles.map(|&t| colour(mesh.middle(t))).collect();
        Self {
            mesh,
            colours,
            motion: Box::new(move |time, rest, out| {
                let at = motion(time);
                for (to, &from) in out.iter_mut().zip(rest) {
                    *to = at(from).as_vec3().to_array();
                }
            }),
        }
    }

    pub(super) fn rigid(
        mesh: DemoMesh,
        colour: impl Fn(DVec3) -> Rgb + Sync,
        pose: impl Fn(f64) -> DAffine3 + Send + Sync + 'static,
    ) -> Self {
        Self::new(mesh, colour, move |time| {
            let pose = pose(time);
            move |p| pose.transform_point3(p)
        })
    }

    /// Creates a static part. Adds zero to turn -0 into +0. Interpolation would change a -0, so its vertex would not
    /// count as static.
    pub(super) fn still(mesh: DemoMesh, colour: impl Fn(DVec3) -> Rgb + Sync) -> Self {
        Self::new(mesh.map(|p| p + DVec3::ZERO), colour, |_| |p| p)
    }

    /// Creates a horizontal floor with sides in metres. `noise` varies its colour.
    pub(super) fn floor(
        budget: usize,
        [width, depth]: [f64; 2],
        colour: Rgb,
        noise: impl Fn(DVec3) -> f64 + Sync,
    ) -> Self {
        let mesh = sheet(sheet_size(budget, width / depth), |u, v| {
            DVec3::new((u - 0.5) * width, 0.0, (v - 0.5) * depth)
        });
        Self::still(mesh, |p| shade(colour, 0.05 * noise(p)))
    }

    pub(super) fn len(&self) -> usize {
        self.mesh.triangles.len()
    }
}

/// Combines all parts into an animation of `keys` key frames, evenly spaced over `0.0..=1.0`. Also returns one colour
/// per triangle.
pub(super) fn assemble(
    parts: Vec<DemoPart>,
    keys: u32,
    options: &SceneOptions,
) -> Result<(Animation, Vec<Rgb>)> {
    let vertices = parts.iter().map(|p| p.mesh.points.len()).sum();
    let meshes = parts.iter().map(|p| &p.mesh);
    let meshes = meshes.map(|m| (&m.triangles[..], m.points.len()));
    let triangles = joined_triangles("demo", meshes)?;
    let colours = parts.iter().flat_map(|p| p.colours.iter().copied());
    let colours = colours.collect();
    let source = move |key: usize| {
        let time = key as f64 / f64::from(keys - 1);
        let mut frame = vec![[0.0; 3]; vertices];
        let mut rest = frame.as_mut_slice();
        for DemoPart { mesh, motion, .. } in &parts {
            let (own, after) = rest.split_at_mut(mesh.points.len());
            let runs = own.par_chunks_mut(RUN).zip(mesh.points.par_chunks(RUN));
            runs.for_each(|(to, from)| motion(time, from, to));
            rest = after;
        }
        Ok(frame)
    };
    let keys = keys as usize;
    let size = KeySize { keys, vertices };
    let animation = paging::animation(source, None, size, triangles, options)?;
    Ok((animation, colours))
}

/// Returns the rotation by `angle` radians about a unit axis. Uses `libm` for bit-identical results on all machines.
pub(super) fn rotation(axis: DVec3, angle: f64) -> DMat3 {
    let (sin, cos) = (libm::sin(0.5 * angle), libm::cos(0.5 * angle));
    DMat3::from_quat(DQuat::from_vec4((axis * sin).extend(cos)))
}

/// Returns 0 up to `start`, 1 from `end`, and a smooth transition between.
pub(super) fn smoothstep(start: f64, end: f64, x: f64) -> f64 {
    let x = ((x - start) / (end - start)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Scales the brightness of `colour` by `1 + amount`.
pub(super) fn shade(colour: Rgb, amount: f64) -> Rgb {
    colour.map(|c| libm::round((f64::from(c) * (1.0 + amount)).clamp(0.0, 255.0)) as u8)
}

pub(super) fn blend(a: Rgb, b: Rgb, weight: f64) -> Rgb {
    let w = weight.clamp(0.0, 1.0);
    std::array::from_fn(|i| libm::round(f64::from(a[i]) * (1.0 - w) + f64::from(b[i]) * w) as u8)
}

/// Initial state of a thrown fragment. Units are metres, seconds and radians.
#[derive(Clone, Copy)]
pub(super) struct Trajectory {
    /// Initial position of the centre.
    pub(super) start: DVec3,
    pub(super) velocity: DVec3,
    /// Axis of rotation, a unit vector.
    pub(super) axis: DVec3,
    /// Initial angular velocity in radians per second about `axis`.
    pub(super) spin: f64,
    /// Height of the centre when the fragment rests on the floor. At most `start.y`.
    pub(super) rest: f64,
}

impl Trajectory {
    /// Returns the pose after `seconds`.
    pub(super) fn pose(&self, seconds: f64) -> DAffine3 {
        const DRAG: f64 = 0.45;
        let slowed = (1.0 - libm::exp(-DRAG * seconds)) / DRAG;
        let mut place = self.start + self.velocity * slowed;
        place.y = self.rest + bounce(self.start.y - self.rest, self.velocity.y, seconds);
        DAffine3::from_mat3_translation(rotation(self.axis, self.spin * slowed), place)
    }
}

/// Returns the height of a bouncing ball that is thrown up from `height`. Each bounce reduces its speed to two fifths,
/// and the ball rests after the sixth.
fn bounce(mut height: f64, mut speed: f64, mut seconds: f64) -> f64 {
    const GRAVITY: f64 = 9.81;
    for _ in 0..6 {
        let landing_speed = (speed * speed + 2.0 * GRAVITY * height).sqrt();
        let flight = (speed + landing_speed) / GRAVITY;
        if seconds < flight {
            return (height + (speed - 0.5 * GRAVITY * seconds) * seconds).max(0.0);
        }
        (height, speed, seconds) = (0.0, 0.4 * landing_speed, seconds - flight);
    }
    0.0
}
