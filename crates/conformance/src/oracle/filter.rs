//! Intersection of one ray and one triangle in double precision, with proven bounds.
//!
//! Uses the same determinants as [`crate::oracle::exact`]. Every entry is an `f32` or the difference of two, which
//! rounds once. Each of the six products of a determinant rounds twice, and up to three sums follow: at most 8 factors
//! `1 + e`, `|e| <= 2^-53`. So the error is below `8.01 * 2^-53` times the sum of the products' magnitudes (the
//! permanent). `16 * 2^-53` times the *computed* permanent exceeds it. Nothing overflows or underflows: entries are
//! zero or within `2^-149..2^129`, so products of three are within `2^-447..2^387`.

use geom::{Ray, Triangle};
use glam::{DVec3, Vec3Swizzles};

const DETERMINANT_ERROR: f64 = 16.0 * UNIT;
const UNIT: f64 = f64::EPSILON / 2.0;

/// Bounds of a possible hit.
#[derive(Clone, Copy, Debug)]
pub(super) struct HitBounds {
    /// If the triangle is hit, the exact `t` is in `low..=high`.
    pub(super) low: f64,
    pub(super) high: f64,
    /// True if the triangle is certainly hit.
    pub(super) is_sure: bool,
}

/// A number and a bound of its absolute error.
#[derive(Clone, Copy)]
struct Bounded {
    value: f64,
    error: f64,
}

/// Tests a valid ray and an active triangle. Returns `None` if the ray certainly misses.
pub(super) fn bound_hit(ray: &Ray, corners: &Triangle) -> Option<HitBounds> {
    let wide = |p: [f32; 3]| DVec3::from(p.map(f64::from));
    let (o, d) = (wide(ray.origin), wide(ray.direction));
    let [a, b, c] = corners.map(|p| wide(p) - o);
    let weights = [(b, c), (c, a), (a, b)].map(|(p, q)| determinant(d, p, q));
    let surely = |sign: f64| weights.map(|w| w.value * sign > w.error);
    let (plus, minus) = (surely(1.0), surely(-1.0));
    if plus.contains(&true) && minus.contains(&true) {
        return None;
    }
    let [low, high] = quotient(determinant(a, b, c), sum(weights));
    let (t_min, t_max) = (f64::from(ray.t_min), f64::from(ray.t_max));
    let inside = plus == [true; 3] || minus == [true; 3];
    // Rounding is monotonic. So the float nearest to the exact `t` is between those nearest to `low` and `high`.
    let is_sure = inside && (low as f32) > ray.t_min && (high as f32) < ray.t_max;
    (high > t_min && low < t_max).then_some(HitBounds { low, high, is_sure })
}

fn determinant(a: DVec3, b: DVec3, c: DVec3) -> Bounded {
    let (p, q) = (b.yzx() * c.zxy(), b.zxy() * c.yzx());
    Bounded {
        value: a.dot(p - q),
        error: DETERMINANT_ERROR * a.abs().dot(p.abs() + q.abs()),
    }
}

/// Adds three numbers.
///
/// The rounding error of the two additions is below `2.01 * 2^-53` times the sum of the terms' magnitudes. Each
/// magnitude is at most its permanent, `error / DETERMINANT_ERROR`. So the rounding error is about an eighth of the sum
/// of the errors. The factor 1.5 covers it, and the rounding of the bound itself.
fn sum(terms: [Bounded; 3]) -> Bounded {
    let [a, b, c] = terms;
    Bounded {
        value: a.value + b.value + c.value,
        error: 1.5 * (a.error + b.error + c.error),
    }
}

/// Returns the range of `n / d`, which is unbounded if `d` may be zero.
fn quotient(n: Bounded, d: Bounded) -> [f64; 2] {
    if d.value.abs() <= d.error {
        return [f64::NEG_INFINITY, f64::INFINITY];
    }
    let numerator = if d.value < 0.0 { -n.value } else { n.value };
    let (least, most) = (d.value.abs() - d.error, d.value.abs() + d.error);
    let (low, high) = (numerator - n.error, numerator + n.error);
    let low = low / if low >= 0.0 { most } else { least };
    let high = high / if high >= 0.0 { least } else { most };
    // Numerator, divisor and quotient of each bound round once, which changes it by less than `4 * UNIT` of its value.
    // The factor 8 also covers the roundings below.
    let slack = |x: f64| 8.0 * UNIT * x.abs();
    [low - slack(low), high + slack(high)]
}
