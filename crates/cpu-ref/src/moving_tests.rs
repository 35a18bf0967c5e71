//! What never moves is passed over, and nobody can tell.

use crate::CpuBackend;
use crate::simd::Level;
use crate::testing::{Kind, ready, rng, tree_at};
use backend::{Backend, Intersector, Layout, Ticket};
use geom::{Aabb, Animation, Point};
use proptest::prelude::RngExt;
use std::sync::Arc;

/// Free triangles of which the first `moving` move through three key frames.
fn scene(moving: usize, all: usize) -> Arc<Animation> {
    let mut rng = rng();
    let mut point = || -> Point { std::array::from_fn(|_| rng.random_range(1.0..100.0)) };
    let mut keys = vec![Vec::new(); 3];
    for triangle in 0..all {
        let (corner, way) = (point(), point());
        for (k, key) in keys.iter_mut().enumerate() {
            // What moves stands close together, so that siblings move.
            let (by, corner) = match triangle < moving {
                true => (k as f32, corner.map(|x| 0.05 * x)),
                false => (0.0, corner),
            };
            let at = |e: Point| std::array::from_fn(|i| corner[i] + by * way[i] + e[i]);
            key.extend([[0.0; 3], [0.5, 0.0, 0.2], [0.0, 0.5, 0.1]].map(at));
        }
    }
    let triangles = (0..all as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
    Arc::new(Animation::new(keys, triangles.collect()).unwrap())
}

/// Only the binary tree knows what moves.
fn method() -> (Intersector, Kind) {
    (Intersector::Watertight, (Layout::Bvh2, Level::best()))
}

fn seen(backend: &mut CpuBackend, animation: &Animation, time: f64) -> (Vec<Aabb>, f64) {
    backend.interpolate(animation.pose(time)).unwrap();
    backend.preprocess().unwrap();
    backend.refit().unwrap();
    let ticket: Ticket = backend.submit().unwrap();
    let cost = backend.wait(ticket).unwrap().sah_cost.unwrap();
    (backend.inspect().boxes().unwrap(), cost)
}

#[test]
fn many_tasks_over_lists_do_what_one_over_everything_does() {
    let animation = scene(6_000, 60_000);
    let start = animation.pose(0.0);
    let plain = tree_at(&animation, start);
    let listed = plain.clone().with_moving(animation.static_parts());
    assert!(listed.moving().is_some());
    let open = |tree, threads| ready(&animation, method(), tree, start, threads);
    let (mut whole, mut one, mut many) = (open(&plain, 2), open(&listed, 1), open(&listed, 3));
    for time in [0.4, 1.0, 2.0, 0.0] {
        let (boxes, cost) = seen(&mut whole, &animation, time);
        let (one_boxes, one_cost) = seen(&mut one, &animation, time);
        let (many_boxes, many_cost) = seen(&mut many, &animation, time);
        assert!(boxes == one_boxes && boxes == many_boxes, "{time}");
        assert_eq!(one_cost.to_bits(), many_cost.to_bits(), "{time}");
        assert!((one_cost / cost - 1.0).abs() < 1e-12, "{one_cost} {cost}");
    }
}

#[test]
fn a_scene_that_stands_still_has_a_cost_all_the_same() {
    let animation = scene(0, 3_000);
    let tree = tree_at(&animation, animation.pose(0.0)).with_moving(animation.static_parts());
    let mut backend = ready(&animation, method(), &tree, animation.pose(0.0), 2);
    let first = seen(&mut backend, &animation, 0.0);
    assert!(first.1 > 1.0 && first == seen(&mut backend, &animation, 1.5));
}
