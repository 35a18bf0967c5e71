//! Checks that rays traced together, as packets or by rasterization, have the same hits as rays traced singly.

use crate::Subject;
use crate::scenes::{
    PICTURE_SIZE, SHADOWED, cameras, check_picture, look, numbers, positions, swarm, trace, tree_at,
};
use backend::{Generation, Intersector, Rays};
use bvh_layout::Topology;
use conformance::stage::open;
use conformance::uneven_tree;
use geom::{Animation, Point};
use integration::is_full;
use integration::stage::separate_triangles;
use shaders::BufferName;
use std::sync::Arc;

/// Small triangles in front of and behind a few that cover much of the picture.
fn layers() -> Arc<Animation> {
    let swarm = swarm(930);
    let mut corners = positions(&swarm, 0.0);
    for (sheet, z) in [0.9_f32, 0.4, -0.2, -0.8].into_iter().enumerate() {
        let edge = 0.3 * (1 + sheet) as f32;
        corners.extend([[-edge, -edge, z], [edge, -edge, z], [0.0, edge, z]]);
    }
    // These triangles have zero area, though rounding may give them some.
    let mut number = numbers(3);
    let mut whole = || std::array::from_fn::<_, 3, _>(|_| (256.0 * number()).round() / 256.0);
    for _ in 0..60 {
        let (at, d): (Point, Point) = (whole(), whole());
        corners.extend([0.0_f32, 1.0, 3.0].map(|k| std::array::from_fn(|i| at[i] + k * d[i])));
    }
    separate_triangles(vec![corners])
}

/// A chain of 40 leaves above a balanced tree of all others, which gives wide nodes at three levels.
fn comb(animation: &Animation) -> Topology {
    let tree = tree_at(animation, 0.0);
    uneven_tree(animation.triangle_count(), tree.binary().order(), 40)
}

pub(crate) fn packets_match_single_rays(backend: &mut dyn Subject) {
    for intersector in Intersector::ALL {
        check_packets(backend, intersector);
    }
}

fn check_packets(backend: &mut dyn Subject, intersector: Intersector) {
    let (moving, still) = ([(0.0, 1), (0.3, 2), (1.0, 3)], [(0.0, 1), (0.0, 2)]);
    for (animation, moments) in [(swarm(1000), &moving[..]), (layers(), &still[..])] {
        backend.load(Arc::clone(&animation), intersector).unwrap();
        for &(time, generation) in moments {
            let tree = match generation {
                2 => comb(&animation),
                _ => tree_at(&animation, time),
            };
            backend.adopt(&tree, Generation(generation)).unwrap();
            let before = backend.memory().held.unwrap().tree;
            // By default, each intersector traces later trees from two cameras. The intersectors together use all
            // cameras.
            let uses_all = generation == 1 || is_full();
            let (first, count) = if uses_all {
                (0, 5)
            } else {
                (2 * intersector as usize, 2)
            };
            for camera in cameras().iter().cycle().skip(first).take(count) {
                check_picture(backend, (&animation, time), camera);
            }
            // The memory of packets is allocated on first use, so packets were used.
            let grown = backend.memory().held.unwrap().tree - before;
            assert!(generation > 1 || grown >= 32 * animation.live_count() as u64);
        }
    }
}

/// Pixels of each camera's picture.
const PIXELS: usize = (PICTURE_SIZE[0] * PICTURE_SIZE[1]) as usize;

/// Triangles of a few pixels, every third one twice. Some are slivers, and some have zero area though rounding may give
/// them some. Two cover half of the picture. With `MollerTrumbore` and `Woop` all are smaller, because kernels then
/// rasterize the box of each triangle instead of the triangle.
fn dust_for(intersector: Intersector) -> Arc<Animation> {
    match intersector {
        Intersector::Watertight | Intersector::Exact => dust(0.02, 1.0),
        Intersector::MollerTrumbore | Intersector::Woop => dust(0.005, 0.1),
    }
}

/// Returns small triangles of one size, and two panes.
fn dust(size: f32, pane: f32) -> Arc<Animation> {
    let mut number = numbers(5);
    let mut point = |size: f32| std::array::from_fn::<_, 3, _>(|_| size * number());
    let mut corners: Vec<Point> = Vec::new();
    for t in 0..1125 {
        let (at, b, c) = (point(1.0), point(size), point(size));
        let third = match t % 9 {
            1 => std::array::from_fn(|i| 3.0 * b[i]),
            2 => std::array::from_fn(|i| 12.0 * b[i] + 0.01 * c[i]),
            _ => c,
        };
        let beside = |d: Point| std::array::from_fn(|i| at[i] + d[i]);
        let triangle = [at, beside(b), beside(third)];
        for _ in 0..1 + u32::from(t % 3 == 0) {
            corners.extend(triangle);
        }
    }
    for z in [0.3_f32, -0.9] {
        let corner = |x: f32, y: f32| [pane * x, pane * y, z];
        corners.extend([corner(-1.0, -0.7), corner(1.0, -0.8), corner(0.1, 1.0)]);
    }
    separate_triangles(vec![corners])
}

