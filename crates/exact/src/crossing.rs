//! One line, one triangle; and the order of crossings along the line.

use crate::integers::{Vector, cross, dot, minus, unit, whole};
use geom::{Ray, Triangle};
use num_bigint::{BigInt, BigUint, Sign};
use num_traits::ToPrimitive;
use std::cmp::Ordering;

/// A ray asked of triangles that are scaled by a power of two.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// The ray.
    pub ray: Ray,
    /// Corners are multiplied by `2^-this`, exactly, before the ray is asked.
    pub shift: i32,
}

/// Where a line passes through a triangle: `t = n / d * 2^e`, exactly.
#[derive(Clone, Debug)]
pub struct Crossing {
    n: BigInt,
    /// Positive.
    d: BigInt,
    e: i32,
}

impl Line {
    /// Where the line meets the closed triangle, at any `t` of the ray's open
    /// interval; `None` if nowhere, or if it lies in the triangle's plane.
    ///
    /// The ray must be [valid](Ray::is_valid) and the corners finite.
    #[must_use]
    pub fn meet(&self, corners: &Triangle) -> Option<Crossing> {
        if surely_misses(self, corners) {
            return None;
        }
        let direction_unit = unit(&[self.ray.direction]);
        let direction = whole(self.ray.direction, direction_unit);
        let position_unit = unit(corners).min(unit(&[self.ray.origin]) + self.shift);
        let origin = whole(self.ray.origin, position_unit - self.shift);
        let [a, b, c] = corners.map(|p| minus(&whole(p, position_unit), &origin));
        if !passes_within(&direction, [&a, &b, &c]) {
            return None;
        }
        let normal = cross(&minus(&b, &a), &minus(&c, &a));
        let (mut n, mut d) = (dot(&a, &normal), dot(&direction, &normal));
        match d.sign() {
            Sign::NoSign => return None,
            Sign::Minus => (n, d) = (-n, -d),
            Sign::Plus => {}
        }
        let e = position_unit - self.shift - direction_unit;
        let crossing = Crossing { n, d, e };
        let (t_min, t_max) = (self.ray.t_min, self.ray.t_max);
        let ahead = t_min == f32::NEG_INFINITY || crossing.order(&Crossing::at(t_min)).is_gt();
        let before = t_max == f32::INFINITY || crossing.order(&Crossing::at(t_max)).is_lt();
        (ahead && before).then_some(crossing)
    }
}

