//! Exact ray-triangle intersection in integer arithmetic, for the few rays that rounded arithmetic with error bounds
//! cannot decide.
//!
//! A triangle includes its edges, and a line in its plane misses it, as intersector `exact` specifies. Every finite
//! `f32` is an integer multiple of a power of two. So each decision is the sign of a sum of products of
//! arbitrary-precision integers, without rounding, overflow or underflow.

use crate::{Point, Ray, Triangle};
use num_bigint::{BigInt, BigUint, Sign};
use num_traits::{Float, Signed, ToPrimitive, Zero};
use std::cmp::Ordering;

mod rounding;

type IntegerVector = [BigInt; 3];

/// A ray to intersect with triangles that are scaled by a power of two.
#[derive(Clone, Copy, Debug)]
pub struct ExactRay {
    /// The ray.
    pub ray: Ray,
    /// Corners are multiplied by `2^-corner_shift`, exactly, before they are tested.
    pub corner_shift: i32,
}

/// Hit of a ray and a triangle. Each number is the exact one, rounded once to the nearest float, ties to even.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundedHit {
    /// Distance in multiples of the ray's direction; infinite on overflow.
    pub t: f32,
    /// Weight of the second corner.
    pub u: f32,
    /// Weight of the third corner.
    pub v: f32,
}

/// Exact distance to the intersection of a line and a triangle: `t = n / d * 2^e`.
#[derive(Clone, Debug)]
pub struct ExactDistance {
    n: BigInt,
    /// Positive.
    d: BigInt,
    e: i32,
}

impl ExactRay {
    /// Returns the intersection with the closed triangle, or `None` if the ray misses it or is in its plane.
    ///
    /// The rounded [`t`](ExactDistance::t) is within the ray's open interval. So a ray that continues from a reported
    /// `t` never hits the same triangle again. The ray must be [valid](Ray::is_valid) and the corners finite.
    pub fn intersect(&self, corners: &Triangle) -> Option<ExactDistance> {
        self.in_interval(self.intersect_if(corners, passes_within)?)
    }

    fn in_interval(&self, distance: ExactDistance) -> Option<ExactDistance> {
        let t = distance.t();
        (self.ray.t_min < t && t < self.ray.t_max).then_some(distance)
    }

    /// Returns the intersection of the perturbed ray with the triangle. The ray's interval applies to the rounded `t`.
    ///
    /// The ray's origin is moved by `(e, e^2, e^3)` for an infinitesimal `e`, which is the same for all triangles
    /// (simulation of simplicity: Edelsbrunner, Mücke 1990). So the line never meets an edge or a vertex, where a
    /// closed surface could otherwise have no intersection or two.
    pub fn intersect_perturbed(&self, corners: &Triangle) -> Option<ExactDistance> {
        self.in_interval(self.intersect_if(corners, moved_passes_within)?)
    }

    fn intersect_if(
        &self,
        corners: &Triangle,
        within: impl Fn(&IntegerVector, [&IntegerVector; 3]) -> bool,
    ) -> Option<ExactDistance> {
        if certainly_misses(self, corners) {
            return None;
        }
        let (direction, [a, b, c], e) = self.integers(corners);
        if !within(&direction, [&a, &b, &c]) {
            return None;
        }
        let normal = cross(&minus(&b, &a), &minus(&c, &a));
        let (n, d) = (dot(&a, &normal), dot(&direction, &normal));
        let (n, d) = if d.is_negative() { (-n, -d) } else { (n, d) };
        (!d.is_zero()).then_some(ExactDistance { n, d, e })
    }

    /// Returns the direction, the corners relative to the ray's origin, and an exponent `e`.
    ///
    /// The direction and the corners are integer multiples of two different units. `2^e` is the unit of the corners
    /// divided by the unit of the direction.
    fn integers(&self, corners: &Triangle) -> (IntegerVector, [IntegerVector; 3], i32) {
        let direction_unit = unit(&[self.ray.direction]);
        let direction = whole(self.ray.direction, direction_unit);
        let position_unit = unit(corners).min(unit(&[self.ray.origin]) + self.corner_shift);
        let origin = whole(self.ray.origin, position_unit - self.corner_shift);
        let corners = corners.map(|p| minus(&whole(p, position_unit), &origin));
        let e = position_unit - self.corner_shift - direction_unit;
        (direction, corners, e)
    }

    /// Returns the distance and the weights at the [intersection](Self::intersect) with a triangle, each rounded once.
    /// Returns `None` if the line misses the triangle. Ignores the ray's interval.
    pub fn rounded(&self, corners: &Triangle) -> Option<RoundedHit> {
        let t = self.intersect_if(corners, passes_within)?.t();
        let [u, v] = self.weights(corners);
        Some(RoundedHit { t, u, v })
    }

