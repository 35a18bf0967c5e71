//! Rays and triangles at which an error bound decides whether a hit is found: "What a hit is", `docs/design/hits.md`.

use crate::exact::check;
use backend::{Backend, Intersector, Query, QueryKind, Rays};
use conformance::stage::open;
use geom::{Animation, Camera, Point, Ray};
use integration::stage::{closest, host, separate_triangles, trace};
use std::sync::Arc;

/// Tests a triangle just before the start (`t < 0`) of equal rays. Backend `cpu` may trace them as a packet. The
/// distance underflows to zero.
pub(crate) fn distances_that_underflow_are_plus_zero(backend: &mut dyn Backend) {
    let (size, depth) = ((-60_f32).exp2(), (-91_f32).exp2());
    let corners = [
        [-size, -size, -depth],
        [size, -size, -depth],
        [0.0, size, -depth],
    ];
    let animation = separate_triangles(vec![corners.to_vec()]);
    let ray = Ray {
        origin: [0.0; 3],
        t_min: -1.0,
        direction: [0.0, 0.0, 60_f32.exp2()],
        t_max: 1.0,
    };
    open(backend, &animation, 0.0, Intersector::Watertight).unwrap();
    for hit in closest(backend, &animation, 0.0, &[ray; 16]) {
        assert_eq!((hit.triangle, hit.t.to_bits()), (0, 0));
    }
}

/// A light with an infinite or NaN coordinate, and two triangles. The ray is extreme, because it starts far away.
pub(crate) fn hits_of_extreme_rays_are_lit_by_infinite_lights(backend: &mut dyn Backend) {
    let wall = [[0.0, -1.0, -1.0], [0.0, 2.0, -1.0], [0.0, 0.5, 3.0]];
    let ceiling = [[-1.0, 2.5, -1.0], [1.0, 2.5, -1.0], [0.0, 2.5, 3.0]];
    let animation = separate_triangles(vec![[wall, ceiling].concat()]);
    let list = [Ray::new([2e12, 0.5, 0.0], [-1.0, 0.0, 0.0])];
    let rays = Rays::List(&list);
    open(backend, &animation, 0.0, Intersector::Watertight).unwrap();
    for y in [f32::INFINITY, f32::NAN] {
        let light = [0.0, y, 0.0];
        let kind = QueryKind::ClosestAndShadow { light };
        let hits = trace(backend, &animation, 0.0, Query { rays, kind });
        assert_eq!((hits.closest[0].triangle, hits.blocked[0]), (0, 0));
    }
}

/// An edge of the first triangle overflows. The second triangle blocks the light, but not the ray.
pub(crate) fn shadow_rays_start_finite_if_edges_overflow(backend: &mut dyn Backend) {
    let wall = [[3e38, -3e38, -1e38], [3e38, 3e38, -1e38], [3e38, 0.0, 2e38]];
    // An overflowing edge is replaced by the largest float (hits.md, extreme rays). The hit computed from this edge
    // has this `y`.
    let (y, size) = (-8.66e37, 1e37);
    let blocker = [
        [0.0, y - size, -size],
        [0.0, y + size, -size],
        [0.0, y, size],
    ];
    // Many ordinary triangles, so that the scene is not scaled.
    let mut corners = vec![wall, blocker];
    corners.extend([FAR; 40]);
    let animation = separate_triangles(vec![corners.concat()]);
    // The distance overflows too, so the hit is computed from the corners.
    let list = [Ray::new([-3e38, 0.0, 0.0], [1e10, 0.0, 0.0])];
    let rays = Rays::List(&list);
    let kind = QueryKind::ClosestAndShadow {
        light: [-3e38, y, 0.0],
    };
    open(backend, &animation, 0.0, Intersector::Exact).unwrap();
    let hits = trace(backend, &animation, 0.0, Query { rays, kind });
    assert_eq!((hits.closest[0].triangle, hits.blocked[0]), (0, 1));
}

