//! Rays of a scene: a camera's, some at random, and some aimed at edges and vertices.

use fastrand::Rng;
use geom::{Aabb, Animation, Moment, Point, Ray, is_active};
use output::View;

/// Where rays begin, in sizes of the scene's box.
const ROOM: f64 = 2.0;
/// How often a triangle is drawn before a scene counts as having none to aim at.
const DRAWS: usize = 64;

/// The middle of each of `count` equal stretches of the motion; one moment if nothing moves.
pub(super) fn moments(animation: &Animation, count: usize) -> Vec<f64> {
    let end = animation.end();
    let count = if end > 0.0 { count } else { 1 };
    let at = |i: usize| end * (i as f64 + 0.5) / count as f64;
    (0..count).map(at).collect()
}

/// `count` rays, half of them a camera's and half at random; and a quarter as many that are aimed.
pub(super) fn at(animation: &Animation, view: &View, time: f64, count: usize) -> [Vec<Ray>; 2] {
    let mut rng = Rng::with_seed(time.to_bits());
    let bounds = animation.bounds();
    let mut plain = of_camera(view, count / 2);
    plain.resize_with(count, || at_random(&bounds, &mut rng));
    let moment = animation.at(time);
    let aim = |_| aimed(moment.as_ref().ok()?, &bounds, &mut rng);
    [plain, (0..count / 4).filter_map(aim).collect()]
}

/// Of a camera of about that many pixels, row by row; fewer if there is no camera.
fn of_camera(view: &View, count: usize) -> Vec<Ray> {
    let width = (count as f64 * 1.6).sqrt().ceil().max(1.0) as u32;
    let height = count.div_ceil(width as usize).max(1) as u32;
    let camera = view.camera([width, height]);
    camera.map_or_else(Vec::new, |c| c.rays().take(count).collect())
}

/// From somewhere around the box to somewhere in it.
fn at_random(bounds: &Aabb, rng: &mut Rng) -> Ray {
    let from = within(bounds, ROOM, rng);
    towards(from, within(bounds, 1.0, rng))
}

/// From somewhere around the box at a vertex, or at a point on an edge as near as its coordinates can be.
fn aimed(moment: &Moment<'_>, bounds: &Aabb, rng: &mut Rng) -> Option<Ray> {
    let count = u32::try_from(moment.animation().triangle_count()).ok()?;
    let mut draw = || (count > 0).then(|| moment.corners(rng.u32(..count)));
    let corners = (0..DRAWS).find_map(|_| draw().filter(is_active))?;
    let k = rng.usize(..3);
    let (a, b) = (corners[k], corners[(k + 1) % 3]);
    let s = if rng.bool() { 0.0 } else { rng.f32() };
    let at = std::array::from_fn(|i| a[i] + s * (b[i] - a[i]));
    Some(towards(within(bounds, ROOM, rng), at))
}

fn towards(from: Point, to: Point) -> Ray {
    Ray::new(from, std::array::from_fn(|i| to[i] - from[i]))
}

/// Anywhere in the box blown up about its middle; the origin if there is no box.
fn within(bounds: &Aabb, by: f64, rng: &mut Rng) -> Point {
    if bounds.is_empty() {
        return [0.0; 3];
    }
    std::array::from_fn(|i| {
        let [low, high] = [bounds.min[i], bounds.max[i]].map(f64::from);
        let half = 0.5 * (high - low) * by;
        (f64::midpoint(low, high) + half * (2.0 * rng.f64() - 1.0)) as f32
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sort_of_ray_is_made_and_the_same_ones_again() {
        let scene = scene::open("demo:collide:300", &scene::Options::default()).unwrap();
        let a = &scene.animation;
        let view = output::frame_scene(a, 40.0, [64, 40]);
        let rays = at(a, &view, 1.5, 1000).concat();
        assert_eq!(rays.len(), 1250);
        assert!(rays.iter().all(Ray::is_valid));
        let from_eye = rays.iter().filter(|r| r.origin == view.eye);
        assert_eq!(from_eye.count(), 500);
        assert!(rays == at(a, &view, 1.5, 1000).concat(), "made again");
    }

    #[test]
    fn moments_lie_between_the_ends_and_stillness_has_one() {
        let key = |x| vec![[x, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let of = |keys| Animation::new(keys, vec![[0, 1, 2]]).unwrap();
        let moving = of(vec![key(0.0), key(1.0), key(2.0)]);
        assert_eq!(moments(&moving, 2), [0.5, 1.5]);
        assert_eq!(moments(&of(vec![key(0.0)]), 2), [0.0]);
    }

    #[test]
    fn a_scene_without_a_triangle_to_aim_at_has_fewer_rays() {
        let nothing = Animation::new(vec![vec![[f32::NAN; 3]]], vec![[0; 3]]).unwrap();
        let view = output::frame_scene(&nothing, 40.0, [64, 40]);
        assert_eq!(at(&nothing, &view, 0.0, 100).map(|r| r.len()), [100, 0]);
    }
}
