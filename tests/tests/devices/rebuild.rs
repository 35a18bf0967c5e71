//! Tests trees built on the device: validity, sorting, depth and cost.

use crate::Subject;
use crate::geometry::refitted;
use crate::scenes::{interpolate_and_refit, numbers, report, swarm, tree_at};
use backend::{Generation, Intersector, check_tree};
use bvh_layout::Topology;
use geom::{Animation, Point};
use integration::stage::{host, separate_triangles};
use shaders::{BufferName, Shape};
use std::sync::Arc;

/// Creates small triangles at these points.
fn at_points(points: impl Iterator<Item = Point>, size: f32) -> Arc<Animation> {
    let corners = |p: Point| [p, [p[0] + size, p[1], p[2]], [p[0], p[1] + size, p[2]]];
    separate_triangles(vec![points.flat_map(corners).collect()])
}

/// Makes a tree of the scene at `time` on the device, and checks that it is a valid topology. Returns it with its cost.
fn made(backend: &mut dyn Subject, animation: &Arc<Animation>, time: f64) -> (Topology, f64) {
    let scene = Arc::clone(animation);
    backend.load(scene, Intersector::Watertight).unwrap();
    backend.interpolate(animation.pose(time)).unwrap();
    backend.rebuild(Generation(1)).unwrap();
    let cost = report(backend).sah_cost;
    let tree = backend.rebuilt().unwrap();
    check_tree(&tree, animation).unwrap();
    (tree, cost.unwrap_or(0.0))
}

/// Checks that boxes and costs equal those of a refit of the same tree.
pub(crate) fn trees_of_any_size_are_valid(backend: &mut dyn Subject) {
    let mut reference = host();
    let sizes = [0, 1, 2, 3, 128, 129, 511, 512, 513, 769, 2048, 2049, 9000];
    for (triangles, time) in sizes.into_iter().zip([1.3, 0.0].into_iter().cycle()) {
        let animation = swarm(triangles);
        let (tree, cost) = made(backend, &animation, time);
        let boxes = backend.boxes().unwrap();
        let (right, right_boxes) = refitted(&mut reference, &animation, &tree, time);
        let expected = right.sah_cost.unwrap_or(0.0);
        let error = (cost - expected).abs();
        assert!(error <= 1e-4 * expected, "{cost} {expected}");
        assert!(boxes == right_boxes);
    }
}

/// Tests pairs of triangles that are far from one another.
pub(crate) fn adjacent_pairs_share_a_leaf(backend: &mut dyn Subject) {
    let at = |i: u32| [(i / 2) as f32 * 10.0 + 0.1 * (i % 2) as f32, 0.0, 0.0];
    let scene = at_points((0..600).map(at), 1.0);
    made(backend, &scene, 0.0);
    let rows = Shape::built_on_device(600).node_rows as usize;
    let words = backend.words(BufferName::Nodes, 4 * rows);
    // See geometry/node.wgsl.
    let is_there = |leaf: u32| words.contains(&(3 << 30 | leaf));
    assert!((0..600).step_by(2).all(is_there));
}

/// Tests nested triangles: a search round (docs/design/device-trees.md) merges only the innermost two clusters.
pub(crate) fn nested_triangles_respect_maximum_depth(backend: &mut dyn Subject) {
    for count in [300, 3000] {
        let corners = |i: u32| {
            let s = 1.1_f32.powi(i as i32 % 300);
            [[-s, -s, 0.0], [s, -s, 0.0], [0.0, s, 0.0]]
        };
        let key: Vec<Point> = (0..count).flat_map(corners).collect();
        let (tree, _) = made(backend, &separate_triangles(vec![key]), 0.0);
        let depth = tree.binary().depth(0);
        assert!((39..=64).contains(&depth), "{count}: {depth}");
    }
}

pub(crate) fn builds_trees_of_extreme_coordinates(backend: &mut dyn Subject) {
    let far = |i: u32| [i as f32 * 1e34, -1e38, 1e37];
    let line = |i: u32| [0.0, 0.0, i as f32];
    let near = |i: u32| [1e-30 * i as f32, 0.0, 0.0];
    let equal = |_| [1.0, 2.0, 3.0];
    let scenes: [(&dyn Fn(u32) -> Point, f32); 4] =
        [(&far, 1e30), (&line, 0.5), (&near, 1e-32), (&equal, 1.0)];
    let depths = scenes.map(|(point, size)| {
        let animation = at_points((0..4096).map(point), size);
        made(backend, &animation, 0.0).0.binary().depth(0)
    });
    // The lowest possible tree has depth 12. In every second phase, the groups of 512 clusters begin 256 clusters
    // earlier (docs/design/device-trees.md), which adds at most one level.
    assert!(depths[3] <= 13, "{depths:?}");
}

/// Checks that the pass of each digit is stable. Equal keys keep the order of the triangles.
pub(crate) fn radix_sort_is_stable(backend: &mut dyn Subject) {
    let mut number = numbers(3);
    let mut points: Vec<Point> = (0..5000).map(|_| [number(), number(), number()]).collect();
    points.extend_from_within(..1000);
    let count = points.len();
    let animation = at_points(points.into_iter(), 1e-3);
    made(backend, &animation, 0.0);
    let keys = backend.words(BufferName::Keys, count);
    let triangles = backend.words(BufferName::Sorted, count);
    let both: Vec<_> = keys.iter().zip(&triangles).collect();
    assert!(both.is_sorted());
    let equal = both.windows(2).filter(|w| w[0].0 == w[1].0).count();
    assert!((1000..2000).contains(&equal), "{equal}");
}

/// Compares the cost with that of the host's tree over the same vertices.
pub(crate) fn device_tree_cost_is_near_host(backend: &mut dyn Subject) {
    let animation = swarm(20_000);
    let (_, cost) = made(backend, &animation, 0.3);
    let tree = tree_at(&animation, 0.3);
    backend.adopt(&tree, Generation(2)).unwrap();
    interpolate_and_refit(backend, &animation, 0.3);
    let host = report(backend).sah_cost.unwrap();
    assert!(cost < 1.15 * host, "{cost} {host}");
}
