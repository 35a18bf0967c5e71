//! Tests trees made on the device, which must be complete, shallow and good, and trees of the driver.

use crate::scenes::{
    SHADOWED, apart, camera, go, laid, numbers, report, see, stand, swarm, tree_at,
};
use crate::{Subject, watched};
use backend::{Backend, Generation, Layout, Method, QueryKind, Rays, check_tree};
use bvh_layout::Topology;
use conformance::stage;
use cpu_ref::CpuBackend;
use geom::{Animation, Point, Ray};
use gpu_vulkan_rt::{DriverTreeBackend, Prefer};
use shaders::{BufferName, Shape};
use std::sync::Arc;

/// Creates small triangles at these points.
fn at_points(points: impl Iterator<Item = Point>, size: f32) -> Arc<Animation> {
    let corners = |p: Point| [p, [p[0] + size, p[1], p[2]], [p[0], p[1] + size, p[2]]];
    apart(vec![points.flat_map(corners).collect()])
}

/// Makes a tree of the scene at `time` on the device, and checks that it is a valid topology. Returns it with its cost.
fn made(backend: &mut dyn Subject, animation: &Arc<Animation>, time: f64) -> (Topology, f64) {
    made_in(Layout::Bvh2, backend, animation, time)
}

fn made_in(
    layout: Layout,
    backend: &mut dyn Subject,
    animation: &Arc<Animation>,
    time: f64,
) -> (Topology, f64) {
    let scene = Arc::clone(animation);
    backend.load(scene, laid(layout)).unwrap();
    backend.interpolate(animation.pose(time)).unwrap();
    backend.rebuild(Generation(1)).unwrap();
    let cost = report(backend).sah_cost;
    let tree = backend.inspect().rebuilt().unwrap();
    check_tree(&tree, animation).unwrap();
    (tree, cost.unwrap_or(0.0))
}

/// Checks that boxes and costs equal those of a refit of the same tree.
pub(crate) fn trees_of_any_size_are_whole(backend: &mut dyn Subject) {
    let mut reference = CpuBackend::new(Some(2)).unwrap();
    let sizes = [0, 1, 2, 3, 128, 129, 511, 512, 513, 769, 2048, 2049, 9000];
    for (triangles, time) in sizes.into_iter().zip([1.3, 0.0].into_iter().cycle()) {
        let animation = swarm(triangles);
        let (tree, cost) = made(backend, &animation, time);
        let boxes = backend.inspect().boxes().unwrap();
        let (fast, same) = made_in(Layout::Fast, backend, &animation, time);
        assert!(tree == fast && cost.to_bits() == same.to_bits());
        assert!(boxes == backend.inspect().boxes().unwrap());
        let scene = Arc::clone(&animation);
        reference.load(scene, Method::default()).unwrap();
        reference.adopt(&tree, Generation(1)).unwrap();
        stand(&mut reference, &animation, time);
        let expected = report(&mut reference).sah_cost.unwrap_or(0.0);
        let error = (cost - expected).abs();
        assert!(error <= 1e-4 * expected, "{cost} {expected}");
        assert!(boxes == reference.inspect().boxes().unwrap());
    }
}

/// Tests pairs of triangles that are far from one another.
pub(crate) fn two_triangles_in_a_row_share_a_leaf(backend: &mut dyn Subject) {
    let at = |i: u32| [(i / 2) as f32 * 10.0 + 0.1 * (i % 2) as f32, 0.0, 0.0];
    let scene = at_points((0..600).map(at), 1.0);
    made_in(Layout::Fast, backend, &scene, 0.0);
    let rows = Shape::made_on_device(Layout::Fast, 600).node_rows as usize;
    let words = backend.words(BufferName::Nodes, 4 * rows);
    // See layout.wgsl.
    let is_there = |leaf: u32| words.contains(&(3 << 30 | leaf));
    assert!((0..600).step_by(2).all(is_there));
}

/// Tests nested triangles: each round except the last ones merges only the innermost two.
pub(crate) fn no_tree_is_too_deep_for_the_traversal(backend: &mut dyn Subject) {
    for count in [300, 3000] {
        let corners = |i: u32| {
            let s = 1.1_f32.powi(i as i32 % 300);
            [[-s, -s, 0.0], [s, -s, 0.0], [0.0, s, 0.0]]
        };
        let key: Vec<Point> = (0..count).flat_map(corners).collect();
        let (tree, _) = made(backend, &apart(vec![key]), 0.0);
        let levels = tree.level_count();
        assert!((40..=65).contains(&levels), "{count}: {levels}");
    }
}

