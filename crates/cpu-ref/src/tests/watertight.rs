//! Closed meshes keep every ray in, and count it once.

use super::law::{Test, World};
use super::{rng, sphere, tree_at};
use crate::Accelerator;
use crate::bvh2::Bvh2;
use crate::geometry::Geometry;
use crate::intersect::Watertight;
use crate::ray::PreparedRay;
use crate::scale::Scale;
use crate::traverse::{Stack, any, closest};
use backend::Intersector;
use geom::{Animation, Point, Ray};
use proptest::prelude::RngExt;

const RAYS: usize = 120_000;

/// A ray from somewhere inside the sphere to a vertex, to a point of an edge, or anywhere.
fn aimed(animation: &Animation, centre: Point, i: usize, rng: &mut impl RngExt) -> Ray {
    let triangles = animation.triangles();
    let [a, b, c] =
        triangles[rng.random_range(0..triangles.len())].map(|v| animation.first()[v as usize]);
    let w: f32 = rng.random_range(0.0..1.0);
    let target: Point = match i % 4 {
        0 => a,
        1 => std::array::from_fn(|i| a[i] + w * (b[i] - a[i])),
        2 => std::array::from_fn(|i| 0.5 * (b[i] + c[i])),
        _ => std::array::from_fn(|i| a[i] + w * (b[i] - a[i]) * 0.3 + (c[i] - a[i]) * 0.3),
    };
    let origin: Point = match i % 3 {
        0 => centre,
        // Level with the target on an axis: a direction with a zero.
        1 => {
            let out = |k: usize| (target[k] - centre[k]).abs();
            let k = if out(i / 3 % 3) < 0.8 {
                i / 3
            } else {
                i / 3 + 1
            } % 3;
            let mut o = centre;
            o[k] = target[k];
            o
        }
        _ => centre.map(|x| x + rng.random_range(-0.5..0.5)),
    };
    Ray::new(origin, std::array::from_fn(|i| target[i] - origin[i]))
}

#[test]
fn a_closed_sphere_neither_leaks_nor_is_hit_twice() {
    for offset in [0.0, 10.0, 1e3, 1e5] {
        let centre = [offset, -offset, 0.5 * offset];
        let animation = sphere(12, 1.0, centre);
        let mut tree = Bvh2::default();
        let record = tree_at(&animation, animation.pose(0.0));
        tree.adopt(&record, &animation).unwrap();
        tree.preprocess(&geometry(&animation), Intersector::Watertight);
        tree.refit();
        let (mut rng, mut stack) = (rng(), Stack::default());
        for i in 0..RAYS {
            let ray = aimed(&animation, centre, i, &mut rng);
            let ray = PreparedRay::new(&ray, Scale::ONE).unwrap();
            let hit = closest::<_, Watertight>(&tree, &ray, &mut stack);
            let but = hit.expect("no leak").triangle;
            let twice = any::<_, Watertight>(&tree, &ray, Some(but), &mut stack);
            assert!(!twice, "{offset} {ray:?}");
        }
    }
}

fn geometry(animation: &Animation) -> Geometry<'_> {
    Geometry {
        positions: animation.first(),
        triangles: animation.triangles(),
        scale: Scale::ONE,
        range: geom::Range::ORDINARY,
    }
}

#[test]
fn boxes_lose_no_hit_near_or_far() {
    let mut rng = rng();
    for (offset, radius) in [(0.0, 1.0), (10.0, 1.0), (1e3, 1.0), (1e5, 30.0)] {
        let centre = [offset, -offset, 0.5 * offset];
        let animation = sphere(9, radius, centre);
        let world = World::new(geometry(&animation));
        for (i, distance) in (0..24_000).zip([1.0, 10.0, 1e3, 1e5].into_iter().cycle()) {
            let ray = aimed(&animation, centre, i / 4, &mut rng);
            let (o, d) = (ray.origin, ray.direction);
            let back = std::array::from_fn(|k| o[k] - distance * d[k]);
            let target: Point = std::array::from_fn(|k| o[k] + d[k]);
            let far = Ray::new(back, std::array::from_fn(|k| target[k] - back[k]));
            assert_eq!(world.lost_by_boxes(&ray, Test::WATERTIGHT), 0, "{ray:?}");
            assert_eq!(world.lost_by_boxes(&far, Test::WATERTIGHT), 0, "{far:?}");
        }
    }
}