    /// Returns the weights of the second and the third corner at the intersection, each rounded once. The line must
    /// [intersect](Self::intersect) the triangle.
    pub fn weights(&self, corners: &Triangle) -> [f32; 2] {
        let (direction, [a, b, c], _) = self.integers(corners);
        let [of_a, of_b, of_c] = sides(&direction, [&a, &b, &c]);
        let sum = of_a + &of_b + &of_c;
        let positive = |x: BigInt| if sum.is_negative() { -x } else { x };
        [of_b, of_c].map(|x| rounded(&positive(x), sum.magnitude(), 0))
    }
}

/// Returns whether double precision proves that the line misses the triangle.
///
/// The side of an edge is a sum of six products. Each has at most eight roundings, including those of the differences
/// of floats and of the sum. That is `8 * 2^-53` of the sum of absolute values. `8 * EPSILON` is twice that, so
/// it also covers the roundings of `size` and higher orders. No product leaves the range of `f64`.
fn certainly_misses(line: &ExactRay, corners: &Triangle) -> bool {
    let scale = f64::from(-line.corner_shift).exp2();
    let direction = line.ray.direction.map(f64::from);
    let [a, b, c]: [[f64; 3]; 3] = corners
        .map(|p| std::array::from_fn(|i| f64::from(p[i]) * scale - f64::from(line.ray.origin[i])));
    let side = |p: [f64; 3], q: [f64; 3]| {
        let (mut sum, mut size) = (0.0, 0.0);
        for (i, d) in direction.iter().enumerate() {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let (plus, minus) = (p[j] * q[k], p[k] * q[j]);
            sum += d * (plus - minus);
            size += d.abs() * (plus.abs() + minus.abs());
        }
        let doubt = 8.0 * f64::EPSILON * size;
        i32::from(sum > doubt) - i32::from(sum < -doubt)
    };
    let sides = [side(c, b), side(a, c), side(b, a)];
    sides.contains(&1) && sides.contains(&-1)
}

/// Returns whether the line from zero along `direction` intersects the closed triangle. Also true for every line in the
/// triangle's plane.
fn passes_within(direction: &IntegerVector, [a, b, c]: [&IntegerVector; 3]) -> bool {
    let signs = sides(direction, [a, b, c]).map(|side| side.sign());
    !(signs.contains(&Sign::Plus) && signs.contains(&Sign::Minus))
}

/// Returns whether the line intersects the triangle after the perturbation of [`ExactRay::intersect_perturbed`].
fn moved_passes_within(direction: &IntegerVector, [a, b, c]: [&IntegerVector; 3]) -> bool {
    let side = |p: &IntegerVector, q: &IntegerVector| match dot(direction, &cross(p, q)).sign() {
        Sign::NoSign => {
            let by_move = cross(direction, &minus(q, p));
            let mut signs = by_move.iter().map(BigInt::sign);
            signs.find(|s| *s != Sign::NoSign)
        }
        sign => Some(sign),
    };
    let first = side(c, b);
    first.is_some() && first == side(a, c) && first == side(b, a)
}

/// Returns the edge functions of `bc`, `ca` and `ab`. The sign is the side on which the line passes the edge.
fn sides(direction: &IntegerVector, [a, b, c]: [&IntegerVector; 3]) -> [BigInt; 3] {
    [(c, b), (a, c), (b, a)].map(|(p, q)| dot(direction, &cross(p, q)))
}

/// Returns `n / d * 2^e`, rounded once, or infinity on overflow. `d` is not zero.
fn rounded(n: &BigInt, d: &BigUint, e: i32) -> f32 {
    let up = 32 + d.bits() as i64 - n.bits() as i64;
    let down = up.min(0).unsigned_abs();
    let (size, d) = (n.magnitude() << up.max(0).unsigned_abs(), d << down);
    // The quotient has 32 or 33 bits. Its last bit is set if there is a remainder, so that the conversion to a float
    // rounds correctly.
    let quotient = &size / &d;
    let rest = &quotient * &d != size;
    let bits = (quotient | BigUint::from(u8::from(rest))).to_f64();
    let bits = bits.unwrap_or(f64::INFINITY);
    let bits = if n.is_negative() { -bits } else { bits };
    let e = i64::from(e) - up;
    let half = e / 2;
    (bits * (half as f64).exp2() * ((e - half) as f64).exp2()) as f32
}

impl ExactDistance {
    /// Returns `t`, rounded once, or infinity on overflow. Zero is always positive.
    pub fn t(&self) -> f32 {
        rounded(&self.n, self.d.magnitude(), self.e) + 0.0
    }

    /// Compares the distances of two intersections with the same line.
    pub fn order(&self, other: &Self) -> Ordering {
        let least = self.e.min(other.e);
        let times = |one: &Self, d: &BigInt| (&one.n * d) << (one.e - least).unsigned_abs();
        times(self, &other.d).cmp(&times(other, &self.d))
    }
}

/// Returns an exponent `e` such that all coordinates are integer multiples of `2^e`.
///
/// Each nonzero coordinate is an integer mantissa times a power of two. `e` is the least of these exponents, or 0 if
/// all coordinates are zero.
fn unit(points: &[Point]) -> i32 {
    let parts = points.iter().flatten().map(|x| x.integer_decode());
    let exponents = parts.filter(|part| part.0 != 0).map(|part| part.1);
    exponents.min().unwrap_or(0).into()
}

