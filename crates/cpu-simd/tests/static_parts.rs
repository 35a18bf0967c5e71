//! Tests that skipping static parts changes no result.

use backend::{Backend, Generation, Intersector, QueryKind, Rays};
use bvh_layout::Topology;
use conformance::stage::{interpolate_and_refit, trace_and_wait, tree_at};
use cpu_ref::CpuBackend;
use geom::{Animation, Hit, Point, Ray};
use std::sync::Arc;

/// Returns three key frames of `all` separate triangles. The first `moving` triangles move, close together, so that
/// whole blocks and nodes of the tree are static.
fn key_frames(moving: usize, all: usize) -> Vec<Vec<Point>> {
    let mut state = 5_u32;
    let mut point = || -> Point {
        std::array::from_fn(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            1.0 + (state >> 8) as f32 / 169_467.0
        })
    };
    let mut keys = vec![Vec::new(); 3];
    for triangle in 0..all {
        let (corner, shift) = (point(), point());
        let [size, speed] = if triangle < moving {
            [0.05, 1.0]
        } else {
            [1.0, 0.0]
        };
        for (k, key) in keys.iter_mut().enumerate() {
            let at = |e: Point| {
                std::array::from_fn(|i| size * corner[i] + speed * k as f32 * shift[i] + e[i])
            };
            key.extend([[0.0; 3], [0.5, 0.0, 0.2], [0.0, 0.5, 0.1]].map(at));
        }
    }
    keys
}

fn ready(mut backend: CpuBackend, animation: &Arc<Animation>, tree: &Topology) -> CpuBackend {
    let scene = Arc::clone(animation);
    backend.load(scene, Intersector::Watertight).unwrap();
    backend.adopt(tree, Generation(1)).unwrap();
    backend
}

/// Refits and traces at a time. Returns the hits and the tree's cost.
fn frame(
    backend: &mut CpuBackend,
    animation: &Animation,
    time: f64,
    rays: &[Ray],
) -> (Vec<Hit>, f64) {
    interpolate_and_refit(backend, animation, time).unwrap();
    let ticket = backend.submit().unwrap();
    let cost = backend.wait(ticket).unwrap().sah_cost.unwrap();
    let answers = trace_and_wait(backend, Rays::List(rays), QueryKind::Closest).unwrap();
    (answers.hits.closest, cost)
}

#[test]
fn skipping_static_parts_preserves_results() {
    // The first fit of a tree also sums the areas of its static parts. Their sum must not lose digits if moving parts are
    // far larger at that time, as in the last scene.
    let mut distant = key_frames(6_000, 60_000);
    distant[2][0] = [1e10, 1e10, 0.0];
    for keys in [key_frames(0, 3_000), key_frames(6_000, 60_000), distant] {
        let triangles = (0..keys[0].len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
        let animation = Arc::new(Animation::new(keys, triangles.collect()).unwrap());
        let tree = tree_at(&animation, 0.0);
        let open = |threads| cpu_simd::open(Some(threads)).unwrap();
        let mut reference = ready(CpuBackend::new(Some(2)).unwrap(), &animation, &tree);
        let mut subjects = [1, 3].map(|threads| ready(open(threads), &animation, &tree));
        let to = |v: &Point| Ray::new([0.0; 3], *v);
        let rays: Vec<Ray> = animation.first().iter().step_by(100).map(to).collect();
        for time in [2.0, 0.4, 1.0, 0.0] {
            let (hits, cost) = frame(&mut reference, &animation, time, &rays);
            let found = subjects
                .each_mut()
                .map(|b| frame(b, &animation, time, &rays));
            for (found_hits, found_cost) in &found {
                assert!(*found_hits == hits, "{time}");
                assert!(
                    (found_cost / cost - 1.0).abs() < 1e-5,
                    "{found_cost} {cost}"
                );
            }
            assert_eq!(found[0].1.to_bits(), found[1].1.to_bits(), "{time}");
        }
        assert!(
            animation
                .static_parts()
                .triangles
                .iter()
                .any(|&is_static| is_static)
        );
    }
}