pub(crate) fn extreme_and_equal_coordinates_make_a_tree(backend: &mut dyn Subject) {
    let far = |i: u32| [i as f32 * 1e34, -1e38, 1e37];
    let line = |i: u32| [0.0, 0.0, i as f32];
    let near = |i: u32| [1e-30 * i as f32, 0.0, 0.0];
    let equal = |_| [1.0, 2.0, 3.0];
    let scenes: [(&dyn Fn(u32) -> Point, f32); 4] =
        [(&far, 1e30), (&line, 0.5), (&near, 1e-32), (&equal, 1.0)];
    let levels = scenes.map(|(point, size)| {
        let animation = at_points((0..4096).map(point), size);
        made(backend, &animation, 0.0).0.level_count()
    });
    // The lowest possible tree has 13 levels. Packets that begin early add one.
    assert!(levels[3] <= 14, "{levels:?}");
}

/// Checks that the pass of each digit is stable. Equal keys keep the order of the triangles.
pub(crate) fn triangles_are_sorted_by_their_keys_and_equal_keys_keep_their_order(
    backend: &mut dyn Subject,
) {
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
pub(crate) fn a_tree_made_here_costs_hardly_more_than_the_hosts(backend: &mut dyn Subject) {
    let animation = swarm(20_000);
    let (_, cost) = made(backend, &animation, 0.3);
    let tree = tree_at(&animation, 0.3);
    backend.adopt(&tree, Generation(2)).unwrap();
    stand(backend, &animation, 0.3);
    let host = report(backend).sah_cost.unwrap();
    assert!(cost < 1.15 * host, "{cost} {host}");
}

fn drivers() -> DriverTreeBackend {
    DriverTreeBackend::new(&watched(), Prefer::FastBuild).unwrap()
}

/// Tests first key frames whose box is empty or much too small. The box determines the offset of shadow rays.
pub(crate) fn triangles_beyond_the_first_key_frame_shadow_others_and_not_themselves() {
    let (floor, roof) = (
        [[-5.0, 3.0, 40.0], [1.0, 0.0, 0.1], [-1.0, 0.1, 0.0]],
        [[0.0, 2.0, -50.0], [0.0, 2.0, 50.0], [-80.0, 2.0, 0.0]],
    );
    let frame = [floor, roof].concat();
    // Rays to the floor near the edge that is far from its first corner. The roof covers one half.
    let across = (0..64).map(|i| -0.9 + i as f32 / 35.0);
    let rays: Vec<_> = across
        .map(|x| Ray::new([0.0, 1.0, 0.0], [x, -0.95 - 0.05 * x, 0.06 + 0.05 * x]))
        .collect();
    let light = [0.0, 9.0, 0.0];
    let mut subject = drivers();
    for by in [f32::NAN, 1e-4] {
        let first = frame.iter().map(|p| p.map(|x| by * x)).collect();
        let live = Animation::live(first, &[false; 6], vec![[0, 1, 2], [3, 4, 5]]).unwrap();
        let live = Arc::new(live);
        subject.load(Arc::clone(&live), Method::default()).unwrap();
        let time = live.push(frame.clone()).unwrap();
        stage::stand(&mut subject, &live, time).unwrap();
        let kind = QueryKind::ClosestAndShadow { light };
        let found = see(&mut subject, Rays::List(&rays), kind);
        for ((ray, hit), &blocked) in rays.iter().zip(&found.closest).zip(&found.blocked) {
            assert_eq!(hit.triangle, 0, "{by}: {ray:?}");
            assert_eq!(blocked == 1, ray.direction[0] < 0.0, "{by}: {ray:?}");
        }
    }
}

pub(crate) fn the_drivers_work_is_timed_and_trees_of_others_are_refused() {
    let mut subject = drivers();
    let animation = swarm(300);
    let method = Method::default();
    subject.load(Arc::clone(&animation), method).unwrap();
    subject.interpolate(animation.pose(0.0)).unwrap();
    subject.rebuild(Generation(1)).unwrap();
    subject.refit().unwrap();
    let ticket = go(&mut subject, Rays::Camera(&camera()), SHADOWED);
    let times = subject.wait(ticket).unwrap().times;
    let stages = [
        times.interpolate_ms,
        times.preprocess_ms,
        times.refit_ms,
        times.trace_primary_ms,
    ];
    let sum: f64 = stages.iter().map(|t| t.unwrap()).sum();
    assert!((sum - times.device_ms).abs() < 1e-6, "{times:?}");
    assert_eq!(times.trace_shadow_ms, None);
    let refused = subject.adopt(&tree_at(&animation, 0.0), Generation(2));
    let said = refused.unwrap_err().to_string();
    assert_eq!(said, "vulkan-rt does not support trees made by others");
    assert!(subject.makes_own_trees() && subject.inspect().boxes().is_err());
    assert_eq!(subject.inspect().complaints(), [""; 0]);
}