/// Returns a point in multiples of `2^unit`. `unit` must be at most the [`unit`] of the point.
fn whole(point: Point, unit: i32) -> IntegerVector {
    point.map(|x| {
        let (m, e, sign) = x.integer_decode();
        BigInt::from(i64::from(sign) * m as i64) << (i32::from(e) - unit).unsigned_abs()
    })
}

fn minus(a: &IntegerVector, b: &IntegerVector) -> IntegerVector {
    std::array::from_fn(|i| &a[i] - &b[i])
}

fn dot(a: &IntegerVector, b: &IntegerVector) -> BigInt {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

fn cross(a: &IntegerVector, b: &IntegerVector) -> IntegerVector {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        &a[j] * &b[k] - &a[k] * &b[j]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const UNIT: Triangle = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];

    pub(super) fn unscaled(ray: Ray) -> ExactRay {
        ExactRay {
            ray,
            corner_shift: 0,
        }
    }

    pub(super) fn point() -> impl Strategy<Value = Point> {
        [-1e3_f32..1e3, -1e3_f32..1e3, -1e3_f32..1e3]
    }

    #[test]
    fn double_precision_detects_only_clear_misses() {
        let misses = |x, y| {
            let line = unscaled(Ray::new([x, y, 0.0], [0.0, 0.0, 0.5]));
            certainly_misses(&line, &UNIT)
        };
        for (x, y) in [(-0.001, 0.5), (0.501, 0.5), (3.0, -1.0), (1e6, 0.1)] {
            assert!(misses(x, y), "{x} {y}");
        }
        for (x, y) in [(0.2, 0.2), (0.0, 0.5), (1.0, 0.0), (0.5, 0.5)] {
            assert!(!misses(x, y), "{x} {y}");
        }
    }

    #[test]
    fn shared_edges_are_crossed_once() {
        // Eight triangles around the centre of a square. Through each of five points, one vertical and two tilted rays
        // pass.
        let ring = [1.0, 1.0, 0.0, -1.0, -1.0, -1.0, 0.0, 1.0];
        let at = |i: usize| -> Point {
            let (x, y) = (ring[i % 8], ring[(i + 6) % 8]);
            [x, y, 0.5 * x * y]
        };
        let fan: Vec<Triangle> = (0..8).map(|i| [[0.0; 3], at(i), at(i + 1)]).collect();
        let mut closed = 0;
        for (x, y) in [(0.0, 0.0), (0.5, 0.0), (0.5, 0.5), (0.0, -0.25), (0.3, 0.1)] {
            for direction in [[0.0, 0.0, -1.0], [0.25, 0.0, -1.0], [-0.5, 0.25, -2.0]] {
                let height = 0.5 * x * y;
                let origin = [x - direction[0], y - direction[1], height - direction[2]];
                let line = unscaled(Ray::new(origin, direction));
                let moved = fan
                    .iter()
                    .filter(|t| line.intersect_perturbed(t).is_some())
                    .count();
                assert_eq!(moved, 1, "{x} {y} {direction:?}");
                closed += fan.iter().filter(|t| line.intersect(t).is_some()).count();
            }
        }
        assert!(closed > 30, "{closed}");
    }

    #[test]
    fn weights_are_exact_at_every_scale() {
        for e in [-140, -60, 0, 60, 120] {
            let s = 2.0_f64.powi(e) as f32;
            let corners = UNIT.map(|p| p.map(|x| x * s));
            let line = unscaled(Ray::new([0.25 * s, 0.5 * s, 0.0], [0.0, 0.0, -3.0]));
            assert_eq!(line.weights(&corners), [0.25, 0.5], "2^{e}");
            let turned = [corners[2], corners[0], corners[1]];
            assert_eq!(line.weights(&turned), [0.25, 0.25], "2^{e}");
        }
    }

    proptest! {
        #[test]
        fn certain_misses_are_exact_misses(
            corners in [point(), point(), point()], origin in point(), aim in 0..4_usize, w in 0.0_f32..1.0, e in -30_i32..30, far in 0_i32..40,
        ) {
            // Aimed at an edge, a vertex or just beyond, from near and far, so that the sign is hard to decide.
            let at: Point = std::array::from_fn(|i| corners[0][i] + [0.0, w, 1.0, -0.001][aim] * (corners[1][i] - corners[0][i]));
            let origin: Point = std::array::from_fn(|i| origin[i] * (far as f32).exp2());
            let direction: Point = std::array::from_fn(|i| (at[i] - origin[i]) * (e as f32).exp2());
            let line = unscaled(Ray::new(origin, direction));
            prop_assume!(line.ray.is_valid());
            let (direction, [a, b, c], _) = line.integers(&corners);
            let within = passes_within(&direction, [&a, &b, &c]);
            prop_assert!(!(within && certainly_misses(&line, &corners)));
        }
    }
}