/// The first key frame is so small that scaled coordinates of the second one are infinite.
pub(crate) fn overflow_by_scaling_loses_no_hit(backend: &mut dyn Backend) {
    for signs in [vec![1.0], vec![-1.0], vec![1.0, -1.0]] {
        let triangles: Vec<_> = [[0, 1, 2], [3, 4, 5]][..signs.len()].to_vec();
        let count = 3 * signs.len();
        let first = vec![[1e-40, 0.0, 0.0]; count];
        let animation = Animation::streamed(first, &vec![false; count], triangles);
        let animation = Arc::new(animation.unwrap());
        open(backend, &animation, 0.0, Intersector::Watertight).unwrap();
        let corners =
            |sign: &f32| [[8.0, 0.0], [9.0, 0.0], [8.0, 1.0]].map(|[x, y]| [sign * x, y, 0.0]);
        let second: Vec<Point> = signs.iter().flat_map(corners).collect();
        let time = animation.push(second).unwrap();
        let ray = |sign: &f32| Ray::new([sign * 8.25, 0.25, -1.0], [0.0, 0.0, 1.0]);
        let rays: Vec<Ray> = signs.iter().map(ray).collect();
        for hit in closest(backend, &animation, time, &rays) {
            assert_eq!([hit.t, hit.u, hit.v], [1.0, 0.25, 0.25], "{signs:?}");
        }
    }
}

/// Keeps the scene's scale at 1, away from all rays.
const FAR: [Point; 3] = [[1.0, 5.0, 5.0], [1.0, 6.0, 5.0], [1.0, 5.0, 6.0]];

fn against_the_oracle(backend: &mut dyn Backend, corners: &[[Point; 3]], rays: &[Ray]) {
    let animation = separate_triangles(vec![corners.concat()]);
    let expected = check(backend, &animation, 0.0, rays);
    assert!(expected.iter().any(Option::is_some), "no ray hits anything");
}

/// This triangle's box is very near to the ray's start. The box test pads the box in proportion to `D` (hits.md, box
/// test). `D` is the largest distance along an axis from the ray's start to a corner, but at least `2^-38`.
/// Without this limit, the padding would be smaller than the error of replacing tiny coordinates by zero.
pub(crate) fn boxes_near_the_origin_lose_no_exact_hit(backend: &mut dyn Backend) {
    let (step, width) = ((-47_f32).exp2(), (-64_f32).exp2());
    let x = (-24_f32).exp2() + step;
    let near = [
        [x, 0.99 * width, -0.9 * width],
        [x, 0.99 * width, 0.9 * width],
        [x, -0.9 * width, 0.0],
    ];
    let ray = Ray::new([x - step, 0.0, 0.0], [1.0, 0.95 * (-17_f32).exp2(), 0.0]);
    against_the_oracle(backend, &[FAR, near], &[ray]);
}

/// Products of this triangle's edge functions and depths underflow. The rays end or begin just before its plane.
pub(crate) fn underflowing_determinants_leave_limits_exact(backend: &mut dyn Backend) {
    let (size, start) = ((-50_f32).exp2(), (-16_f32).exp2());
    let depth = start * (-23_f32).exp2();
    let z = start + depth;
    let near = [
        [-1.1 * size, -1.3 * size, z],
        [1.5 * size, -0.7 * size, z],
        [0.1 * size, 1.6 * size, z],
    ];
    let rays = (0..400_u16).map(|i| {
        let place = |factor: f32| 0.2 * size * (2.0 * (f32::from(i) * factor).fract() - 1.0);
        let limit = depth * (1.0 - (-6.0 - f32::from(i % 15)).exp2());
        let (t_min, t_max) = if i % 2 == 1 {
            (-1.0, limit)
        } else {
            (limit, f32::INFINITY)
        };
        Ray {
            origin: [place(0.618_034), place(0.754_877), start],
            t_min,
            direction: [0.0, 0.0, 1.0],
            t_max,
        }
    });
    against_the_oracle(backend, &[FAR, near], &rays.collect::<Vec<_>>());
}

