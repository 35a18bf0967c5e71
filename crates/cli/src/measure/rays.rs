//! The rays of measured frames: a camera's with shadows, or random ones.

use crate::camera::LitCamera;
use backend::{Query, QueryKind, Rays};
use clap::ValueEnum;
use fastrand::Rng;
use geom::{Aabb, Point, Ray};
use scene::Scene;

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum MeasuredRays {
    /// Primary rays through each pixel, and their shadow rays
    Camera,
    /// Random origins in the scene's bounds, random directions
    Random,
}

impl MeasuredRays {
    /// Returns the name in results, or `None` for camera rays, which results do not name.
    pub(crate) fn name_unless_camera(self) -> Option<&'static str> {
        (self == Self::Random).then_some("random")
    }
}

/// The rays of all frames of a run.
pub(crate) enum FrameRays<'a> {
    Camera(&'a LitCamera),
    Random(Vec<Ray>),
}

impl<'a> FrameRays<'a> {
    /// Returns rays of a kind: one per pixel of the camera.
    pub(crate) fn of(kind: MeasuredRays, scene: &Scene, lit_camera: &'a LitCamera) -> Self {
        let bounds = scene.animation.bounds();
        match kind {
            MeasuredRays::Camera => Self::Camera(lit_camera),
            MeasuredRays::Random => Self::Random(random_rays(&bounds, lit_camera.camera.pixels())),
        }
    }

    pub(super) fn query(&self) -> Query<'_> {
        match self {
            Self::Camera(lit_camera) => lit_camera.query(),
            Self::Random(rays) => Query {
                rays: Rays::List(rays),
                kind: QueryKind::Closest,
            },
        }
    }
}

/// Returns rays from random points in a box in random directions, the same on every machine.
fn random_rays(bounds: &Aabb, count: usize) -> Vec<Ray> {
    let mut rng = Rng::with_seed(0);
    let mut ray = || {
        let mut at = |i: usize| bounds.min[i] + rng.f32() * (bounds.max[i] - bounds.min[i]);
        let origin = [at(0), at(1), at(2)];
        Ray::new(origin, direction(&mut rng))
    };
    (0..count).map(|_| ray()).collect()
}

/// Returns a uniformly distributed direction: a point of the unit ball, found by rejection.
fn direction(rng: &mut Rng) -> Point {
    loop {
        let mut side = || 2.0 * rng.f32() - 1.0;
        let v = [side(), side(), side()];
        let square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
        if (0.01..=1.0).contains(&square) {
            return v;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_rays_are_uniformly_distributed() {
        let bounds = Aabb {
            min: [-1.0, 10.0, 0.0],
            max: [3.0, 11.0, 0.0],
        };
        let rays = random_rays(&bounds, 20_000);
        let within = |r: &Ray| bounds.with_point(r.origin) == bounds;
        assert!(rays.iter().all(|r| r.is_valid() && within(r)));
        let mean = |of: &dyn Fn(&Ray) -> f32| {
            rays.iter().map(|r| f64::from(of(r))).sum::<f64>() / rays.len() as f64
        };
        assert!((mean(&|r| r.origin[0]) - 1.0).abs() < 0.05);
        assert!((mean(&|r| r.origin[1]) - 10.5).abs() < 0.02);
        for i in 0..3 {
            assert!(mean(&|r| r.direction[i]).abs() < 0.02);
            // Each axis has a third of the squared length.
            let share = |r: &Ray| {
                let squares = r.direction.map(|x| x * x);
                squares[i] / squares.iter().sum::<f32>()
            };
            assert!((mean(&share) - 1.0 / 3.0).abs() < 0.01);
        }
        assert_eq!(random_rays(&bounds, 3), rays[..3]);
    }
}
