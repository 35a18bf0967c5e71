//! Tests of the reference backend itself, which cannot be compared with another backend, and of panics on misuse.
//!
//! `tests/tests/hits` compares hits with exact answers.

use backend::{Backend, Generation, Hits, Inspect, Intersector, Query, QueryKind, Rays, Ticket};
use bvh_layout::Topology;
use conformance::stage::{interpolate_and_refit, trace_and_wait, tree_at, triangles};
use conformance::{Case, nth_case, uneven_tree};
use cpu_ref::CpuBackend;
use geom::{Aabb, Animation, KeyFrameError, Ray};
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Returns a case whose triangles are inactive or degenerate in some key frames.
fn broken() -> Case {
    let case = nth_case(1, 7);
    assert!(case.about.contains("broken"), "{}", case.about);
    case
}

/// Returns a tree that ignores the positions of triangles, with a leaf at each of the upper depths.
fn senseless_tree(animation: &Animation) -> Topology {
    let all = 0..animation.triangle_count() as u32;
    let leaves: Vec<u32> = all.rev().filter(|&t| animation.is_live(t)).collect();
    uneven_tree(animation.triangle_count(), &leaves, 20)
}

/// Returns a backend that has interpolated, preprocessed and refitted.
fn ready(
    animation: &Arc<Animation>,
    intersector: Intersector,
    tree: &Topology,
    time: f64,
    threads: usize,
) -> CpuBackend {
    let mut backend = CpuBackend::new(Some(threads)).unwrap();
    let scene = Arc::clone(animation);
    backend.load(scene, intersector).unwrap();
    backend.adopt(tree, Generation(1)).unwrap();
    interpolate_and_refit(&mut backend, animation, time).unwrap();
    backend.submit().unwrap();
    backend
}

fn closest(backend: &mut CpuBackend, rays: &[Ray]) -> Hits {
    trace_and_wait(backend, Rays::List(rays), QueryKind::Closest)
        .unwrap()
        .hits
}

/// Computes the box of each node from its own triangles, in breadth-first order.
fn boxes_from_scratch(animation: &Animation, tree: &Topology, time: f64) -> Vec<Aabb> {
    let (all, tree) = (triangles(animation, time), tree.binary());
    let bounds = |&triangle: &u32| {
        let corners = &all[triangle as usize];
        let can_be_hit = geom::is_active(corners) && !geom::is_degenerate(corners);
        can_be_hit.then(|| Aabb::of_triangle(corners))
    };
    let mut queue = VecDeque::from_iter(tree.root());
    let mut boxes = Vec::new();
    while let Some(node) = queue.pop_front() {
        let triangles = &tree.order()[node.first_leaf as usize..][..node.leaves as usize];
        let own = triangles.iter().filter_map(bounds);
        boxes.push(own.fold(Aabb::EMPTY, Aabb::union));
        if node.leaves > 1 {
            queue.extend(tree.children(node));
        }
    }
    boxes
}

fn boxes_and_cost(backend: &mut CpuBackend, animation: &Animation, time: f64) -> (Vec<Aabb>, f64) {
    interpolate_and_refit(backend, animation, time).unwrap();
    let ticket = backend.submit().unwrap();
    let cost = backend.wait(ticket).unwrap().sah_cost.unwrap();
    (backend.boxes().unwrap(), cost)
}

#[test]
fn refit_matches_boxes_from_scratch() {
    let animation = broken().animation;
    assert_eq!(animation.scale_exponent(), 0);
    for tree in [tree_at(&animation, 0.0), senseless_tree(&animation)] {
        let mut backend = ready(&animation, Intersector::Watertight, &tree, 0.0, 2);
        for time in [0.0, 0.4, 1.0, 1.7, 2.0] {
            let (found, cost) = boxes_and_cost(&mut backend, &animation, time);
            let expected = boxes_from_scratch(&animation, &tree, time);
            assert_eq!(found, expected, "{time}");
            let areas: f64 = expected.iter().map(Aabb::half_area).sum();
            let ratio = cost / (areas / expected[0].half_area());
            assert!((ratio - 1.0).abs() < 1e-12, "{ratio}");
        }
    }
}

