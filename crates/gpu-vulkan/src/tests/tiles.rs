//! Rays that go down a tree together find what each finds by itself.

use super::scenes::{SHADOWED, device, go, hits, laid, positions, stand, swarm, tree_at};
use backend::{Backend, Generation, Layout, Rays};
use geom::{Animation, Camera, Point, Ray};
use std::sync::Arc;

fn look(eye: Point, target: Point, fov: f32) -> Camera {
    Camera::look_at(eye, target, [0.0, 1.0, 0.0], fov, [130, 126]).unwrap()
}

/// From outside, from amid the triangles, past them, closely, and from far away.
fn cameras() -> [Camera; 5] {
    [
        look([0.3, 0.2, 3.0], [0.0; 3], 50.0),
        look([0.1, 0.0, -0.1], [0.4, 0.3, 0.2], 120.0),
        look([1.5, 1.4, 1.6], [1.5, -3.0, 1.0], 90.0),
        look([2.0, 1.0, 3.0], [0.1, 0.2, 0.0], 4.0),
        look([300.0, 200.0, 3e3], [0.0; 3], 0.1),
    ]
}

/// Small triangles before and behind a few that cover much of the picture.
fn layers() -> Arc<Animation> {
    let swarm = swarm(3900);
    let mut corners = positions(&swarm, 0.0);
    for (sheet, z) in [0.9_f32, 0.4, -0.2, -0.8].into_iter().enumerate() {
        let edge = 0.3 * (1 + sheet) as f32;
        corners.extend([[-edge, -edge, z], [edge, -edge, z], [0.0, edge, z]]);
    }
    let triangles = (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
    Arc::new(Animation::new(vec![corners], triangles.collect()).unwrap())
}

pub(super) fn rays_together_find_what_each_finds_by_itself() {
    let mut backend = device();
    for animation in [swarm(4000), layers()] {
        backend
            .load(Arc::clone(&animation), laid(Layout::Fast))
            .unwrap();
        for (time, generation) in [(0.0, 1), (0.3, 2), (1.0, 3)] {
            let tree = tree_at(&animation, time);
            backend.adopt(&tree, Generation(generation)).unwrap();
            let before = backend.device_bytes().unwrap().tree;
            for camera in cameras() {
                check(&mut *backend, (&animation, time), &camera);
            }
            // What is covered takes room from the first time on, so tiles were there.
            let grown = backend.device_bytes().unwrap().tree - before;
            assert!(generation > 1 || grown >= 32 * animation.live_count() as u64);
        }
    }
}

fn check(backend: &mut dyn Backend, (animation, time): (&Animation, f64), camera: &Camera) {
    stand(backend, animation, time);
    let ticket = go(backend, Rays::Camera(camera), SHADOWED);
    let together = hits(backend, ticket);
    let row = |y| (0..camera.width).map(move |x| camera.ray(x, y));
    let rays: Vec<Ray> = (0..camera.height).flat_map(row).collect();
    stand(backend, animation, time);
    let ticket = go(backend, Rays::List(&rays), SHADOWED);
    assert!(together == hits(backend, ticket), "{camera:?} at {time}");
}
