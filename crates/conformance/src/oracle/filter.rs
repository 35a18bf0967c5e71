//! One ray against one triangle in double precision, with proven bounds.
//!
//! The same determinants as in [`crate::oracle::exact`]. Every entry is an `f32` or the
//! difference of two (one rounding), each of the six products of a determinant
//! rounds twice, and up to three sums follow: at most 8 factors `1 + e`,
//! `|e| <= 2^-53`. So the error is below `8.01 * 2^-53` times the sum of the
//! products' magnitudes (the permanent), and `16 * 2^-53` times the *computed*
//! permanent covers it with room. Nothing overflows or underflows: entries are
//! zero or within `2^-149..2^129`, so products of three stay within `2^-447..2^387`.

use geom::{Ray, Triangle};
use glam::{DVec3, Vec3Swizzles};

const DETERMINANT: f64 = 16.0 * UNIT;
const UNIT: f64 = f64::EPSILON / 2.0;

/// What double precision can say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Verdict {
    /// Surely no hit.
    Miss,
    /// Perhaps a hit; if so, `t` lies in the span.
    Maybe(Span),
    /// Surely a hit, with `t` in the span.
    Hit(Span),
}

/// Holds an exact `t`, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// A number and how far it may be from the truth.
#[derive(Clone, Copy)]
struct Bounded {
    value: f64,
    error: f64,
}

/// What surely or perhaps holds for a valid ray and an active triangle.
pub(crate) fn judge(ray: &Ray, corners: &Triangle) -> Verdict {
    let wide = |p: [f32; 3]| DVec3::from(p.map(f64::from));
    let (o, d) = (wide(ray.origin), wide(ray.direction));
    let [a, b, c] = corners.map(|p| wide(p) - o);
    let weights = [
        determinant(d, b, c),
        determinant(d, c, a),
        determinant(d, a, b),
    ];
    let surely = |sign: f64| weights.map(|w| w.value * sign > w.error);
    let (plus, minus) = (surely(1.0), surely(-1.0));
    if plus.contains(&true) && minus.contains(&true) {
        return Verdict::Miss;
    }
    let span = quotient(determinant(a, b, c), sum(weights));
    let (t_min, t_max) = (f64::from(ray.t_min), f64::from(ray.t_max));
    if span.high <= t_min || span.low >= t_max {
        return Verdict::Miss;
    }
    let within = span.low > t_min && span.high < t_max;
    let inside = plus == [true; 3] || minus == [true; 3];
    if inside && within {
        Verdict::Hit(span)
    } else {
        Verdict::Maybe(span)
    }
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
fn quotient(n: Bounded, d: Bounded) -> Span {
    if d.value.abs() <= d.error {
        return Span {
            low: f64::NEG_INFINITY,
            high: f64::INFINITY,
        };
    }
    let numerator = if d.value < 0.0 { -n.value } else { n.value };
    let (least, most) = (d.value.abs() - d.error, d.value.abs() + d.error);
    let (low, high) = (numerator - n.error, numerator + n.error);
    let low = low / if low >= 0.0 { most } else { least };
    let high = high / if high >= 0.0 { least } else { most };
    // Three relative roundings a bound: 8 units cover them.
    Span {
        low: low - 8.0 * UNIT * low.abs(),
        high: high + 8.0 * UNIT * high.abs(),
    }
}
