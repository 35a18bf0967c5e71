//! Closed meshes keep every ray in, and count it once.

use crate::law::{Test, World};
use crate::preprocess::Geometry;
use crate::ray::PreparedRay;
use crate::scale::Scale;
use crate::testing::{icosphere, rng, still};
use crate::traverse::{Stack, any, closest};
use crate::watertight::Watertight;
use backend::Intersector;
use geom::{Animation, Point, Ray};
use proptest::prelude::RngExt;
use std::sync::Arc;

const RAYS: usize = 120_000;

/// A ray from somewhere inside the sphere to a vertex, to a point of an edge, or anywhere.
fn aimed(animation: &Animation, centre: Point, i: usize, rng: &mut impl RngExt) -> Ray {
    let triangles = animation.triangles();
    let [a, b, c] =
        triangles[rng.random_range(0..triangles.len())].map(|v| animation.keys()[0][v as usize]);
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

/// Rays that miss the closed sphere from within, and rays that hit two of its triangles.
fn leaks_and_double_hits(offset: f32) -> (usize, usize) {
    let centre = [offset, -offset, 0.5 * offset];
    let animation = Arc::new(icosphere(3, 1.0, centre));
    let mut backend = still(&animation, Intersector::Watertight);
    let target = backend.scene().target();
    let (mut rng, mut stack) = (rng(), Stack::new());
    let (mut leaks, mut doubles) = (0, 0);
    for i in 0..RAYS {
        let ray = aimed(&animation, centre, i, &mut rng);
        let ray = PreparedRay::new(&ray, Scale::ONE).unwrap();
        match closest::<_, Watertight>(target, &ray, &mut stack) {
            None => leaks += 1,
            Some(hit) => {
                let twice = any::<_, Watertight>(target, &ray, Some(hit.triangle), &mut stack);
                doubles += usize::from(twice);
            }
        }
    }
    (leaks, doubles)
}

#[test]
fn a_closed_sphere_at_the_origin_neither_leaks_nor_hits_twice() {
    assert_eq!(leaks_and_double_hits(0.0), (0, 0));
}

#[test]
fn nor_does_one_at_ten() {
    assert_eq!(leaks_and_double_hits(10.0), (0, 0));
}

#[test]
fn nor_does_one_at_a_thousand() {
    assert_eq!(leaks_and_double_hits(1e3), (0, 0));
}

#[test]
fn nor_does_one_at_a_hundred_thousand() {
    assert_eq!(leaks_and_double_hits(1e5), (0, 0));
}

#[test]
fn boxes_lose_no_hit_near_or_far() {
    let mut rng = rng();
    for (offset, radius) in [(0.0, 1.0), (10.0, 1.0), (1e3, 1.0), (1e5, 30.0)] {
        let centre = [offset, -offset, 0.5 * offset];
        let animation = icosphere(2, radius, centre);
        let world = World::new(Geometry {
            positions: &animation.keys()[0],
            triangles: animation.triangles(),
            scale: Scale::ONE,
            range: geom::Range::ORDINARY,
        });
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