#[test]
fn commands_run_in_recorded_order() {
    let Case {
        animation, rays, ..
    } = broken();
    let (early, late) = (0.0, 1.7);
    let tree = tree_at(&animation, early);
    let fresh = |time| ready(&animation, Intersector::Exact, &tree, time, 1);
    let expected = closest(&mut fresh(early), &rays);
    let mut backend = fresh(late);
    interpolate_and_refit(&mut backend, &animation, early).unwrap();
    let query = Query {
        rays: Rays::List(&rays),
        kind: QueryKind::Closest,
    };
    backend.trace(&[query]).unwrap();
    backend.interpolate(animation.pose(late)).unwrap();
    let ticket = backend.submit().unwrap();
    let report = backend.wait(ticket).unwrap();
    let mut hits = Hits::default();
    backend.take_hits(ticket, 0, &mut hits).unwrap();
    assert_eq!(hits, expected);
    assert!(report.exact_rays > 0, "some rays meet vertices");
    let times = report.times;
    let stages = [times.interpolate_ms, times.preprocess_ms, times.refit_ms];
    let stages = stages.into_iter().chain([times.trace_primary_ms]);
    let sum: f64 = stages.map(|ms| ms.expect("each was timed")).sum();
    assert!(sum <= times.device_ms);
    let [found, expected] = [backend, fresh(late)].map(|mut backend| {
        let positions = backend.positions().unwrap().into_iter();
        positions.map(|p| p.map(f32::to_bits)).collect::<Vec<_>>()
    });
    assert!(found == expected);
}

#[test]
fn zero_threads_are_refused() {
    assert!(CpuBackend::new(Some(0)).is_err());
}

#[test]
fn misuse_panics_with_a_reason() {
    type Misuse = fn(&mut CpuBackend);
    let stale = "the tree is stale";
    let table: [(&str, Misuse); 7] = [
        (stale, |b| {
            b.adopt(&senseless_tree(&broken().animation), Generation(2))
                .unwrap();
        }),
        (stale, |b| {
            b.interpolate(broken().animation.pose(1.0)).unwrap()
        }),
        (stale, |b| b.preprocess().unwrap()),
        ("is not greater than the current generation", |b| {
            drop(b.adopt(&senseless_tree(&broken().animation), Generation(1)));
        }),
        ("is not greater than the current generation", |b| {
            drop(b.evaluate(&senseless_tree(&broken().animation), Generation(0)));
        }),
        // The first tree has no predecessor, but its generation must be above 0 too.
        ("is not greater than the current generation 0", |b| {
            let animation = broken().animation;
            (b.load(Arc::clone(&animation), Intersector::Watertight)).unwrap();
            drop(b.adopt(&senseless_tree(&animation), Generation(0)));
        }),
        ("was not issued", |b| drop(b.wait(Ticket(77)))),
    ];
    for (why, misuse) in table {
        let (animation, by) = (broken().animation, Intersector::Watertight);
        let mut backend = ready(&animation, by, &tree_at(&animation, 0.0), 0.0, 1);
        let panic = catch_unwind(AssertUnwindSafe(|| {
            misuse(&mut backend);
            assert!(why == stale, "it should have panicked before");
            closest(&mut backend, &[]);
        }));
        let said = panic.expect_err(why);
        let text = said.downcast_ref::<String>().map(String::as_str);
        let text = text.or(said.downcast_ref::<&str>().copied());
        assert!(text.is_some_and(|t| t.contains(why)), "{text:?}");
    }
}

#[test]
fn failed_submission_leaves_no_positions() {
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let keys = [0.0, 1.0, 2.0].map(|height| corners.map(|[x, y, _]| [x, y, height]));
    let is_readable = Arc::new(AtomicBool::new(true));
    let allowed = Arc::clone(&is_readable);
    let source = move |key: usize| match key {
        2 if !allowed.load(Relaxed) => Err(KeyFrameError("unreadable".to_owned())),
        key => Ok(keys[key % 3].to_vec()),
    };
    let animation = Animation::paged(Arc::new(source), 12, 4, vec![[0, 1, 2]]).unwrap();
    is_readable.store(false, Relaxed);
    let animation = Arc::new(animation);
    let mut backend = CpuBackend::new(Some(1)).unwrap();
    (backend.load(Arc::clone(&animation), Intersector::Watertight)).unwrap();
    let record = |backend: &mut CpuBackend, time| {
        backend.interpolate(animation.pose(time)).unwrap();
        backend.request_positions().unwrap();
    };
    record(&mut backend, 0.0);
    record(&mut backend, 2.0);
    assert!(backend.submit().is_err());
    record(&mut backend, 1.0);
    let ticket = backend.submit().unwrap();
    let (found, positions) = backend.take_positions().unwrap().unwrap();
    assert_eq!(found, ticket);
    assert_eq!(positions[..], keys[1]);
    assert!(backend.take_positions().unwrap().is_none());
}
