//! The seam's prose contract, sentence by sentence.

use crate::CpuBackend;
use crate::simd::Level;
use crate::testing::{
    bits, kinds, moving, ready, rng, senseless_tree, soup, still, still_of, trace, tree_at,
};
use backend::{Backend, Hits, Intersector, Layout, Query, QueryKind, Rays, Ticket};
use bvh_layout::Topology;
use geom::{Aabb, Animation, Camera, Hit, Point, Ray};
use proptest::prelude::RngExt;

fn camera(animation: &Animation) -> Camera {
    let b = animation.bounds();
    let middle = std::array::from_fn(|i| 0.5 * (b.min[i] + b.max[i]));
    Camera::look_at([1.0, 3.0, 9.0], middle, [0.0, 1.0, 0.0], 50.0, [197, 121]).unwrap()
}

fn deform(backend: &mut CpuBackend, animation: &Animation, time: f64) {
    backend.interpolate(animation.pose(time)).unwrap();
    backend.preprocess().unwrap();
    backend.refit().unwrap();
}

#[test]
fn a_refitted_tree_has_the_boxes_of_one_made_from_scratch() {
    let animation = moving();
    let pose = animation.pose(0.0);
    let trees = [tree_at(&animation, pose), senseless_tree(&animation)];
    for (kind, tree) in kinds().into_iter().zip(trees.iter().cycle()) {
        let method = (Intersector::Watertight, kind);
        check_boxes(&animation, tree, ready(&animation, method, tree, pose, 2));
    }
}

fn check_boxes(animation: &Animation, tree: &Topology, mut backend: CpuBackend) {
    for time in [0.0, 0.4, 1.0, 1.7, 2.0] {
        deform(&mut backend, animation, time);
        let ticket = backend.submit().unwrap();
        let cost = backend.wait(ticket).unwrap().sah_cost.unwrap();
        let found = backend.inspect().boxes().unwrap();
        let positions = backend.inspect().positions().unwrap();
        let mut expected = vec![Aabb::EMPTY; tree.node_count()];
        let mut leaf = tree.leaf_count();
        let mut inner = tree.leaf_count() - 1;
        for node in (0..tree.node_count()).rev() {
            expected[node] = if tree.is_leaf(node as u32) {
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
                expected[2 * inner + 1].union(expected[2 * inner + 2])
            };
        }
        assert_eq!(found, expected, "{time}");
        let areas: f64 = expected.iter().map(Aabb::half_area).sum();
        let ratio = cost / (areas / expected[0].half_area());
        assert!((ratio - 1.0).abs() < 1e-12, "{ratio}");
    }
}

#[test]
fn answers_do_not_depend_on_the_tree_its_age_or_the_threads() {
    let animation = moving();
    let pose = animation.pose(1.3);
    let camera = camera(&animation);
    let light = [3.0, 8.0, 2.0];
    for intersector in [
        Intersector::Watertight,
        Intersector::Exact,
        Intersector::MollerTrumbore,
        Intersector::Woop,
    ] {
        let mut answers = Vec::new();
        let trees = [
            (tree_at(&animation, pose), 1),
            (tree_at(&animation, pose), 2),
            (tree_at(&animation, animation.pose(0.0)), 2),
            (tree_at(&animation, animation.pose(2.0)), 1),
            (senseless_tree(&animation), 2),
        ];
        for ((tree, threads), kind) in trees
            .iter()
            .flat_map(|t| kinds().into_iter().map(move |k| (t, k)))
        {
            let mut backend = ready(&animation, (intersector, kind), tree, pose, *threads);
            let hits = trace(
                &mut backend,
                Rays::Camera(&camera),
                QueryKind::ClosestAndShadow { light },
            );
            let any = trace(&mut backend, Rays::Camera(&camera), QueryKind::Any).blocked;
            answers.push((bits(&hits.closest), hits.blocked, any));
        }
        assert!(answers.iter().all(|a| *a == answers[0]), "{intersector}");
        let count = answers[0].2.iter().filter(|&&b| b == 1).count();
        assert!(count > 300 && answers[0].1.contains(&1), "{count}");
    }
}

#[test]
fn a_camera_is_the_list_of_its_rays() {
    let animation = moving();
    let camera = camera(&animation);
    let rays: Vec<Ray> = camera.rays().collect();
    let query = QueryKind::ClosestAndShadow {
        light: [0.0, 9.0, 0.0],
    };
    for kind in kinds() {
        let mut backend = still_of(&animation, (Intersector::Watertight, kind));
        let one = trace(&mut backend, Rays::Camera(&camera), query);
        let other = trace(&mut backend, Rays::List(&rays), query);
        assert_eq!(one, other, "{kind:?}");
    }
}

