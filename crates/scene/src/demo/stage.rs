//! Parts that move, put together into one animation.

use super::shapes::Mesh;
use crate::Rgb;
use geom::{Animation, AnimationError, Point};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use rayon::prelude::*;

/// Writes where the vertices at rest stand at a time in `0.0..=1.0`.
type Motion = Box<dyn Fn(f64, &[DVec3], &mut [Point]) + Send + Sync>;

/// A mesh with one colour a triangle that knows how it moves.
pub(super) struct Part {
    mesh: Mesh,
    colours: Vec<Rgb>,
    motion: Motion,
}

impl Part {
    /// A part whose vertex at rest at `p` stands at `motion(time)(p)`; `colour` sees the middle of each triangle at rest.
    pub(super) fn new<F, G>(mesh: Mesh, colour: impl Fn(DVec3) -> Rgb, motion: F) -> Self
    where
        F: Fn(f64) -> G + Send + Sync + 'static,
        G: Fn(DVec3) -> DVec3,
    {
        let colours = mesh
            .triangles
            .iter()
            .map(|&t| colour(mesh.middle(t)))
            .collect();
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

    /// A part that keeps its shape.
    pub(super) fn rigid(
        mesh: Mesh,
        colour: impl Fn(DVec3) -> Rgb,
        pose: impl Fn(f64) -> DAffine3 + Send + Sync + 'static,
    ) -> Self {
        Self::new(mesh, colour, move |time| {
            let pose = pose(time);
            move |p| pose.transform_point3(p)
        })
    }

    /// A part that stands still.
    pub(super) fn still(mesh: Mesh, colour: impl Fn(DVec3) -> Rgb) -> Self {
        Self::new(mesh, colour, |_| |p| p)
    }

    /// How many triangles it has.
    pub(super) fn len(&self) -> usize {
        self.mesh.triangles.len()
    }
}

/// All parts at `keys` times spread evenly over `0.0..=1.0`.
pub(super) fn assemble(parts: &[Part], keys: u32) -> Result<(Animation, Vec<Rgb>), AnimationError> {
    let vertices = parts.iter().map(|p| p.mesh.points.len()).sum();
    let frame = |key: u32| {
        let time = f64::from(key) / f64::from(keys - 1);
        let mut frame = vec![[0.0; 3]; vertices];
        let mut rest = frame.as_mut_slice();
        for part in parts {
            let (own, after) = rest.split_at_mut(part.mesh.points.len());
            (part.motion)(time, &part.mesh.points, own);
            rest = after;
        }
        frame
    };
    let frames = (0..keys).into_par_iter().map(frame).collect();
    let mut triangles = Vec::with_capacity(parts.iter().map(Part::len).sum());
    let mut first = 0;
    for part in parts {
        triangles.extend(part.mesh.triangles.iter().map(|t| t.map(|v| v + first)));
        first += part.mesh.points.len() as u32;
    }
    let colours = parts
        .iter()
        .flat_map(|p| p.colours.iter().copied())
        .collect();
    Ok((Animation::new(frames, triangles)?, colours))
}

/// Rotation by `angle` radians round a unit axis, by `libm` so that it has the same bits everywhere.
pub(super) fn rotation(axis: DVec3, angle: f64) -> DMat3 {
    let (sin, cos) = (libm::sin(0.5 * angle), libm::cos(0.5 * angle));
    DMat3::from_quat(DQuat::from_vec4((axis * sin).extend(cos)))
}

/// 0 up to `start`, 1 from `end` on, smooth between.
pub(super) fn smoothstep(start: f64, end: f64, x: f64) -> f64 {
    let x = ((x - start) / (end - start)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// `colour` made lighter (`amount > 0`) or darker, a tenth at 0.1.
pub(super) fn shade(colour: Rgb, amount: f64) -> Rgb {
    colour.map(|c| libm::round((f64::from(c) * (1.0 + amount)).clamp(0.0, 255.0)) as u8)
}

/// From `a` at 0 to `b` at 1.
pub(super) fn blend(a: Rgb, b: Rgb, weight: f64) -> Rgb {
    let w = weight.clamp(0.0, 1.0);
    std::array::from_fn(|i| libm::round(f64::from(a[i]) * (1.0 - w) + f64::from(b[i]) * w) as u8)
}
