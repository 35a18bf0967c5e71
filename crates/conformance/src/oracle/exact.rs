//! Intersection of one ray and one triangle in integers: every finite `f32` is `m * 2^e`.

use super::nearest::nearest;
use geom::{Ray, Triangle};
use num_bigint::{BigInt, Sign};
use num_rational::BigRational;
use num_traits::{Float, Signed};

/// Intersection of a ray's line and a closed triangle, within the ray's interval.
#[derive(Clone, Debug)]
pub(super) struct Crossing {
    /// Exact distance in multiples of the direction; not reduced.
    pub(super) t: BigRational,
    /// The exact distance and the exact weights of the second and the third corner, each rounded once.
    pub(super) rounded: [f32; 3],
}

type ExactVector = [BigInt; 3];

/// Returns the crossing of a valid ray and an active triangle, if there is one.
///
/// Let `d` be the ray's direction, and `A`, `B`, `C` the vectors from the ray's origin to the corners. Let `|x y z|` be
/// a determinant. Then the corners have the weights `U = |d B C|`, `V = |d C A|`, `W = |d A B|`, and
/// `t = |A B C| / (U + V + W)`. With `N = (B - A) x (C - A)`, the divisor is `d . N`. It is zero for a ray in the plane
/// and for a triangle without area.
pub(super) fn cross(ray: &Ray, [a, b, c]: &Triangle) -> Option<Crossing> {
    let o = &ray.origin;
    let flat: [f32; 12] = std::array::from_fn(|i| [a, b, c, o][i / 3][i % 3]);
    let (xs, point_exponent) = scale(flat);
    let (d, direction_exponent) = scale(ray.direction);
    let corner = |k: usize| -> ExactVector { std::array::from_fn(|i| &xs[3 * k + i] - &xs[9 + i]) };
    let [a, b, c] = [corner(0), corner(1), corner(2)];
    let b_c = cross_product(&b, &c);
    let normals = [&b_c, &cross_product(&c, &a), &cross_product(&a, &b)];
    let weights = normals.map(|n| dot(&d, n));
    let has = |sign: Sign| weights.iter().any(|w| w.sign() == sign);
    if has(Sign::Plus) == has(Sign::Minus) {
        return None;
    }
    let divisor: BigInt = weights.iter().sum();
    let [_, v, w] = weights;
    let exponent = point_exponent - direction_exponent;
    let t = quotient(dot(&a, &b_c), divisor.clone(), exponent);
    let rounded = nearest(&t);
    let is_within = ray.t_min < rounded && rounded < ray.t_max;
    is_within.then(|| {
        let [v, w] = [v, w].map(|weight| nearest(&quotient(weight, divisor.clone(), 0)));
        let rounded = [rounded, v, w];
        Crossing { t, rounded }
    })
}

fn cross_product(a: &ExactVector, b: &ExactVector) -> ExactVector {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        &a[j] * &b[k] - &a[k] * &b[j]
    })
}

fn dot(a: &ExactVector, b: &ExactVector) -> BigInt {
    (0..3).map(|i| &a[i] * &b[i]).sum()
}

/// Returns all of `xs`, which are finite, as multiples of `2^e`, where `e` is the smallest exponent among them.
fn scale<const N: usize>(xs: [f32; N]) -> ([BigInt; N], i32) {
    let parts = xs.map(Float::integer_decode);
    let exponents = parts.iter().filter(|part| part.0 != 0).map(|part| part.1);
    let least = exponents.min().unwrap_or(0);
    let shifted = parts.map(|(m, e, sign)| (BigInt::from(m) << (e - least).max(0)) * sign);
    (shifted, least.into())
}

/// Returns `(n / d) * 2^e` with a positive denominator. `d` must not be zero.
fn quotient(n: BigInt, d: BigInt, e: i32) -> BigRational {
    let (n, d) = if d.is_negative() { (-n, -d) } else { (n, d) };
    let [up, down] = [e.max(0), (-e).max(0)];
    BigRational::new_raw(n << up, d << down)
}