#[test]
fn reports_count_what_happened() {
    let animation = moving();
    let mut backend = still(&animation, Intersector::Watertight);
    let camera = camera(&animation);
    let kind = QueryKind::ClosestAndShadow {
        light: [0.0, 9.0, 0.0],
    };
    let mut ended = 0.0;
    // At first one triangle is not there yet and one never is.
    for (time, inactive, degenerate) in [(0.0, 2, 0), (1.0, 1, 1), (2.0, 1, 0), (0.5, 2, 0)] {
        deform(&mut backend, &animation, time);
        backend.request_positions().unwrap();
        backend
            .trace(Query {
                rays: Rays::Camera(&camera),
                kind,
            })
            .unwrap();
        let ticket = backend.submit().unwrap();
        let report = backend.wait(ticket).unwrap();
        assert_eq!(
            (report.inactive, report.degenerate),
            (inactive, degenerate),
            "{time}"
        );
        let mut hits = Hits::default();
        backend.hits(ticket, &mut hits).unwrap();
        let count = hits.closest.iter().filter(|h| h.is_hit()).count() as u64;
        let blocked = hits.blocked.iter().filter(|&&b| b == 1).count() as u64;
        assert_eq!((report.hits, report.blocked), (count, blocked));
        assert_eq!(report.readback_bytes, 12 * animation.vertex_count() as u64);
        let (taken, snapshot) = backend.take_positions().unwrap().unwrap();
        assert_eq!(taken, ticket);
        let pose = animation.pose(time);
        let finite = |p: &Point| p.iter().all(|x| x.is_finite());
        for (v, p) in snapshot.iter().enumerate().filter(|(_, p)| finite(p)) {
            assert_eq!(*p, animation.vertex(pose, v as u32));
        }
        let t = report.times;
        let stages = [
            t.interpolate_ms,
            t.preprocess_ms,
            t.refit_ms,
            t.trace_primary_ms,
        ];
        assert_eq!(t.trace_shadow_ms, None, "rays and shadows are one stage");
        assert!(stages.iter().flatten().sum::<f64>() <= t.device_ms && !stages.contains(&None));
        let begun = t.begun_ms.expect("the CPU has a clock");
        assert!(begun >= ended, "{begun} before {ended}");
        ended = begun + t.device_ms;
    }
    assert!(backend.take_positions().unwrap().is_none());
}

#[test]
fn the_last_two_submissions_with_a_trace_are_kept() {
    let animation = moving();
    let mut backend = still(&animation, Intersector::Watertight);
    let rays = [Ray::new([0.0, 0.0, 9.0], [0.0, 0.0, -1.0]); 3];
    let mut tickets = Vec::new();
    for n in 1..=2 {
        backend
            .trace(Query {
                rays: Rays::List(&rays[..n]),
                kind: QueryKind::Closest,
            })
            .unwrap();
        tickets.push(backend.submit().unwrap());
    }
    assert!(tickets[0] < tickets[1]);
    for _ in 0..3 {
        backend.preprocess().unwrap();
        backend.refit().unwrap();
        tickets.push(backend.submit().unwrap());
    }
    assert_eq!(backend.wait(tickets[4]).unwrap().hits, 0);
    for (n, &ticket) in tickets[..2].iter().enumerate() {
        assert_eq!(backend.wait(ticket).unwrap().hits, n as u64 + 1);
        let mut hits = Hits::default();
        backend.hits(ticket, &mut hits).unwrap();
        assert_eq!(hits.closest.len(), n + 1);
    }
}

#[test]
fn a_tree_of_nothing_is_all_misses() {
    let animation = soup(&[[[f32::NAN; 3]; 3]; 4]);
    for kind in kinds() {
        check_nothing(still_of(&animation, (Intersector::Watertight, kind)));
    }
}

fn check_nothing(mut backend: CpuBackend) {
    let ray = Ray::new([0.0; 3], [1.0, 0.0, 0.0]);
    let hits = trace(
        &mut backend,
        Rays::List(&[ray]),
        QueryKind::ClosestAndShadow { light: [1.0; 3] },
    );
    assert_eq!(hits.closest, [Hit::MISS]);
    assert_eq!(hits.blocked, [0]);
    assert!(backend.inspect().boxes().unwrap().is_empty());
    let ticket = backend.submit().unwrap();
    let report = backend.wait(ticket).unwrap();
    assert_eq!((report.inactive, report.sah_cost), (4, None));
}