/// The triangles of [`dust`], and `count` further ones.
fn dust_and(count: u32, triangle: impl FnMut(u32) -> [Point; 3]) -> Arc<Animation> {
    let mut corners = positions(&dust(0.02, 1.0), 0.0);
    corners.extend((0..count).flat_map(triangle));
    separate_triangles(vec![corners])
}

/// Diagonal slivers with few pixels in many coverage tiles (docs/design/visibility-buffer.md).
fn splinters(count: u32) -> Arc<Animation> {
    let mut number = numbers(17);
    dust_and(count, |_| {
        let [x, y, z] = [0.6 * number(), 0.6 * number(), number()];
        [[x, y, z], [x + 0.8, y + 0.4, z], [x + 0.8, y + 0.401, z]]
    })
}

/// Triangles of `size` that face the eye.
fn panes(count: u32, size: f32) -> Arc<Animation> {
    let mut number = numbers(23);
    dust_and(count, |_| {
        let [x, y, z] = [number(), number(), number()];
        [[x, y, z], [x + size, y, z], [x, y + size, z]]
    })
}

/// Triangles in front of and behind the dust, each across most of the picture.
fn sheets(count: u32) -> Arc<Animation> {
    dust_and(count, |sheet| {
        let z = 0.8 - 1.6 * sheet as f32 / count as f32;
        [[-2.0, -1.5, z], [2.0, -1.4, z], [0.0, 2.0, z]]
    })
}

/// Returns whether rasterization of the last picture was complete, according to the visibility buffer.
fn is_rasterization_complete(backend: &mut dyn Subject, intersector: Intersector) -> bool {
    let entries = match intersector {
        Intersector::Watertight => PIXELS,
        _ => 2 * PIXELS,
    };
    backend.words(BufferName::Visibility, 2 * entries + 2)[2 * entries..] == [u32::MAX; 2]
}

pub(crate) fn rasterization_matches_single_rays(backend: &mut dyn Subject) {
    for intersector in Intersector::ALL {
        check_rasterization(backend, intersector);
    }
}

fn check_rasterization(backend: &mut dyn Subject, intersector: Intersector) {
    let dust = dust_for(intersector);
    open(backend, &dust, 0.0, intersector).unwrap();
    let before = backend.memory().held.unwrap().tree;
    for camera in cameras() {
        check_picture(backend, (&dust, 0.0), &camera);
        assert!(
            is_rasterization_complete(backend, intersector),
            "{intersector:?}, {camera:?}"
        );
    }
    // The tiles count as memory of the tree: 16 bytes for each tile, and for each of the 4096 entries of the list of
    // large triangles. The visibility buffer counts as memory of frames.
    let (grown, live) = (
        backend.memory().held.unwrap().tree - before,
        dust.live_count(),
    );
    let tiles = live + PIXELS / 4;
    assert!((16 * tiles..17 * (tiles + 4096)).contains(&(grown as usize)));
    // A refitted swarm that moves, with triangles that are inactive at times.
    let swarm = swarm(2250);
    open(backend, &swarm, 0.0, intersector).unwrap();
    let far = look([2.0, 8.0, 30.0], [0.0; 3], (50.0, PICTURE_SIZE));
    for (time, camera) in [0.0, 0.3, 1.0].into_iter().zip([&far, &far, &cameras()[0]]) {
        check_picture(backend, (&swarm, time), camera);
    }
}

pub(crate) fn excessive_coverage_falls_back_to_rays(backend: &mut dyn Subject) {
    for intersector in Intersector::ALL {
        check_fallback_to_rays(backend, intersector);
    }
}

fn check_fallback_to_rays(backend: &mut dyn Subject, intersector: Intersector) {
    // The first three exceed the limit of two tests per pixel, with large, medium and small triangles. The fourth has
    // more tiles than fit in memory. The fifth has more large triangles than their list holds.
    let tests = [sheets(4), panes(500, 0.4), panes(9000, 0.08)];
    let others = [splinters(400), sheets(5000)];
    for animation in tests.into_iter().chain(others) {
        open(backend, &animation, 0.0, intersector).unwrap();
        check_picture(backend, (&animation, 0.0), &cameras()[0]);
        let triangles = animation.triangle_count();
        assert!(
            !is_rasterization_complete(backend, intersector),
            "{intersector:?}, {triangles} triangles"
        );
    }
    // Rasterization is retried after a while, which does not depend on the intersector. This camera looks away from the
    // triangles, so the retry succeeds.
    if intersector == Intersector::Watertight || is_full() {
        let away = look([0.0, 0.0, 3.0], [0.0, 0.0, 9.0], (50.0, PICTURE_SIZE));
        let mut tried = (0..1000).map(|_| {
            trace(backend, Rays::Camera(&away), SHADOWED);
            is_rasterization_complete(backend, intersector)
        });
        assert_eq!(tried.position(|told| told), Some(63));
    }
    // In another scene it is used at once.
    let dust = dust_for(intersector);
    open(backend, &dust, 0.0, intersector).unwrap();
    check_picture(backend, (&dust, 0.0), &cameras()[0]);
    assert!(is_rasterization_complete(backend, intersector));
}
