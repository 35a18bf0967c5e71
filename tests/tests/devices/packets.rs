//! Rays that go down a tree together find what each finds by itself.

use crate::Subject;
use crate::scenes::{
    SQUARE, apart, cameras, check_picture, laid, look, numbers, open_laid, positions, swarm,
    tree_at,
};
use backend::{Generation, Layout};
use bvh_layout::Topology;
use conformance::record;
use geom::{Animation, Camera, Point};
use shaders::BufferName;
use std::sync::Arc;

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
    apart(vec![corners])
}

/// Forty leaves one below the other, and below them all others, halved again and again: wide nodes at three levels.
fn comb(animation: &Animation) -> Topology {
    let order = tree_at(animation, 0.0).leaf_triangles().to_vec();
    let split = |depth, leaves| if depth < 40 { 1 } else { leaves / 2 };
    record(animation.triangle_count(), &order, split)
}

pub(crate) fn rays_together_find_what_each_finds_by_itself(backend: &mut dyn Subject) {
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
                check_picture(backend, (&animation, time), &camera);
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
fn everywhere(backend: &mut dyn Subject, animation: &Animation, tree: &Topology) -> [usize; 2] {
    let treelets = tree.to_treelets(animation.static_parts());
    let lanes = treelets.wide.as_ref().unwrap().lanes;
    let words = backend.words(BufferName::Covers, 4 * (lanes + 2 * tree.leaf_count()));
    let rows: Vec<_> = words.chunks_exact(4).collect();
    let count = |rows: &[&[u32]], step| {
        let covers = |row: &&&[u32]| row[0] == EVERYWHERE && row[1] == EVERYWHERE;
        rows.iter().step_by(step).filter(covers).count()
    };
    [count(&rows[..lanes], 1), count(&rows[lanes..], 2)]
}

pub(crate) fn what_lies_beside_the_picture_covers_none_of_it(backend: &mut dyn Subject) {
    let animation = swarm(4000);
    let tree = tree_at(&animation, 0.0);
    open_laid(backend, &animation, Layout::Fast);
    // A few of those astride the eye's plane reach into what is seen from amid; past all of them none does.
    let amid = cameras()[1];
    let past = look([0.0, 3.0, 0.0], [0.0, 3.0, -5.0], (40.0, SQUARE));
    check_picture(backend, (&animation, 0.0), &amid);
    let [_, triangles] = everywhere(backend, &animation, &tree);
    assert!((1..astride(&animation, &amid) / 8).contains(&triangles));
    check_picture(backend, (&animation, 0.0), &past);
    assert!(astride(&animation, &past) > 100);
    assert_eq!(everywhere(backend, &animation, &tree), [0, 0]);
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