/// Whether double precision already shows that the line passes by the triangle.
///
/// Differences of floats carry one rounding, and each of the six products that
/// an edge's side is a sum of carries at most eight more: `16 * 2^-53` of their
/// sizes bounds them all. Nothing overflows or underflows: three factors of
/// `f32`'s range are far within that of `f64`.
fn surely_misses(line: &Line, corners: &Triangle) -> bool {
    let scale = f64::from(-line.shift).exp2();
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

/// Whether the line from zero along `direction` passes through the closed triangle.
fn passes_within(direction: &Vector, [a, b, c]: [&Vector; 3]) -> bool {
    let side = |p: &Vector, q: &Vector| dot(direction, &cross(p, q)).sign();
    let sides = [side(c, b), side(a, c), side(b, a)];
    !(sides.contains(&Sign::Plus) && sides.contains(&Sign::Minus))
}

impl Crossing {
    /// A given finite `t`.
    fn at(t: f32) -> Self {
        let e = unit(&[[t; 3]]);
        let [n, ..] = whole([t; 3], e);
        Self {
            n,
            d: BigInt::from(1),
            e,
        }
    }

    /// `t`, rounded once; infinite where it is too large.
    #[must_use]
    pub fn t(&self) -> f32 {
        let up = 32 + self.d.bits() as i64 - self.n.bits() as i64;
        let down = up.min(0).unsigned_abs();
        let (n, d) = (&self.n << up.max(0).unsigned_abs(), &self.d << down);
        // 32 or 33 bits, the last of them set for all that fell off, so that it is the float that rounds.
        let quotient = n.magnitude() / d.magnitude();
        let rest = quotient.clone() * d.magnitude() != *n.magnitude();
        let size = (quotient | BigUint::from(u8::from(rest))).to_f64();
        let bits = size.unwrap_or(f64::INFINITY);
        let bits = if self.n.sign() == Sign::Minus {
            -bits
        } else {
            bits
        };
        let e = i64::from(self.e) - up;
        let half = e / 2;
        (bits * (half as f64).exp2() * ((e - half) as f64).exp2()) as f32
    }

    /// The order along the line of two crossings of it.
    #[must_use]
    pub fn order(&self, other: &Self) -> Ordering {
        let (left, right) = (&self.n * &other.d, &other.n * &self.d);
        let up = (self.e - other.e).unsigned_abs();
        if self.e >= other.e {
            (left << up).cmp(&right)
        } else {
            left.cmp(&(right << up))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geom::Point;
    use proptest::prelude::*;

    const UNIT: Triangle = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];

    fn t_of(c: &Crossing) -> f64 {
        let t = c.n.to_f64().unwrap() / c.d.to_f64().unwrap() * f64::from(c.e).exp2();
        assert!(
            (t - f64::from(c.t())).abs() <= 1e-7 * t.abs(),
            "{t} {}",
            c.t()
        );
        t
    }

    fn meet(ray: Ray) -> Option<f64> {
        let line = Line { ray, shift: 0 };
        line.meet(&UNIT).as_ref().map(t_of)
    }

    #[test]
    fn triangles_are_closed_and_planes_are_missed() {
        let up = |x, y| Ray::new([x, y, 0.0], [0.0, 0.0, 0.5]);
        for (x, y) in [(0.0, 0.0), (0.5, 0.5), (1.0, 0.0), (0.0, 0.3)] {
            assert_eq!(meet(up(x, y)), Some(2.0));
        }
        let beyond = f32::from_bits(0.5_f32.to_bits() + 1);
        assert_eq!(meet(up(0.5, beyond)), None);
        assert_eq!(meet(up(-f32::from_bits(1), 0.5)), None);
        assert_eq!(meet(Ray::new([-1.0, 0.1, 1.0], [1.0, 0.0, 0.0])), None);
    }

    #[test]
    fn double_precision_tells_clear_misses_alone() {
        let misses = |x, y| {
            let ray = Ray::new([x, y, 0.0], [0.0, 0.0, 0.5]);
            surely_misses(&Line { ray, shift: 0 }, &UNIT)
        };
        for (x, y) in [(-0.001, 0.5), (0.501, 0.5), (3.0, -1.0), (1e6, 0.1)] {
            assert!(misses(x, y), "{x} {y}");
        }
        for (x, y) in [(0.2, 0.2), (0.0, 0.5), (1.0, 0.0), (0.5, 0.5)] {
            assert!(!misses(x, y), "{x} {y}");
        }
    }

    #[test]
    fn the_interval_is_open() {
        let within = |t_min, t_max| {
            let ray = Ray::new([0.1, 0.1, 0.0], [0.0, 0.0, 1.0]);
            meet(Ray {
                t_min,
                t_max,
                ..ray
            })
        };
        let (below, above) = (1.0_f32.next_down(), 1.0_f32.next_up());
        assert_eq!(within(below, above), Some(1.0));
        assert_eq!(within(1.0, above), None);
        assert_eq!(within(below, 1.0), None);
        assert_eq!(within(f32::NEG_INFINITY, f32::INFINITY), Some(1.0));
    }

    #[test]
    fn a_shift_scales_the_corners() {
        let ray = Ray::new([0.1, 0.1, 0.0], [0.0, 0.0, 1.0]);
        for shift in [-149, -3, 0, 2, 120] {
            let line = Line { ray, shift };
            let big = UNIT.map(|p| p.map(|x| (f64::from(x) * f64::from(shift).exp2()) as f32));
            let found = line.meet(&big).map(|c| t_of(&c));
            // At 2^-149 the corners are the least numbers there are.
            assert_eq!(found, Some(1.0), "{shift}");
        }
    }

    fn point() -> impl Strategy<Value = Point> {
        [-1e3_f32..1e3, -1e3_f32..1e3, -1e3_f32..1e3]
    }

    proptest! {
        #[test]
        fn what_is_surely_missed_is_missed(
            corners in [point(), point(), point()], origin in point(), aim in 0..4_usize, w in 0.0_f32..1.0, e in -30_i32..30, far in 0_i32..40,
        ) {
            // Aimed at an edge or a vertex, so that the sign is in doubt, from near and far.
            let at: Point = std::array::from_fn(|i| corners[0][i] + [0.0, w, 1.0, -0.001][aim] * (corners[1][i] - corners[0][i]));
            let origin: Point = std::array::from_fn(|i| origin[i] * (far as f32).exp2());
            let direction: Point = std::array::from_fn(|i| (at[i] - origin[i]) * (e as f32).exp2());
            let line = Line { ray: Ray::new(origin, direction), shift: 0 };
            prop_assume!(line.ray.is_valid());
            let unit = unit(&corners).min(super::unit(&[origin]));
            let zero = whole(origin, unit);
            let [a, b, c] = corners.map(|p| minus(&whole(p, unit), &zero));
            let within = passes_within(&whole(direction, super::unit(&[direction])), [&a, &b, &c]);
            prop_assert!(!(within && surely_misses(&line, &corners)));
        }

        #[test]
        fn crossings_are_where_double_precision_has_them(
            corners in [point(), point(), point()], origin in point(), w in [0.05_f64..1.0, 0.05..1.0, 0.05..1.0],
        ) {
            let sum: f64 = w.iter().sum();
            let aim: [f64; 3] = std::array::from_fn(|i| (0..3).map(|k| w[k] / sum * f64::from(corners[k][i])).sum());
            let direction: Point = std::array::from_fn(|i| (aim[i] - f64::from(origin[i])) as f32);
            let ray = Ray::new(origin, direction);
            prop_assume!(ray.is_valid());
            let e = |k: usize| -> [f64; 3] { std::array::from_fn(|i| f64::from(corners[k][i]) - f64::from(corners[0][i])) };
            let (e1, e2) = (e(1), e(2));
            let normal: [f64; 3] = std::array::from_fn(|i| e1[(i + 1) % 3] * e2[(i + 2) % 3] - e1[(i + 2) % 3] * e2[(i + 1) % 3]);
            let slope: f64 = (0..3).map(|i| normal[i] * f64::from(direction[i])).sum();
            let size = normal.iter().map(|x| x * x).sum::<f64>().sqrt() * direction.map(f64::from).iter().map(|x| x * x).sum::<f64>().sqrt();
            prop_assume!(slope.abs() > 1e-3 * size);
            let found = Line { ray, shift: 0 }.meet(&corners).map(|c| t_of(&c));
            prop_assert!(found.is_some_and(|t| (t - 1.0).abs() < 1e-3), "{found:?}");
        }
    }
}
