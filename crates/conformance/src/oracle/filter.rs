//! One ray against one triangle in double precision, with proven bounds.
//!
//! The same determinants as in [`crate::oracle::exact`]. Every entry is an `f32` or the difference of two (one rounding), each
//! of the six products of a determinant rounds twice, and up to three sums follow: at most 8 factors `1 + e`, `|e| <= 2^-53`.
//! So the error is below `8.01 * 2^-53` times the sum of the products' magnitudes (the permanent), and `16 * 2^-53` times the
//! *computed* permanent covers it with room. Nothing overflows or underflows: entries are zero or within `2^-149..2^129`, so
//! products of three stay within `2^-447..2^387`.

use geom::{Ray, Triangle};
use glam::{DVec3, Vec3Swizzles};

const DETERMINANT: f64 = 16.0 * UNIT;
const UNIT: f64 = f64::EPSILON / 2.0;

/// A triangle that is not surely missed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    /// The exact `t`, if it is hit, lies in `low..=high`.
    pub(super) low: f64,
    pub(super) high: f64,
    /// Whether it is surely hit.
    pub(super) is_sure: bool,
}

/// A number and how far it may be from the truth.
#[derive(Clone, Copy)]
struct Bounded {
    value: f64,
    error: f64,
}

/// What a valid ray finds of an active triangle; `None` if it surely misses.
pub(super) fn judge(ray: &Ray, corners: &Triangle) -> Option<Candidate> {
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
    // What rounds to a float beyond a limit is beyond the limit itself. It surely is where `f32` rounds so.
    let is_sure = inside && (low as f32) > ray.t_min && (high as f32) < ray.t_max;
    (high > t_min && low < t_max).then_some(Candidate { low, high, is_sure })
}

fn determinant(a: DVec3, b: DVec3, c: DVec3) -> Bounded {
    let (p, q) = (b.yzx() * c.zxy(), b.zxy() * c.yzx());
    Bounded {
        value: a.dot(p - q),
        error: DETERMINANT * a.abs().dot(p.abs() + q.abs()),
    }
}

/// The two sums round by less than `2.01 * 2^-53` of the summands' magnitudes,
/// each of which is at most its permanent, `error / DETERMINANT`: an eighth of
/// the errors. Half covers it and the rounding of the bound itself.
fn sum(terms: [Bounded; 3]) -> Bounded {
    let [a, b, c] = terms;
    Bounded {
        value: a.value + b.value + c.value,
        error: 1.5 * (a.error + b.error + c.error),
    }
}

/// Everything `n / d` may be; every number if `d` may be zero.
fn quotient(n: Bounded, d: Bounded) -> [f64; 2] {
    if d.value.abs() <= d.error {
        return [f64::NEG_INFINITY, f64::INFINITY];
    }
    let numerator = if d.value < 0.0 { -n.value } else { n.value };
    let (least, most) = (d.value.abs() - d.error, d.value.abs() + d.error);
    let (low, high) = (numerator - n.error, numerator + n.error);
    let low = low / if low >= 0.0 { most } else { least };
    let high = high / if high >= 0.0 { least } else { most };
    // Three relative roundings a bound: 8 units cover them.
    let slack = |x: f64| 8.0 * UNIT * x.abs();
    [low - slack(low), high + slack(high)]
}
