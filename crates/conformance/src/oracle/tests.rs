//! Hand-written cases, and random ones compared with a naive implementation.

use super::nearest::nearest;
use super::*;
use crate::{nth_case, stage};
use num_traits::ToPrimitive;

const SQUARE: [Triangle; 2] = [
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]],
    [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
];

fn closest(corners: &[Triangle], ray: &Ray) -> Option<ExactHit> {
    Oracle::new(corners.to_vec()).closest(ray)
}

/// Returns a hit of triangle 0 at `t = 1` with these weights.
fn first([u, v]: [f32; 2]) -> Option<ExactHit> {
    Some(ExactHit {
        triangle: 0,
        rounded: [1.0, u, v],
    })
}

#[test]
fn handles_extreme_magnitudes() {
    for s in [f32::MAX, 1e30, 1e-30, f32::from_bits(8)] {
        let corners = SQUARE.map(|t| t.map(|p| p.map(|x| x * s)));
        let ray = Ray::new([0.5 * s, 0.25 * s, s], [0.0, 0.0, -s]);
        assert_eq!(closest(&corners, &ray), first([0.25, 0.25]), "{s}");
    }
    let far = |d: f32| Ray::new([0.0, 0.0, f32::MAX], [0.0, 0.0, -d]);
    let t = closest(&SQUARE, &far(1.0)).map(|h| h.rounded[0]);
    assert_eq!(t, Some(f32::MAX));
    // The distance rounds to infinity, which is never within the limits.
    assert_eq!(closest(&SQUARE, &far(f32::from_bits(1))), None);
}

/// The ray passes through exactly the midpoint of an edge that two triangles share.
#[test]
fn shared_edge_does_not_leak() {
    let [a, b] = [
        [125_496.0, -74_074.0, -194_525.0],
        [132_966.0, 145_922.0, 96_123.0],
    ];
    let c = [88_925.0, 3_958.0, 74_750.0];
    let d = [122_460.0, 12_028.0, -193_949.0];
    let ray = Ray::new(
        [-197_847.0, -163_721.0, 59_272.0],
        [327_078.0, 199_645.0, -108_473.0],
    );
    let corners = [[a, b, c], [d, b, a]];
    assert_eq!(closest(&corners, &ray), first([0.5, 0.0]));
    assert_eq!(naive::all(&ray, &corners).len(), 2);
}

/// Returns the generated cases of 1 to 40 triangles, each with its first triangle repeated and a fifth of its rays.
/// Kinds of scenes that always have more triangles do not occur.
fn cases() -> impl Iterator<Item = (Vec<Triangle>, Vec<Ray>)> {
    let few = (0..200).map(|i| nth_case(9, i));
    few.filter(|case| (1..=40).contains(&case.animation.triangle_count()))
        .map(|case| {
            let mut corners = stage::triangles(&case.animation, case.times[1]);
            corners.push(corners[0]);
            (corners, case.rays.into_iter().step_by(5).collect())
        })
}

#[test]
fn oracle_agrees_with_naive_version() {
    for (corners, rays) in cases() {
        let oracle = Oracle::new(corners.clone());
        for ray in &rays {
            let naive = naive::all(ray, &corners);
            let all = oracle.all(ray);
            let first = oracle.closest_triangle(ray);
            assert_eq!(first, all.first().map(|h| h.triangle));
            let found: Vec<_> = all.iter().map(|h| (h.triangle, h.rounded[0])).collect();
            let expected: Vec<_> = naive.iter().map(|(t, i)| (*i, nearest(t))).collect();
            assert_eq!(found, expected, "{ray:?}");
            assert_eq!(oracle.closest(ray), all.first().copied());
        }
    }
}

#[test]
fn certain_results_in_double_precision_are_correct() {
    for (all, rays) in cases() {
        for ray in rays.iter().filter(|ray| ray.is_valid()) {
            for corners in all.iter().filter(|corners| is_active(corners)) {
                let is_right = match (bound_hit(ray, corners), cross(ray, corners)) {
                    (None, exact) => exact.is_none(),
                    (Some(found), None) => !found.is_sure,
                    (Some(c), Some(exact)) => {
                        let t = exact.t.to_f64().expect("a distance is a number");
                        (c.low..=c.high).contains(&t)
                    }
                };
                assert!(is_right, "{ray:?} {corners:?}");
            }
        }
    }
}

/// The same definition in rational arithmetic, as simply as possible.
mod naive {
    use super::super::nearest::nearest;
    use geom::{Point, Ray, Triangle};
    use num_rational::BigRational;
    use num_traits::{Signed, Zero};

    type Vector = [BigRational; 3];

    /// Returns every hit as `(t, triangle)`, ordered by exact `t`, then by index.
    pub(super) fn all(ray: &Ray, corners: &[Triangle]) -> Vec<(BigRational, u32)> {
        let one = |(i, c): (usize, &Triangle)| Some((hit(ray, c)?, i as u32));
        let mut hits: Vec<_> = corners.iter().enumerate().filter_map(one).collect();
        hits.sort();
        hits
    }

    /// Intersects the plane, then tests on which side of each edge the point is.
    fn hit(ray: &Ray, corners: &Triangle) -> Option<BigRational> {
        if !ray.is_valid() || corners.iter().flatten().any(|x| !x.is_finite()) {
            return None;
        }
        let [a, b, c] = corners.map(vector);
        let (o, d) = (vector(ray.origin), vector(ray.direction));
        let n = cross(&sub(&b, &a), &sub(&c, &a));
        let slope = dot(&n, &d);
        if slope.is_zero() {
            return None;
        }
        let t = dot(&n, &sub(&a, &o)) / slope;
        let p: Vector = std::array::from_fn(|i| &o[i] + &t * &d[i]);
        let side = |a: &Vector, b: &Vector| dot(&n, &cross(&sub(b, a), &sub(&p, a)));
        let sides = [side(&a, &b), side(&b, &c), side(&c, &a)];
        let inside = !sides.iter().any(Signed::is_negative);
        let rounded = nearest(&t);
        let within = ray.t_min < rounded && rounded < ray.t_max;
        (inside && within).then_some(t)
    }

    fn vector(p: Point) -> Vector {
        p.map(|x| BigRational::from_float(x).expect("`hit` excludes numbers that are not finite"))
    }

    fn sub(a: &Vector, b: &Vector) -> Vector {
        std::array::from_fn(|i| &a[i] - &b[i])
    }

    fn cross(a: &Vector, b: &Vector) -> Vector {
        std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            &a[j] * &b[k] - &a[k] * &b[j]
        })
    }

    fn dot(a: &Vector, b: &Vector) -> BigRational {
        (0..3).map(|i| &a[i] * &b[i]).sum()
    }
}
