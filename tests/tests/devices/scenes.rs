//! Small scenes and helper functions for tests.

use backend::{Backend, FrameReport, Hits, Intersector, QueryKind, Rays, Snapshot, Ticket};
use conformance::stage::{self, next_positions};
use geom::{Animation, Camera, CameraPose, Point, Ray};
use integration::stage::separate_triangles;
use std::sync::Arc;

pub(crate) use conformance::stage::{tree_at, vertices as positions};

/// Generates numbers in -1..1 that are the same on every machine (SplitMix64).
pub(crate) fn numbers(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed;
    move || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 23) as f32 - 1.0
    }
}

/// Creates triangles that move over three key frames. Some are inactive or degenerate at times.
pub(crate) fn swarm(triangles: u32) -> Arc<Animation> {
    let mut number = numbers(7);
    let mut point = move || [number(), number(), number()];
    let mut key = |k: u32| -> Vec<Point> {
        let mut corners = Vec::new();
        for t in 0..triangles {
            let (at, b, c) = (point(), point(), point());
            let beside = |d: Point| std::array::from_fn(|i| at[i] + 0.2 * d[i]);
            let broken = t % 41 == 3 && k == 1 || t % 53 == 5;
            let flat = t % 37 == 2;
            corners.push(if broken { [f32::NAN; 3] } else { at });
            corners.push(beside(b));
            corners.push(beside(if flat { b } else { c }));
        }
        corners
    };
    separate_triangles((0..3).map(&mut key).collect())
}

pub(crate) fn camera() -> Camera {
    look([0.3, 0.2, 3.0], [0.0; 3], (50.0, [70, 43]))
}

/// Creates rays through the scene from all sides. Some are invalid.
pub(crate) fn rays(count: usize) -> Vec<Ray> {
    let mut number = numbers(11);
    let mut point = move |s: f32| [s * number(), s * number(), s * number()];
    let mut ray = || {
        let (from, to) = (point(2.0), point(0.8));
        Ray::new(from, std::array::from_fn(|i| to[i] - from[i]))
    };
    let mut all: Vec<Ray> = (0..count).map(|_| ray()).collect();
    all[0].direction = [0.0; 3];
    all[1].origin[2] = f32::INFINITY;
    all[2].t_max = 0.4;
    all
}

pub(crate) const SHADOWED: QueryKind = QueryKind::ClosestAndShadow {
    light: [2.0, 5.0, 3.0],
};

/// Loads the scene, with a tree of its first key frame.
pub(crate) fn open(backend: &mut dyn Backend, animation: &Arc<Animation>) {
    stage::open(backend, animation, 0.0, Intersector::Watertight).unwrap();
}

/// Records all stages that precede a trace.
pub(crate) fn interpolate_and_refit(backend: &mut dyn Backend, animation: &Animation, time: f64) {
    stage::interpolate_and_refit(backend, animation, time).unwrap();
}

pub(crate) fn submit_trace(backend: &mut dyn Backend, rays: Rays<'_>, kind: QueryKind) -> Ticket {
    stage::start(backend, rays, kind).unwrap()
}

pub(crate) fn hits(backend: &mut dyn Backend, ticket: Ticket) -> Hits {
    let mut hits = Hits::default();
    backend.take_hits(ticket, 0, &mut hits).unwrap();
    hits
}

/// Records a trace, submits, and returns the hits.
pub(crate) fn trace(backend: &mut dyn Backend, rays: Rays<'_>, kind: QueryKind) -> Hits {
    stage::trace_and_wait(backend, rays, kind).unwrap().hits
}

pub(crate) fn report(backend: &mut dyn Backend) -> FrameReport {
    let ticket = backend.submit().unwrap();
    backend.wait(ticket).unwrap()
}

/// Checks that a camera's picture at `time` equals the hits of a list of its rays.
pub(crate) fn check_picture(
    backend: &mut dyn Backend,
    (animation, time): (&Animation, f64),
    camera: &Camera,
) {
    interpolate_and_refit(backend, animation, time);
    let together = trace(backend, Rays::Camera(camera), SHADOWED);
    let rays: Vec<_> = camera.rays().collect();
    interpolate_and_refit(backend, animation, time);
    let apart = trace(backend, Rays::List(&rays), SHADOWED);
    assert!(together == apart, "{camera:?} at {time}");
}

pub(crate) fn look(eye: Point, target: Point, (fov, size): (f32, [u32; 2])) -> Camera {
    Camera::look_at(CameraPose::new(eye, target).with_fov(fov), size).unwrap()
}

/// Size of most pictures, in pixels.
pub(crate) const PICTURE_SIZE: [u32; 2] = [66, 62];

/// Cameras outside and among the triangles, looking past them, close up, and far away.
pub(crate) fn cameras() -> [Camera; 5] {
    [
        ([0.3, 0.2, 3.0], [0.0; 3], 50.0),
        ([0.1, 0.0, -0.1], [0.4, 0.3, 0.2], 120.0),
        ([1.5, 1.4, 1.6], [1.5, -3.0, 1.0], 90.0),
        ([2.0, 1.0, 3.0], [0.1, 0.2, 0.0], 4.0),
        ([300.0, 200.0, 3e3], [0.0; 3], 0.1),
    ]
    .map(|(eye, target, fov)| look(eye, target, (fov, PICTURE_SIZE)))
}

/// Waits for the oldest requested positions.
pub(crate) fn wait_for_positions(backend: &mut dyn Backend) -> (Ticket, Snapshot) {
    next_positions(backend).unwrap()
}

/// Returns the bits of coordinates. NaN is `None`, because it has many bit patterns.
pub(crate) fn bits(points: &[Point]) -> Vec<[Option<u32>; 3]> {
    let bits = |x: f32| (!x.is_nan()).then(|| x.to_bits());
    points.iter().map(|p| p.map(bits)).collect()
}
