//! What a backend owes its caller, as far as no other backend can be the measure; and that misuse panics.

use super::{
    bits, closest, deform, moving, ready, rng, senseless_tree, soup, still, trace, tree_at,
};
use crate::CpuBackend;
use backend::{Backend, Generation, Intersector, Query, QueryKind, Rays, Ticket};
use bvh_layout::Topology;
use geom::{Aabb, Animation, Hit, Point, Ray};
use proptest::prelude::RngExt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

/// The box of each node, from its own triangles.
fn boxes_from_scratch(animation: &Animation, tree: &Topology, positions: &[Point]) -> Vec<Aabb> {
    let mut boxes = vec![Aabb::EMPTY; tree.node_count()];
    let (mut leaf, mut inner) = (tree.leaf_count(), tree.leaf_count() - 1);
    for node in (0..tree.node_count()).rev() {
        boxes[node] = if tree.ranks().of(node as u32).leaf().is_some() {
            leaf -= 1;
            let t = animation.triangles()[tree.leaf_triangles()[leaf] as usize];
            let corners = t.map(|v| positions[v as usize]);
            if geom::is_active(&corners) && !geom::is_degenerate(&corners) {
                Aabb::of_triangle(&corners)
            } else {
                Aabb::EMPTY
            }
        } else {
            inner -= 1;
            boxes[2 * inner + 1].union(boxes[2 * inner + 2])
        };
    }
    boxes
}

fn boxes_and_cost(backend: &mut CpuBackend, animation: &Animation, time: f64) -> (Vec<Aabb>, f64) {
    deform(backend, animation.pose(time));
    let ticket = backend.submit().unwrap();
    let cost = backend.wait(ticket).unwrap().sah_cost.unwrap();
    (backend.inspect().boxes().unwrap(), cost)
}

#[test]
fn a_refitted_tree_has_the_boxes_of_one_made_from_scratch() {
    let animation = moving();
    let pose = animation.pose(0.0);
    for tree in [tree_at(&animation, pose), senseless_tree(&animation)] {
        let mut backend = ready(&animation, Intersector::Watertight, &tree, pose, 2);
        for time in [0.0, 0.4, 1.0, 1.7, 2.0] {
            let (found, cost) = boxes_and_cost(&mut backend, &animation, time);
            let positions = backend.inspect().positions().unwrap();
            let expected = boxes_from_scratch(&animation, &tree, &positions);
            assert_eq!(found, expected, "{time}");
            let areas: f64 = expected.iter().map(Aabb::half_area).sum();
            let ratio = cost / (areas / expected[0].half_area());
            assert!((ratio - 1.0).abs() < 1e-12, "{ratio}");
        }
    }
}

