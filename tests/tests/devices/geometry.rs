//! Trees as deep as they may be, stages run twice, costs: beside the reference.

use crate::Subject;
use crate::scenes::{
    SHADOWED, apart, camera, go, hits, laid, open, open_laid, rays, report, see, stand, swarm,
    tree_at, tree_of,
};
use backend::{Backend, Generation, Layout, Method, QueryKind, Rays};
use bvh_layout::Topology;
use cpu_ref::CpuBackend;
use geom::{Animation, Hit, Ray};
use std::sync::Arc;

/// As many leaves as a chain may have: a record has 65 levels at most.
const LEAVES: u32 = 65;

/// Big triangles one behind the other, the last farthest from the eye at `z = 99`.
fn stack() -> Arc<Animation> {
    let corners = |t: u32| {
        let z = -(t as f32);
        [[-9.0, -9.0, z], [9.0, -9.0, z], [0.0, 9.0, z]]
    };
    apart(vec![(0..LEAVES).flat_map(corners).collect()])
}

/// Each inner node has one leaf, to the left, and the next inner node; leaves in the given order.
fn chain(order: impl Iterator<Item = u32>) -> Topology {
    let order: Vec<_> = order.collect();
    tree_of(LEAVES, &order, |_, first, _| first + 1)
}

pub(crate) fn the_deepest_tree_is_refitted_and_traced_from_either_end(backend: &mut dyn Subject) {
    let animation = stack();
    let rays: Vec<_> = (0..200)
        .map(|i| {
            let x = 0.04 * (i as f32 - 100.0);
            let z = if i % 2 == 0 { 99.0 } else { -99.0 };
            Ray::new([x, x - 1.0, z], [0.001 * x, 0.0, -z])
        })
        .collect();
    let mut reference = CpuBackend::new(Some(1)).unwrap();
    let trees = [chain(0..LEAVES), chain((0..LEAVES).rev())];
    let pairs = Layout::ALL.map(|layout| [(layout, &trees[0]), (layout, &trees[1])]);
    for (layout, tree) in pairs.into_iter().flatten() {
        let mut answers = Vec::new();
        let both = [
            (backend as &mut dyn Backend, layout),
            (&mut reference, Layout::Bvh2),
        ];
        for (backend, layout) in both {
            backend.load(Arc::clone(&animation), laid(layout)).unwrap();
            backend.adopt(tree, Generation(1)).unwrap();
            stand(backend, &animation, 0.0);
            let closest = see(backend, Rays::List(&rays), SHADOWED);
            let any = see(backend, Rays::List(&rays), QueryKind::Any);
            answers.push((closest, any, backend.inspect().boxes().unwrap()));
        }
        assert!(answers[0] == answers[1], "{layout}");
        let met = answers[0].1.blocked.iter().filter(|&&b| b == 1).count();
        assert!(met > 100, "{met}");
    }
}

pub(crate) fn a_submission_may_hold_any_number_of_stages(backend: &mut dyn Subject) {
    let animation = stack();
    let method = Method::default();
    backend.load(Arc::clone(&animation), method).unwrap();
    backend.adopt(&chain(0..LEAVES), Generation(1)).unwrap();
    for _ in 0..9 {
        stand(backend, &animation, 0.0);
    }
    let camera = camera();
    let ticket = go(backend, Rays::Camera(&camera), QueryKind::Closest);
    let times = backend.wait(ticket).unwrap().times;
    assert!(times.refit_ms.unwrap() < times.device_ms);
    assert!(hits(backend, ticket).closest.iter().any(|h| h.is_hit()));
}

pub(crate) fn triangles_are_counted_at_the_last_positions_alone(backend: &mut dyn Subject) {
    let animation = swarm(500);
    let mut counts = Vec::new();
    open(backend, &animation);
    for times in [&[0.0, 1.0][..], &[1.0], &[1.0, 0.0], &[0.0]] {
        for &time in times {
            stand(backend, &animation, time);
        }
        let counted = report(backend);
        counts.push((counted.inactive, counted.degenerate));
        // A submission without stages says what the last one with them found.
        let again = report(backend);
        assert_eq!((again.inactive, again.degenerate), counts[counts.len() - 1]);
    }
    assert_eq!((counts[0], counts[2]), (counts[1], counts[3]));
    assert!(counts[0].0 > counts[2].0 && counts[2].0 > 0 && counts[2].1 > 0);
}

/// Costs of the tree at some times, as refit says.
fn costs(
    backend: &mut dyn Backend,
    layout: Layout,
    (animation, tree): &(Arc<Animation>, Topology),
) -> Vec<Option<f64>> {
    backend.load(Arc::clone(animation), laid(layout)).unwrap();
    backend.adopt(tree, Generation(1)).unwrap();
    let cost = |time| {
        stand(backend, animation, time);
        report(backend).sah_cost
    };
    [0.0, 0.4, 1.0, 1.7].map(cost).to_vec()
}

