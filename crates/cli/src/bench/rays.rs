//! Which rays a bench traces: a camera's, with shadows, or such as have nothing in common.

use super::FOV;
use crate::args::RaysName;
use crate::stop::Stop;
use backend::{Query, QueryKind, Rays};
use fastrand::Rng;
use geom::{Aabb, Animation, Camera, Point, Ray};

/// Rays of one kind for one scene.
pub(super) enum Bundle {
    /// A camera's, and where the light is.
    Camera(Box<Camera>, Point),
    /// Single ones, of which the closest hit is sought.
    List(Vec<Ray>),
}

impl Bundle {
    /// Of so many pixels; of as many rays where they are at random.
    ///
    /// # Errors
    /// No camera frames the scene.
    pub(super) fn of(
        kind: RaysName,
        (spec, animation): (&str, &Animation),
        size: [u32; 2],
    ) -> Result<Self, Stop> {
        let view = output::frame_scene(animation, FOV, size);
        let camera = view.camera(size);
        let camera = camera.ok_or_else(|| Stop::bad(format!("no camera frames {spec}")))?;
        Ok(match kind {
            RaysName::Camera => Self::Camera(Box::new(camera), view.light),
            RaysName::Random => Self::List(random(&animation.bounds(), camera.pixels())),
        })
    }

    /// What is traced in each frame.
    pub(super) fn query(&self) -> Query<'_> {
        match self {
            Self::Camera(camera, light) => Query {
                rays: Rays::Camera(camera),
                kind: QueryKind::ClosestAndShadow { light: *light },
            },
            Self::List(rays) => Query {
                rays: Rays::List(rays),
                kind: QueryKind::Closest,
            },
        }
    }

    /// Rays of a frame with so many hits, those to the light included.
    pub(super) fn count(&self, hits: u64) -> f64 {
        match self {
            Self::Camera(camera, _) => camera.pixels() as f64 + hits as f64,
            Self::List(rays) => rays.len() as f64,
        }
    }
}

/// Rays from anywhere in a box in any direction, the same on every machine.
fn random(bounds: &Aabb, count: usize) -> Vec<Ray> {
    let mut rng = Rng::with_seed(0);
    let mut ray = || {
        let mut at = |i: usize| bounds.min[i] + rng.f32() * (bounds.max[i] - bounds.min[i]);
        let origin = [at(0), at(1), at(2)];
        Ray::new(origin, direction(&mut rng))
    };
    (0..count).map(|_| ray()).collect()
}

/// A direction, all equally likely: a point of the unit ball, found by rejection.
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
    fn random_rays_fill_the_box_and_all_directions_evenly() {
        let bounds = Aabb {
            min: [-1.0, 10.0, 0.0],
            max: [3.0, 11.0, 0.0],
        };
        let rays = random(&bounds, 20_000);
        assert!(
            rays.iter()
                .all(|r| bounds.contains(&Aabb::EMPTY.with_point(r.origin)) && r.is_valid())
        );
        let mean = |of: &dyn Fn(&Ray) -> f32| {
            rays.iter().map(|r| f64::from(of(r))).sum::<f64>() / rays.len() as f64
        };
        assert!((mean(&|r| r.origin[0]) - 1.0).abs() < 0.05);
        assert!((mean(&|r| r.origin[1]) - 10.5).abs() < 0.02);
        for i in 0..3 {
            assert!(mean(&|r| r.direction[i]).abs() < 0.02);
            // A third of the length, each way.
            let share = |r: &Ray| {
                let squares = r.direction.map(|x| x * x);
                squares[i] / squares.iter().sum::<f32>()
            };
            assert!((mean(&share) - 1.0 / 3.0).abs() < 0.01);
        }
        assert_eq!(random(&bounds, 3), rays[..3]);
    }
}