/// Free triangles of which the first `moving` move through three key frames.
fn partly_static(moving: usize, all: usize) -> Arc<Animation> {
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

#[test]
fn what_never_moves_is_skipped_by_any_number_of_tasks_without_a_trace() {
    let animation = partly_static(6_000, 60_000);
    let start = animation.pose(0.0);
    let plain = tree_at(&animation, start);
    let listed = plain.clone().with_moving(animation.static_parts());
    assert!(listed.moving().is_some());
    let open = |tree, threads| ready(&animation, Intersector::Watertight, tree, start, threads);
    let (mut whole, mut one, mut many) = (open(&plain, 2), open(&listed, 1), open(&listed, 3));
    for time in [0.4, 1.0, 2.0, 0.0] {
        let (boxes, cost) = boxes_and_cost(&mut whole, &animation, time);
        let (one_boxes, one_cost) = boxes_and_cost(&mut one, &animation, time);
        let (many_boxes, many_cost) = boxes_and_cost(&mut many, &animation, time);
        assert!(boxes == one_boxes && boxes == many_boxes, "{time}");
        assert_eq!(one_cost.to_bits(), many_cost.to_bits(), "{time}");
        assert!((one_cost / cost - 1.0).abs() < 1e-12, "{one_cost} {cost}");
        let rays = animation.first().iter().step_by(100);
        let rays: Vec<Ray> = rays.map(|&to| Ray::new([0.0; 3], to)).collect();
        let [a, b] = [&mut one, &mut many].map(|backend| bits(&closest(backend, &rays)));
        assert!(a == b, "{time}");
    }
    let still = partly_static(0, 3_000);
    let tree = tree_at(&still, still.pose(0.0)).with_moving(still.static_parts());
    let mut backend = ready(&still, Intersector::Watertight, &tree, start, 2);
    let first = boxes_and_cost(&mut backend, &still, 0.0);
    assert!(first.1 > 1.0 && first == boxes_and_cost(&mut backend, &still, 1.5));
}

#[test]
fn reports_count_what_happened() {
    let animation = moving();
    let mut backend = still(&animation, Intersector::Watertight);
    let rays = [Ray::new([0.1, 0.2, 9.0], [0.0, 0.0, -1.0]); 5];
    // At first one triangle is not there yet and one never is.
    for (time, inactive, degenerate) in [(0.0, 2, 0), (1.0, 1, 1), (2.0, 1, 0), (0.5, 2, 0)] {
        deform(&mut backend, animation.pose(time));
        let light = [0.0, 9.0, 0.0];
        let kind = QueryKind::ClosestAndShadow { light };
        let rays = Rays::List(&rays);
        backend.trace(Query { rays, kind }).unwrap();
        let ticket = backend.submit().unwrap();
        let report = backend.wait(ticket).unwrap();
        let hits = backend.hits(ticket).unwrap();
        let count = hits.closest.iter().filter(|h| h.is_hit()).count() as u64;
        let blocked = hits.blocked.iter().filter(|&&b| b == 1).count() as u64;
        let found = [
            report.inactive,
            report.degenerate,
            report.hits,
            report.blocked,
        ];
        assert_eq!(found, [inactive, degenerate, count, blocked], "{time}");
    }
}

#[test]
fn a_tree_of_nothing_is_all_misses() {
    let animation = soup(&[[[f32::NAN; 3]; 3]; 4]);
    let mut backend = still(&animation, Intersector::Watertight);
    let rays = [Ray::new([0.0; 3], [1.0, 0.0, 0.0])];
    let kind = QueryKind::ClosestAndShadow { light: [1.0; 3] };
    let hits = trace(&mut backend, Rays::List(&rays), kind);
    assert_eq!((hits.closest, hits.blocked), (vec![Hit::MISS], vec![0]));
    assert!(backend.inspect().boxes().unwrap().is_empty());
    let ticket = backend.submit().unwrap();
    let report = backend.wait(ticket).unwrap();
    assert_eq!((report.inactive, report.sah_cost), (4, None));
}

#[test]
fn a_list_is_traced_once_in_its_place_and_reported_with_the_rest() {
    let animation = moving();
    let [early, late] = [0.3, 1.7].map(|time| animation.pose(time));
    let eye = [0.3, 0.2, 9.0];
    let through = |v: &[f32; 3]| Ray::new(eye, std::array::from_fn(|i| v[i] - eye[i]));
    let moment = animation.moment(early).unwrap();
    let vertices = (0..animation.vertex_count() as u32).map(|v| moment.vertex(v));
    let rays: Vec<Ray> = vertices.map(|v| through(&v)).collect();
    let tree = tree_at(&animation, early);
    let fresh = |pose| ready(&animation, Intersector::Exact, &tree, pose, 1);
    let expected = trace(&mut fresh(early), Rays::List(&rays), QueryKind::Closest);
    let mut backend = fresh(late);
    deform(&mut backend, early);
    let (rays, kind) = (Rays::List(&rays), QueryKind::Closest);
    backend.trace(Query { rays, kind }).unwrap();
    backend.interpolate(late).unwrap();
    let ticket = backend.submit().unwrap();
    let report = backend.wait(ticket).unwrap();
    assert_eq!(*backend.hits(ticket).unwrap(), expected);
    assert!(report.settled > 0, "rays through vertices are open");
    let times = report.times;
    let stages = [times.interpolate_ms, times.preprocess_ms, times.refit_ms];
    let stages = stages.into_iter().chain([times.trace_primary_ms]);
    let sum: f64 = stages.map(|ms| ms.expect("each was timed")).sum();
    assert!(sum <= times.device_ms);
    let [found, expected] = [backend, fresh(late)].map(|mut backend| {
        let positions = backend.inspect().positions().unwrap().into_iter();
        positions.map(|p| p.map(f32::to_bits)).collect::<Vec<_>>()
    });
    assert!(found == expected);
}

#[test]
fn no_threads_are_refused() {
    assert!(CpuBackend::new(Some(0)).is_err());
}

#[test]
fn misuse_panics_and_says_what_comes_first() {
    type Misuse = fn(&mut CpuBackend);
    let nothing = |backend: &mut CpuBackend| {
        trace(backend, Rays::List(&[]), QueryKind::Closest);
    };
    let table: [(&str, Misuse, bool); 5] = [
        (
            "the tree is stale",
            |b| b.adopt(&senseless_tree(&moving()), Generation(2)).unwrap(),
            true,
        ),
        (
            "the tree is stale",
            |b| b.interpolate(moving().pose(1.0)).unwrap(),
            true,
        ),
        ("the tree is stale", |b| b.preprocess().unwrap(), true),
        (
            "generations rise",
            |b| drop(b.adopt(&senseless_tree(&moving()), Generation(1))),
            false,
        ),
        ("never given", |b| drop(b.wait(Ticket(77))), false),
    ];
    for (why, misuse, traced) in table {
        let mut backend = still(&moving(), Intersector::Watertight);
        let panic = catch_unwind(AssertUnwindSafe(|| {
            misuse(&mut backend);
            if traced {
                nothing(&mut backend);
            }
        }));
        let said = panic.expect_err(why);
        let text = said.downcast_ref::<String>().map(String::as_str);
        let text = text
            .or(said.downcast_ref::<&str>().copied())
            .unwrap_or_default();
        assert!(text.contains(why), "{text}");
    }
}