pub(crate) fn the_cost_of_a_tree_is_the_references(backend: &mut dyn Subject) {
    let mut reference = CpuBackend::new(Some(2)).unwrap();
    let deep = (stack(), chain(0..LEAVES));
    // Levels of one group and of many, a lone leaf, a huge one, no leaf, no area.
    let corner = [[1.0, 2.0, 3.0], [2.0, 2.0, 3.5], [1.0, 3.0, 3.0]];
    let lone = [
        corner,
        corner.map(|p| p.map(|x: f32| x * 1e12)),
        [[f32::NAN; 3]; 3],
        [[0.0; 3], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]],
    ];
    let lone = lone.map(|corners| apart(vec![corners.to_vec()]));
    let scenes = [1, 3, 130, 20_000].map(swarm).into_iter().chain(lone);
    let scenes = scenes.map(|animation| {
        let tree = tree_at(&animation, 0.0);
        (animation, tree)
    });
    for scene in scenes.chain([deep]) {
        let expected = costs(&mut reference, Layout::Bvh2, &scene);
        for layout in Layout::ALL {
            let found = costs(backend, layout, &scene);
            assert_eq!(found, costs(backend, layout, &scene), "once more");
            for (found, expected) in found.iter().zip(&expected) {
                assert_eq!(found.is_some(), expected.is_some(), "{layout}");
                let (found, expected) = (found.unwrap_or(1.0), expected.unwrap_or(1.0));
                let error = (found - expected).abs() / expected;
                assert!(error < 1e-4, "{layout}: {found} {expected}");
            }
        }
    }
    // It stands until the next refit, and of a scene just loaded there is none.
    let animation = swarm(300);
    open(backend, &animation);
    assert_eq!(report(backend).sah_cost, None);
    stand(backend, &animation, 0.0);
    let first = report(backend).sah_cost;
    assert!(first.is_some() && report(backend).sah_cost == first);
}

/// The swarm as it stands at first, but for a few of its triangles, which stand close together.
fn resting() -> Arc<Animation> {
    let swarm = swarm(200_000);
    let mut keys = vec![swarm.keys()[0].clone(); 3];
    for (k, key) in keys.iter_mut().enumerate() {
        for (v, p) in key.iter_mut().take(90).enumerate() {
            *p = [
                0.3 + 0.01 * (v % 3) as f32,
                0.01 * (k * v) as f32,
                0.01 * (v % 7) as f32,
            ];
        }
    }
    let triangles = swarm.triangles().to_vec();
    Arc::new(Animation::new(keys, triangles).unwrap())
}

pub(crate) fn treelets_that_stand_still_are_passed_over_to_the_last_bit(backend: &mut dyn Subject) {
    let animation = resting();
    let plain = tree_at(&animation, 0.0);
    let listed = plain.clone().with_moving(animation.static_parts());
    let treelets = listed.to_treelets(animation.static_parts());
    let moving = treelets.moving().unwrap().words.len();
    assert!(
        moving > 1 && moving < treelets.treelet_count() / 4,
        "{moving}"
    );
    let mut seen = Vec::new();
    // In one submission, `preprocess` may make all boxes; after it, `refit` has to.
    for (tree, apart) in [
        (&plain, false),
        (&listed, false),
        (&plain, true),
        (&listed, true),
    ] {
        let method = laid(Layout::Fast);
        backend.load(Arc::clone(&animation), method).unwrap();
        backend.adopt(tree, Generation(1)).unwrap();
        for time in [0.0, 0.7, 2.0, 1.0] {
            backend.interpolate(animation.pose(time)).unwrap();
            backend.preprocess().unwrap();
            if apart {
                backend.submit().unwrap();
            }
            backend.refit().unwrap();
            let ticket = go(backend, Rays::Camera(&camera()), SHADOWED);
            let report = backend.wait(ticket).unwrap();
            let cost = report.sah_cost.unwrap().to_bits();
            // Counts are of the submission that preprocessed.
            let counts = (!apart).then_some([report.inactive, report.degenerate]);
            let boxes = backend.inspect().boxes().unwrap();
            seen.push((counts, cost, hits(backend, ticket), boxes));
        }
    }
    assert!(seen[..4] == seen[4..8] && seen[8..12] == seen[12..]);
    assert!(seen[0].0.unwrap()[1] > 100 && seen[0].1 != seen[1].1);
    for (together, apart) in seen.iter().zip(&seen[8..]) {
        assert!((together.1, &together.2, &together.3) == (apart.1, &apart.2, &apart.3));
    }
}