#[test]
fn a_lone_triangle_is_a_tree() {
    let animation = soup(&[[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
    let ray = Ray::new([0.25, 0.25, 3.0], [0.0, 0.0, -2.0]);
    let expected = Hit {
        t: 1.5,
        u: 0.25,
        v: 0.25,
        triangle: 0,
    };
    for kind in kinds() {
        let mut backend = still_of(&animation, (Intersector::Watertight, kind));
        let hits = trace(&mut backend, Rays::List(&[ray]), QueryKind::Closest).closest;
        assert_eq!(hits, [expected], "{kind:?}");
    }
}

#[test]
fn a_big_tree_is_refitted_by_many_tasks_alike() {
    let mut rng = rng();
    let mut point = || [0; 3].map(|_: i32| rng.random_range(-9.0..9.0_f32));
    let triangles: Vec<_> = (0..30_000).map(|_| [point(), point(), point()]).collect();
    let animation = soup(&triangles);
    let pose = animation.pose(0.0);
    let tree = senseless_tree(&animation);
    let layouts = [
        (Layout::Bvh2, 1),
        (Layout::Bvh2, 2),
        (Layout::Fast, 1),
        (Layout::Fast, 2),
    ];
    let [a, b, c, d] = layouts.map(|(layout, threads)| {
        let method = (Intersector::Woop, (layout, Level::best()));
        let mut backend = ready(&animation, method, &tree, pose, threads);
        let cost = backend.wait(Ticket(0)).unwrap().sah_cost;
        let rays: Vec<Ray> = triangles
            .iter()
            .step_by(100)
            .map(|t| Ray::new(t[0], t[1]))
            .collect();
        let hits = trace(&mut backend, Rays::List(&rays), QueryKind::Closest).closest;
        (
            backend.inspect().boxes().unwrap(),
            cost.map(f64::to_bits),
            bits(&hits),
        )
    });
    assert!(a == b && c == d);
    assert!((&a.0, &a.2) == (&c.0, &c.2));
    assert_eq!(a.0[0], animation.bounds());
}

#[test]
fn a_list_is_traced_once_in_its_place_and_reported_with_the_rest() {
    let animation = moving();
    let [early, late] = [0.3, 1.7].map(|time| animation.pose(time));
    let eye = [0.3, 0.2, 9.0];
    let through = |v: &[f32; 3]| Ray::new(eye, std::array::from_fn(|i| v[i] - eye[i]));
    let vertices = (0..animation.vertex_count() as u32).map(|v| animation.vertex(early, v));
    let rays: Vec<Ray> = vertices.map(|v| through(&v)).collect();
    let tree = tree_at(&animation, early);
    for kind in kinds() {
        let method = (Intersector::Exact, kind);
        let fresh = |pose| ready(&animation, method, &tree, pose, 1);
        let expected = trace(&mut fresh(early), Rays::List(&rays), QueryKind::Closest);
        let mut backend = fresh(late);
        backend.interpolate(early).unwrap();
        backend.preprocess().unwrap();
        backend.refit().unwrap();
        let (rays, kind) = (Rays::List(&rays), QueryKind::Closest);
        backend.trace(Query { rays, kind }).unwrap();
        backend.interpolate(late).unwrap();
        let ticket = backend.submit().unwrap();
        let report = backend.wait(ticket).unwrap();
        let mut hits = Hits::default();
        backend.hits(ticket, &mut hits).unwrap();
        assert_eq!(hits, expected);
        let found = expected.closest.iter().filter(|hit| hit.is_hit()).count();
        assert_eq!(report.hits, found as u64);
        assert!(report.settled > 0, "rays through vertices are open");
        let times = report.times;
        let stages = [times.interpolate_ms, times.preprocess_ms, times.refit_ms];
        let stages = stages.into_iter().chain([times.trace_primary_ms]);
        let sum: f64 = stages.map(|ms| ms.expect("each was timed")).sum();
        assert!(sum <= times.device_ms);
        let [found, expected] = [backend, fresh(late)].map(|mut backend| {
            let positions = backend.inspect().positions().unwrap();
            positions
                .iter()
                .map(|p| p.map(f32::to_bits))
                .collect::<Vec<_>>()
        });
        assert!(found == expected);
    }
}
