//! What a law is tried on, and scenes and rays on which some backend once failed: those are always tried first.

use crate::RayKind;
use crate::generate::meshes::apart;
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
    /// Rays given one by one.
    pub rays: Vec<Ray>,
    /// What each ray was made for, for messages.
    pub kinds: Vec<RayKind>,
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

/// A failure that must not come back.
#[derive(Clone, Copy, Debug)]
pub struct Regression {
    /// Its name, for `--case`.
    pub name: &'static str,
    /// What went wrong.
    pub story: &'static str,
    /// One key frame, three vertices a triangle.
    triangles: &'static [[Point; 3]],
    rays: &'static [Ray],
}

/// All that are kept.
pub const REGRESSIONS: &[Regression] = &[Regression {
    name: "sliver-far-away",
    story: "a sliver so small and far away that its products were subnormal: a device that flushed them missed it",
    triangles: &[[
        [1.000_418e-9, 9.997_51e-10, 1.000_179_9e-9],
        [1.000_442_4e-9, 9.994_834e-10, 1.000_366e-9],
        [1.000_418e-9, 9.997_511e-10, 1.000_179_9e-9],
    ]],
    rays: &[Ray {
        origin: [9.970_69e-10, 9.984_1e-10, 9.994_48e-10],
        t_min: 0.0,
        direction: [3.348_987_8e-12, 1.340_927_4e-12, 7.319_700_4e-13],
        t_max: f32::INFINITY,
    }],
}];

impl Regression {
    /// The scene and its rays.
    #[must_use]
    pub fn case(&self) -> Case {
        let vertices: Vec<Point> = self.triangles.iter().flatten().copied().collect();
        let triangles = apart(self.triangles.len());
        let animation = Animation::new(vec![vertices; 2], triangles)
            .expect("each triangle has its own vertices");
        let Ray {
            origin, direction, ..
        } = self.rays[0];
        let target = std::array::from_fn(|i| origin[i] + direction[i]);
        // The direction's components rotated are no multiple of it.
        let [x, y, z] = direction;
        let camera = Camera::look_at(origin, target, [y, z, x], 50.0, [8, 8]);
        Case {
            about: format!("{}: {}", self.name, self.story),
            animation: Arc::new(animation),
            times: vec![0.0, 0.5, 1.0],
            rays: self.rays.to_vec(),
            kinds: vec![RayKind::Given; self.rays.len()],
            camera: camera.expect("the first ray makes a picture"),
            light: origin,
            chance: 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_told_apart_and_cases_can_be_made() {
        for (i, r) in REGRESSIONS.iter().enumerate() {
            assert!(REGRESSIONS[..i].iter().all(|q| q.name != r.name));
            assert!(r.name.parse::<u32>().is_err());
            let case = r.case();
            assert_eq!(case.rays.len(), case.kinds.len());
        }
    }
}