/// Three levels of treelets, and trees so different that nodes need more room.
pub(crate) fn layouts_differ_in_memory_alone(backend: &mut dyn Subject) {
    let (animation, camera) = (swarm(60_000), camera());
    let trees = [0.0, 2.0].map(|time| tree_at(&animation, time));
    let mut seen = Vec::new();
    for layout in Layout::ALL {
        open_laid(backend, &animation, layout);
        for (tree, generation) in trees.iter().zip(2..) {
            backend.adopt(tree, Generation(generation)).unwrap();
            stand(backend, &animation, 0.3);
            // Without shadows, for which some drivers' pictures need room of their own.
            let ticket = go(backend, Rays::Camera(&camera), QueryKind::Closest);
            let boxes = backend.inspect().boxes().unwrap();
            let bytes = backend.device_bytes().unwrap().total();
            seen.push((hits(backend, ticket), boxes, bytes));
        }
    }
    for (usual, fast) in seen[..2].iter().zip(&seen[2..]) {
        assert!(usual.0 == fast.0 && usual.1 == fast.1);
        assert!(usual.2 > fast.2, "{} {}", usual.2, fast.2);
    }
}

pub(crate) fn a_cameras_rays_meet_anything_as_the_list_of_them_does(backend: &mut dyn Subject) {
    let (animation, camera) = (swarm(600), camera());
    open(backend, &animation);
    stand(backend, &animation, 0.3);
    let any = |backend: &mut dyn Subject, rays| {
        let ticket = go(backend, rays, QueryKind::Any);
        let hits = hits(backend, ticket);
        assert!(hits.closest.is_empty());
        (hits.blocked, backend.wait(ticket).unwrap().hits)
    };
    let list: Vec<_> = camera.rays().collect();
    let found = any(backend, Rays::Camera(&camera));
    assert_eq!(found, any(backend, Rays::List(&list)));
    let met = found.0.iter().filter(|&&b| b == 1).count();
    assert_eq!((met as u64, found.0.len()), (found.1, camera.pixels()));
    assert!(met > 100);
}

pub(crate) fn a_flat_triangle_is_counted_at_a_key_frame_though_it_vanishes_after_it(
    backend: &mut dyn Subject,
) {
    let sound = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let flat = [[0.0, 0.0, 2.0], [1.0, 1.0, 2.0], [3.0, 3.0, 2.0]];
    let nan = f32::NAN;
    let gone = [[nan, 5.0, 1.0], [7.0, nan, 2.0], [1.0, 3.0, nan]];
    let keys = [flat, gone].map(|other| [sound, other].concat());
    let animation = Animation::new(keys.to_vec(), vec![[0, 1, 2], [3, 4, 5]]);
    let animation = Arc::new(animation.unwrap());
    for layout in Layout::ALL {
        open_laid(backend, &animation, layout);
        let counts = [0.0, 0.5].map(|time| {
            stand(backend, &animation, time);
            let report = report(backend);
            (report.inactive, report.degenerate)
        });
        assert_eq!(counts, [(0, 1), (1, 0)], "{layout}");
    }
}

/// So large that `preprocess` of layout `fast` waits for positions.
pub(crate) fn large_trees_have_the_same_boxes_in_either_layout(backend: &mut dyn Subject) {
    let animation = swarm(600_000);
    let tree = tree_at(&animation, 0.4);
    let [usual, fast] = Layout::ALL.map(|layout| {
        backend.load(Arc::clone(&animation), laid(layout)).unwrap();
        backend.adopt(&tree, Generation(1)).unwrap();
        let frames = [1.6, 0.7].map(|time| {
            stand(backend, &animation, time);
            let report = report(backend);
            assert!(report.times.interpolate_ms.is_some(), "{layout}");
            report
        });
        let boxes = backend.inspect().boxes().unwrap();
        let counts = frames.each_ref().map(|r| (r.inactive, r.degenerate));
        (counts, boxes, frames.map(|r| r.sah_cost.unwrap()))
    });
    assert!((&usual.0, &usual.1) == (&fast.0, &fast.1));
    for (usual, fast) in usual.2.iter().zip(fast.2) {
        assert!((usual - fast).abs() < 1e-4 * usual, "{usual} {fast}");
    }
}

pub(crate) fn an_empty_tree_is_missed_by_all(backend: &mut dyn Subject) {
    let animation = apart(vec![vec![[f32::NAN; 3]; 3]]);
    let (camera, list) = (camera(), rays(9));
    open(backend, &animation);
    for (rays, kind) in [
        (Rays::Camera(&camera), SHADOWED),
        (Rays::List(&list), QueryKind::Closest),
        (Rays::List(&list), QueryKind::Any),
        (Rays::List(&[]), SHADOWED),
    ] {
        stand(backend, &animation, 0.0);
        let ticket = go(backend, rays, kind);
        let hits = hits(backend, ticket);
        assert!(hits.closest.iter().all(|h| *h == Hit::MISS));
        assert!(hits.blocked.iter().all(|&b| b == 0));
        let told = hits.closest.len() + hits.blocked.len();
        assert_eq!(told > 0, rays.count() > 0);
        assert_eq!(backend.wait(ticket).unwrap().inactive, 1);
    }
}
