//! Tests large trees, repeated stages, static geometry, and costs.

use crate::Subject;
use crate::scenes::{
    SHADOWED, camera, hits, interpolate_and_refit, open, report, submit_trace, swarm, tree_at,
};
use backend::{FrameReport, Generation, Inspect, Intersector, QueryKind, Rays};
use bvh_layout::Topology;
use geom::{Aabb, Animation};
use integration::share;
use integration::stage::host;
use std::sync::Arc;

pub(crate) fn submission_accepts_many_stages(backend: &mut dyn Subject) {
    let (animation, camera) = (swarm(1000), camera());
    open(backend, &animation);
    for i in 0..9 {
        interpolate_and_refit(backend, &animation, 0.1 * f64::from(i));
    }
    let ticket = submit_trace(backend, Rays::Camera(&camera), QueryKind::Closest);
    let times = backend.wait(ticket).unwrap().times;
    assert!(times.refit_ms.unwrap() < times.device_ms);
    assert!(hits(backend, ticket).closest.iter().any(|h| h.is_hit()));
}

/// Also tests counts, which last until the next preprocess. A scene that was just loaded has no cost. Both key frames
/// are equal, so the last refit has no treelet to process.
pub(crate) fn cost_persists_until_next_refit(backend: &mut dyn Subject) {
    let moving = swarm(1000);
    let key = moving.first().to_vec();
    let animation = Animation::new(vec![key.clone(), key], moving.triangles().to_vec());
    let animation = Arc::new(animation.unwrap());
    open(backend, &animation);
    assert_eq!(report(backend).sah_cost, None);
    interpolate_and_refit(backend, &animation, 0.0);
    let told = |r: &FrameReport| (r.sah_cost, r.inactive, r.degenerate);
    let first = report(backend);
    assert!(first.sah_cost.is_some() && told(&report(backend)) == told(&first));
    interpolate_and_refit(backend, &animation, 0.5);
    assert_eq!(report(backend).sah_cost, first.sah_cost);
}

/// The swarm without motion, except for a few of its triangles, which are close together.
fn resting() -> Arc<Animation> {
    let swarm = swarm(share(200_000) as u32);
    let mut keys = vec![swarm.first().to_vec(); 3];
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

pub(crate) fn skipping_static_treelets_preserves_bits(backend: &mut dyn Subject) {
    let animation = resting();
    let with_moving_list = tree_at(&animation, 0.0);
    let count = with_moving_list.triangle_count();
    let without_list = Topology::new(Arc::clone(with_moving_list.binary()), count);
    let treelets = with_moving_list.treelets().unwrap();
    let moving = treelets.moving.as_ref().unwrap().words.len();
    assert!(
        moving > 1 && moving < treelets.treelet_count() / 4,
        "{moving}"
    );
    let mut seen = Vec::new();
    // Within one submission, `preprocess` may compute all boxes. In a later one, `refit` has to.
    for (tree, apart) in [
        (&without_list, false),
        (&with_moving_list, false),
        (&without_list, true),
        (&with_moving_list, true),
    ] {
        let intersector = Intersector::Watertight;
        backend.load(Arc::clone(&animation), intersector).unwrap();
        backend.adopt(tree, Generation(1)).unwrap();
        for time in [0.0, 0.7, 2.0, 1.0] {
            backend.interpolate(animation.pose(time)).unwrap();
            backend.preprocess().unwrap();
            if apart {
                backend.submit().unwrap();
            }
            backend.refit().unwrap();
            let ticket = submit_trace(backend, Rays::Camera(&camera()), SHADOWED);
            let report = backend.wait(ticket).unwrap();
            let cost = report.sah_cost.unwrap().to_bits();
            // Counts are compared only if the same submission also preprocessed.
            let counts = (!apart).then_some([report.inactive, report.degenerate]);
            let boxes = backend.boxes().unwrap();
            seen.push((counts, cost, hits(backend, ticket), boxes));
        }
    }
    assert!(seen[..4] == seen[4..8] && seen[8..12] == seen[12..]);
    assert!(seen[0].0.unwrap()[1] > 100 && seen[0].1 != seen[1].1);
    for (together, apart) in seen.iter().zip(&seen[8..]) {
        assert!((together.1, &together.2, &together.3) == (apart.1, &apart.2, &apart.3));
    }
}

/// Returns whether costs are equal except for the rounding of sums in single precision.
fn same_cost(found: &FrameReport, expected: &FrameReport) -> bool {
    let [found, expected] = [found, expected].map(|report| report.sah_cost.unwrap());
    (found / expected - 1.0).abs() < 1e-4
}

/// Tests three levels of treelets, and trees so different that nodes need more memory.
pub(crate) fn trees_of_any_shape_have_the_references_hits_and_boxes(backend: &mut dyn Subject) {
    let (animation, camera) = (swarm(60_000), camera());
    let trees = [0.0, 2.0].map(|time| tree_at(&animation, time));
    let mut reference = host();
    let mut seen = Vec::new();
    for backend in [&mut reference as &mut dyn Inspect, backend] {
        open(backend, &animation);
        // Some triangles are inactive at time 0.3 but not at 0.0, the first key frame.
        for (tree, (generation, time)) in trees.iter().zip([(2, 0.3), (3, 0.0)]) {
            backend.adopt(tree, Generation(generation)).unwrap();
            interpolate_and_refit(backend, &animation, time);
            let ticket = submit_trace(backend, Rays::Camera(&camera), QueryKind::Closest);
            let boxes = backend.boxes().unwrap();
            let report = backend.wait(ticket).unwrap();
            seen.push((hits(backend, ticket), boxes, report));
        }
    }
    for (right, found) in seen[..2].iter().zip(&seen[2..]) {
        assert!(right.0 == found.0 && right.1 == found.1);
        assert!(same_cost(&found.2, &right.2), "{:?} {:?}", right.2, found.2);
    }
}

/// Returns the report and the boxes of a tree that is refitted at `time`.
pub(crate) fn refitted(
    backend: &mut dyn Inspect,
    animation: &Arc<Animation>,
    tree: &Topology,
    time: f64,
) -> (FrameReport, Vec<Aabb>) {
    let intersector = Intersector::Watertight;
    backend.load(Arc::clone(animation), intersector).unwrap();
    backend.adopt(tree, Generation(1)).unwrap();
    interpolate_and_refit(backend, animation, time);
    (report(backend), backend.boxes().unwrap())
}

/// Tests a scene so large that `preprocess` waits for positions.
pub(crate) fn large_trees_match_reference_boxes(backend: &mut dyn Subject) {
    let animation = swarm(540_000);
    let tree = tree_at(&animation, 0.4);
    assert!(tree.binary().leaf_count() > 1 << 19);
    let (right, right_boxes) = refitted(&mut host(), &animation, &tree, 0.7);
    let (seen, boxes) = refitted(backend, &animation, &tree, 0.7);
    let times = seen.times;
    assert!(
        times.interpolate_ms.is_some() || times.preprocess_ms.is_none(),
        "it did not wait"
    );
    let counts = |r: &FrameReport| (r.inactive, r.degenerate);
    assert!(counts(&seen) == counts(&right) && boxes == right_boxes);
    assert!(same_cost(&seen, &right), "{seen:?} {right:?}");
}
