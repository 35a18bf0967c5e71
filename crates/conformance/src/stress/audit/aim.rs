//! Rays of every sort at one scene.

use super::mixed;
use crate::stress::rays::{Aims, Target};
use crate::stress::scenes::Scene;
use fastrand::Rng;
use geom::{Point, Ray, Triangle};
use rayon::prelude::*;

/// Sorts of rays, which take turns.
const SORTS: u64 = 16;
/// Triangles of which each may be asked by a single ray.
const FEW: usize = 4096;

/// The first `count` rays of a scene; each depends on the scene, the seed and its number alone.
pub(super) fn rays(scene: &Scene, count: u64, seed: u64) -> Vec<Ray> {
    let pose = scene.animation.pose(scene.time);
    let all = 0..scene.animation.triangle_count() as u32;
    let corners: Vec<Triangle> = all.map(|t| scene.animation.corners(pose, t)).collect();
    let near = Aims::new(without_outliers(&corners));
    let aims = Aims::new(corners);
    let one = |i: u64| {
        let rng = &mut Rng::with_seed(mixed(seed ^ (i + 1)));
        ray([&near, &aims][rng.usize(..4).min(1)], i, rng)
    };
    (0..count).into_par_iter().map(one).collect()
}

/// Triangles without those that reach a thousand times as far as most.
fn without_outliers(all: &[Triangle]) -> Vec<Triangle> {
    let size = |t: &&Triangle| t.iter().flatten().fold(0.0_f32, |m, x| m.max(x.abs()));
    let mut sizes: Vec<f32> = all.iter().map(|t| size(&t)).collect();
    sizes.sort_unstable_by(f32::total_cmp);
    let most = sizes.get(sizes.len() / 2).map_or(0.0, |x| 1000.0 * x);
    all.iter().filter(|t| size(t) <= most).copied().collect()
}

fn ray(aims: &Aims, i: u64, rng: &mut Rng) -> Ray {
    if aims.count() == 0 {
        return Ray::new([0.0; 3], [(); 3].map(|()| rng.f32() - 0.5));
    }
    let target = [Target::Inside, Target::Edge, Target::Vertex][rng.usize(..3)];
    let made = match i % SORTS {
        0 => aims.random(rng),
        1 => aims.aimed(Target::Inside, rng),
        2 | 3 => aims.aimed(Target::Edge, rng),
        4 | 5 => aims.aimed(Target::Vertex, rng),
        6 => aims.aimed_exactly(Target::Edge, rng),
        7 => aims.aimed_exactly(Target::Vertex, rng),
        8 => aims.in_plane(rng),
        9 => aims.in_plane_exactly(rng),
        10 => aims.along_axis(target, rng),
        11 => aims.on_surface(rng),
        12 => aims.between(target, rng),
        13 => aims.beyond(target, far(i, aims.count(), rng), rng),
        14 => limited(aims.aimed_exactly(target, rng), rng),
        _ => aims.along_edge(rng),
    };
    // Now and then much longer or shorter, and now and then no ray at all.
    match i / SORTS % 32 {
        7 | 15 => stretched(made, rng),
        23 if i.is_multiple_of(4) => void(made, rng),
        _ => made,
    }
}

/// How many times the scene's size; hardly ever so far that only whole numbers tell what is hit, of every triangle.
fn far(i: u64, triangles: usize, rng: &mut Rng) -> f64 {
    match i / SORTS % 64 {
        31 if triangles <= FEW => 2.0_f64.powi(rng.i32(70..90)),
        _ => 2.0_f64.powi(rng.i32(4..30)),
    }
}

/// Ends or begins at the target, just before it or just beyond.
fn limited(ray: Ray, rng: &mut Rng) -> Ray {
    let at = [1.0_f32.next_down(), 1.0, 1.0_f32.next_up()][rng.usize(..3)];
    match rng.usize(..3) {
        0 => Ray { t_max: at, ..ray },
        1 => Ray { t_min: at, ..ray },
        _ => Ray {
            t_min: f32::NEG_INFINITY,
            t_max: at - 1.0,
            ..ray
        },
    }
}

fn stretched(ray: Ray, rng: &mut Rng) -> Ray {
    let by = 2.0_f32.powi(rng.i32(-80..80));
    let direction: Point = ray.direction.map(|x| x * by);
    Ray { direction, ..ray }
}

/// A ray that hits nothing, whatever there is.
fn void(ray: Ray, rng: &mut Rng) -> Ray {
    let mut void = ray;
    match rng.usize(..5) {
        0 => void.direction = [0.0, -0.0, 0.0],
        1 => void.direction[rng.usize(..3)] = f32::NAN,
        2 => void.origin[rng.usize(..3)] = f32::INFINITY,
        3 => (void.t_min, void.t_max) = (2.0, 2.0),
        _ => void.t_min = f32::NAN,
    }
    void
}
