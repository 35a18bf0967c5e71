//! Rays to test with: pictures of a scene, and rays aimed where it hurts.

use fastrand::Rng;
use geom::{Animation, Camera, Point, Pose, Ray, Triangle};

/// The camera that the program would choose.
///
/// # Panics
/// If the scene cannot be framed.
#[must_use]
pub fn camera(animation: &Animation, size: [u32; 2]) -> Camera {
    output::frame_scene(animation, 40.0, size)
        .camera(size)
        .expect("every scene can be framed")
}

/// The light that the program would choose.
#[must_use]
pub fn light(animation: &Animation) -> Point {
    output::frame_scene(animation, 40.0, [64, 64]).light
}

/// Where on a triangle to aim.
#[derive(Clone, Copy, Debug)]
pub enum Target {
    /// A point of its inside.
    Inside,
    /// A point of an edge.
    Edge,
    /// A vertex.
    Vertex,
}

/// `count` rays from `distance` times the scene's size away, from all sides,
/// each aimed (but for rounding) at a target on a triangle taken at random.
#[must_use]
pub fn aimed(
    animation: &Animation,
    pose: Pose,
    target: Target,
    distance: f32,
    count: usize,
) -> Vec<Ray> {
    let mut rng = Rng::with_seed(2014);
    let bounds = animation.bounds();
    let radius = distance * bounds.extent().into_iter().fold(0.0, f32::max);
    let centre: Point = std::array::from_fn(|i| 0.5 * (bounds.min[i] + bounds.max[i]));
    let mut next = || {
        let triangle = rng.u32(0..animation.triangle_count() as u32);
        let aim = point_on(&animation.corners(pose, triangle), target, &mut rng);
        let away = direction(&mut rng);
        let origin: Point = std::array::from_fn(|i| centre[i] + radius * away[i]);
        Ray::new(origin, std::array::from_fn(|i| aim[i] - origin[i]))
    };
    let all = std::iter::repeat_with(&mut next);
    all.filter(Ray::is_valid).take(count).collect()
}

fn point_on([a, b, c]: &Triangle, target: Target, rng: &mut Rng) -> Point {
    let (x, y) = (rng.f32(), rng.f32());
    let (v, w) = match target {
        Target::Vertex => (0.0, 0.0),
        Target::Edge => (x, 0.0),
        Target::Inside => (x.min(y), 1.0 - x.max(y)),
    };
    std::array::from_fn(|i| a[i] + v * (b[i] - a[i]) + w * (c[i] - a[i]))
}

/// A direction of length about 1, from a cube's worth of candidates.
fn direction(rng: &mut Rng) -> Point {
    loop {
        let d = [(); 3].map(|()| 2.0 * rng.f32() - 1.0);
        let length = d.iter().map(|x| x * x).sum::<f32>().sqrt();
        if (0.1..1.0).contains(&length) {
            return d.map(|x| x / length);
        }
    }
}
