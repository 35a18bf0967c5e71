//! Rays that go down a tree together find what each finds by itself.

use super::scenes::{
    SHADOWED, Watched, device, go, hits, laid, numbers, positions, stand, swarm, tree_at, tree_of,
};
use backend::{Backend, Generation, Layout, Rays};
use bvh_layout::Topology;
use geom::{Animation, Camera, Point};
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
    let swarm = swarm(3800);
    let mut corners = positions(&swarm, 0.0);
    for (sheet, z) in [0.9_f32, 0.4, -0.2, -0.8].into_iter().enumerate() {
        let edge = 0.3 * (1 + sheet) as f32;
        corners.extend([[-edge, -edge, z], [edge, -edge, z], [0.0, edge, z]]);
    }
    // Without area, though rounding may see some.
    let mut number = numbers(3);
    let mut whole = || std::array::from_fn::<_, 3, _>(|_| (256.0 * number()).round() / 256.0);
    for _ in 0..60 {
        let (at, d): (Point, Point) = (whole(), whole());
        corners.extend([0.0_f32, 1.0, 3.0].map(|k| std::array::from_fn(|i| at[i] + k * d[i])));
    }
    let triangles = (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
    Arc::new(Animation::new(vec![corners], triangles.collect()).unwrap())
}

/// Forty leaves one below the other, and below them all others, halved again and again: wide nodes at three levels.
fn comb(animation: &Animation) -> Topology {
    let order = tree_at(animation, 0.0).leaf_triangles().to_vec();
    let triangles = animation.triangle_count() as u32;
    tree_of(triangles, &order, |depth, first, end| match depth {
        0..40 => first + 1,
        _ => first.midpoint(end),
    })
}

pub(super) fn rays_together_find_what_each_finds_by_itself() {
    let mut backend = device();
    for animation in [swarm(4000), layers()] {
        backend
            .load(Arc::clone(&animation), laid(Layout::Fast))
            .unwrap();
        for (time, generation) in [(0.0, 1), (0.3, 2), (1.0, 3)] {
            let tree = match generation {
                2 => comb(&animation),
                _ => tree_at(&animation, time),
            };
            backend.adopt(&tree, Generation(generation)).unwrap();
            let before = backend.device_bytes().unwrap().tree;
            for camera in cameras() {
                check(&mut *backend, (&animation, time), &camera);
            }
            // What is covered takes room from the first time on, so packets were there.
            let grown = backend.device_bytes().unwrap().tree - before;
            assert!(generation > 1 || grown >= 32 * animation.live_count() as u64);
        }
    }
}

/// Columns and rows of what covers all of the picture: see cover.wgsl.
const EVERYWHERE: u32 = 0xffff_0000;

/// How many lanes of the wide tree, and how many triangles, cover all of the last picture.
fn everywhere(backend: &mut Watched) -> [usize; 2] {
    let backend = &mut **backend;
    let tree = backend.tree.as_ref().expect("a scene was loaded");
    let lanes = tree.shape.wide.lanes as usize;
    let rows = lanes + 2 * tree.shape.leaf_count as usize;
    let (gpu, road, covers) = (&backend.gpu, &mut backend.readback, &tree.buffers.covers);
    let rows: &[[u32; 4]] = backend.window.look(gpu, road, covers, rows).unwrap();
    let count = |rows: &[[u32; 4]], step| {
        let first = rows.iter().step_by(step);
        first
            .filter(|row| row[0] == EVERYWHERE && row[1] == EVERYWHERE)
            .count()
    };
    [count(&rows[..lanes], 1), count(&rows[lanes..], 2)]
}

pub(super) fn what_lies_beside_the_picture_covers_none_of_it() {
    let mut backend = device();
    let animation = swarm(4000);
    let tree = tree_at(&animation, 0.0);
    backend
        .load(Arc::clone(&animation), laid(Layout::Fast))
        .unwrap();
    backend.adopt(&tree, Generation(1)).unwrap();
    // A few of those astride the eye's plane reach into what is seen from amid; past all of them none does.
    let amid = cameras()[1];
    let past = look([0.0, 3.0, 0.0], [0.0, 3.0, -5.0], 40.0);
    check(&mut *backend, (&animation, 0.0), &amid);
    let [_, triangles] = everywhere(&mut backend);
    assert!((1..astride(&animation, &amid) / 8).contains(&triangles));
    check(&mut *backend, (&animation, 0.0), &past);
    assert!(astride(&animation, &past) > 100);
    assert_eq!(everywhere(&mut backend), [0, 0]);
}

/// Triangles with corners before and behind the eye.
fn astride(animation: &Animation, camera: &Camera) -> usize {
    let vertices = positions(animation, 0.0);
    let ahead = camera.ray(camera.width / 2, camera.height / 2).direction;
    let depth = |v: &u32| -> f32 {
        let p = vertices[*v as usize];
        (0..3).map(|i| (p[i] - camera.eye[i]) * ahead[i]).sum()
    };
    let is_astride = |corners: &&[u32; 3]| {
        let depths = corners.each_ref().map(depth);
        depths.iter().any(|&d| d < 0.0) && depths.iter().any(|&d| d > 0.0)
    };
    animation.triangles().iter().filter(is_astride).count()
}

fn check(backend: &mut dyn Backend, (animation, time): (&Animation, f64), camera: &Camera) {
    stand(backend, animation, time);
    let ticket = go(backend, Rays::Camera(camera), SHADOWED);
    let together = hits(backend, ticket);
    let rays: Vec<_> = camera.rays().collect();
    stand(backend, animation, time);
    let ticket = go(backend, Rays::List(&rays), SHADOWED);
    assert!(together == hits(backend, ticket), "{camera:?} at {time}");
}