/// A ray that starts in two triangles and hits both at `t = 0`. The first one's box begins beyond the ray's start, at a
/// distance that rounds to zero.
pub(crate) fn ties_at_zero_go_to_the_lowest_triangle(backend: &mut dyn Backend) {
    let first = [
        [-2.052_907_2e-19, 1.577_45e-19, 1.084_211e-19],
        [8.673_617e-19, 3.835_551_2e-19, 2.997_596e-19],
        [6.458_097_3e-19, -7.241_718e-20, 4.677_732_7e-19],
    ];
    let (half, z) = ((-61_f32).exp2(), (-63_f32).exp2());
    let second = [[-half, -half, z], [half, -half, z], [0.0, half, z]];
    let ray = Ray {
        origin: [0.0, 0.0, z],
        t_min: -1.0,
        direction: [0.912_534_53, 0.478_212_48, 1.0],
        t_max: 1.0,
    };
    for corners in [
        [first, FAR, second],
        [first, second, FAR],
        [second, first, FAR],
    ] {
        let animation = separate_triangles(vec![corners.concat()]);
        open(backend, &animation, 0.0, Intersector::MollerTrumbore).unwrap();
        let hit = closest(backend, &animation, 0.0, &[ray])[0];
        assert_eq!((hit.triangle, hit.t), (0, 0.0), "{corners:?}");
    }
}

const EYE: Point = [0.3, 0.2, 0.1];

/// A camera that looks askew to all axes.
fn askew() -> Camera {
    Camera {
        eye: EYE,
        width: 128,
        height: 64,
        corner: [1.444_566_4, 0.718_117_5, -0.253_380_92],
        across: [-0.012_069_59, 0.0, 0.013_410_66],
        down: [0.001_971_94, -0.017_846_08, 0.001_774_75],
    }
}

fn direction(camera: &Camera, [x, y]: [f32; 2]) -> Point {
    [0, 1, 2].map(|i| camera.corner[i] + x * camera.across[i] + y * camera.down[i])
}

/// Needles just behind a wall. Rounding decides where along a needle a ray hits it, and so may place a hit before the
/// wall, nearer than all corners of the needle.
fn needles(camera: &Camera) -> Arc<Animation> {
    let at = |pixel: [f32; 2], depth: f32| -> Point {
        let d = direction(camera, pixel);
        [0, 1, 2].map(|i| EYE[i] + depth * d[i])
    };
    let [a, b, c, d] = [
        [-300.0, -200.0],
        [428.0, -200.0],
        [428.0, 264.0],
        [-300.0, 264.0],
    ]
    .map(|pixel| at(pixel, 1.0));
    let mut corners = vec![[a, b, c], [a, c, d]];
    for i in 0..1900_u16 {
        let spread = |factor: f32| (f32::from(i) * factor).fract();
        let middle = [
            (128.0 * spread(0.618_034)).floor() + 0.5,
            (64.0 * spread(0.754_877)).floor() + 0.5,
        ];
        let (sine, cosine) = (std::f32::consts::TAU * spread(0.569_84)).sin_cos();
        let length = 2.0 + 14.0 * spread(0.414_214);
        let along = |by: f32| at([middle[0] + by * cosine, middle[1] + by * sine], 1.000_2);
        let end = along(length * (0.5 + 0.5 * spread(0.302_776)));
        // Within a few units in the last place of the end.
        let ulps = [i % 5, i / 5 % 5, i / 25 % 5].map(|k| i32::from(k) - 2);
        let beside =
            [0, 1, 2].map(|k: usize| f32::from_bits(end[k].to_bits().wrapping_add_signed(ulps[k])));
        corners.push([along(-length), end, beside]);
    }
    separate_triangles(vec![corners.concat()])
}

pub(crate) fn camera_hits_on_needles_match_single_rays(backend: &mut dyn Backend) {
    let camera = askew();
    let animation = needles(&camera);
    let rays: Vec<Ray> = camera.rays().collect();
    let mut host = host();
    open(&mut host, &animation, 0.0, Intersector::Watertight).unwrap();
    let expected = closest(&mut host, &animation, 0.0, &rays);
    let needles = expected.iter().filter(|h| h.is_hit() && h.triangle > 1);
    let count = needles.count();
    assert!(count > 100, "only {count} needles are hit");
    open(backend, &animation, 0.0, Intersector::Watertight).unwrap();
    let query = Query::picture(&camera, [0.0, 5.0, 0.0]);
    let found = trace(backend, &animation, 0.0, query).closest;
    let other = expected.iter().zip(&found).position(|(a, b)| a != b);
    assert!(
        other.is_none(),
        "pixel {other:?}: {:?}",
        other.map(|i| (expected[i], found[i]))
    );
}
