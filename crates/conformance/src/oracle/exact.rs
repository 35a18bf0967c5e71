//! One ray against one triangle in integers: every finite `f32` is `m * 2^e`.

use geom::{Ray, Triangle};
use num_bigint::{BigInt, BigUint, Sign};
use num_traits::{ToPrimitive, Zero};
use std::cmp::Ordering;

/// Where a ray's line crosses a closed triangle, inside the ray's interval.
#[derive(Clone, Debug)]
pub(crate) struct Crossing {
    /// Exact distance in units of the direction.
    pub(crate) t: Fraction,
    /// Whether the crossing lies on an edge or a vertex.
    pub(crate) edge: bool,
}

type Vector = [BigInt; 3];

/// The crossing of a valid ray with an active triangle, if there is one.
///
/// With `A`, `B`, `C` from the origin to the corners and `|x y z|` a
/// determinant, the corners have the weights `U = |d B C|`, `V = |d C A|`, `W = |d A B|`,
/// and `t = |A B C| / (U + V + W)`. The divisor is `d . N`: zero for a
/// ray in the plane and for a triangle without area.
pub(crate) fn cross(ray: &Ray, [a, b, c]: &Triangle) -> Option<Crossing> {
    let o = &ray.origin;
    let flat: [f32; 12] = std::array::from_fn(|i| [a, b, c, o][i / 3][i % 3]);
    let (xs, point_exponent) = scale(flat);
    let (d, direction_exponent) = scale(ray.direction);
    let corner = |k: usize| -> Vector { std::array::from_fn(|i| &xs[3 * k + i] - &xs[9 + i]) };
    let [a, b, c] = [corner(0), corner(1), corner(2)];
    let b_c = cross_product(&b, &c);
    let weights = [
        dot(&d, &b_c),
        dot(&d, &cross_product(&c, &a)),
        dot(&d, &cross_product(&a, &b)),
    ];
    let has = |sign: Sign| weights.iter().any(|w| w.sign() == sign);
    if has(Sign::Plus) == has(Sign::Minus) {
        return None;
    }
    let edge = has(Sign::NoSign);
    let divisor: BigInt = weights.into_iter().sum();
    let t = Fraction::new(dot(&a, &b_c), divisor, point_exponent - direction_exponent);
    let inside =
        t.cmp_f32(ray.t_min) == Ordering::Greater && t.cmp_f32(ray.t_max) == Ordering::Less;
    inside.then_some(Crossing { t, edge })
}

fn cross_product(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        &a[j] * &b[k] - &a[k] * &b[j]
    })
}

fn dot(a: &Vector, b: &Vector) -> BigInt {
    (0..3).map(|i| &a[i] * &b[i]).sum()
}

/// `m` and `e` with `x = m * 2^e` and `m` odd, or `(0, i32::MAX)` for zero.
///
/// # Panics
/// If `x` is not finite.
pub(crate) fn decode(x: f32) -> (i64, i32) {
    assert!(
        x.is_finite(),
        "only finite numbers are multiples of a power of two"
    );
    let bits = x.to_bits();
    let field = (bits >> 23) & 0xff;
    let fraction = i64::from(bits & 0x7f_ffff);
    let (mantissa, exponent) = match field {
        0 => (fraction, -149),
        _ => (fraction | 0x80_0000, field as i32 - 150),
    };
    if mantissa == 0 {
        return (0, i32::MAX);
    }
    let zeros = mantissa.trailing_zeros();
    let odd = mantissa >> zeros;
    let signed = if x.is_sign_negative() { -odd } else { odd };
    (signed, exponent + zeros as i32)
}

/// All of `xs` as multiples of `2^e`, with the greatest such `e` (0 if all are zero).
pub(crate) fn scale<const N: usize>(xs: [f32; N]) -> ([BigInt; N], i32) {
    let parts = xs.map(decode);
    let least = parts.iter().map(|p| p.1).min().unwrap_or(i32::MAX);
    if least == i32::MAX {
        return (std::array::from_fn(|_| BigInt::ZERO), 0);
    }
    let shifted = parts.map(|(m, e)| match m {
        0 => BigInt::ZERO,
        _ => BigInt::from(m) << (e - least) as u32,
    });
    (shifted, least)
}

/// `numerator / denominator` with a positive denominator; not reduced.
#[derive(Clone, Debug)]
pub(crate) struct Fraction {
    numerator: BigInt,
    denominator: BigInt,
}

impl Fraction {
    /// `(n / d) * 2^e`; `d` must not be zero.
    pub(crate) fn new(n: BigInt, d: BigInt, e: i32) -> Self {
        assert!(!d.is_zero(), "a fraction has a denominator");
        let (n, d) = if d.sign() == Sign::Minus {
            (-n, -d)
        } else {
            (n, d)
        };
        let shift = e.unsigned_abs();
        match e >= 0 {
            true => Self {
                numerator: n << shift,
                denominator: d,
            },
            false => Self {
                numerator: n,
                denominator: d << shift,
            },
        }
    }

    /// How it compares with a float, which may be infinite but not NaN.
    pub(crate) fn cmp_f32(&self, x: f32) -> Ordering {
        if x.is_infinite() {
            return if x > 0.0 {
                Ordering::Less
            } else {
                Ordering::Greater
            };
        }
        let (m, e) = decode(x);
        let e = if m == 0 { 0 } else { e };
        self.cmp(&Self::new(m.into(), 1.into(), e))
    }

    /// The nearest `f64`, ties to even. `|self|` must be 0 or within `2^-900..2^900`,
    /// as every exact `t` of `f32` input is.
    pub(crate) fn to_f64(&self) -> f64 {
        let n = self.numerator.magnitude();
        if n.is_zero() {
            return 0.0;
        }
        let d = self.denominator.magnitude();
        // A quotient of 64 to 66 bits, and one bit below that says whether
        // there is a rest: enough for one correct rounding to 53.
        let shift = 65 - (n.bits() as i64 - d.bits() as i64);
        let (n, d) = match shift >= 0 {
            true => (n << shift as u64, d.clone()),
            false => (n.clone(), d << (-shift) as u64),
        };
        let quotient: BigUint = &n / &d;
        let rest = u128::from(&quotient * &d != n);
        let bits = (quotient.to_u128().unwrap_or(u128::MAX) << 1) | rest;
        let magnitude = bits as f64 * (-(shift + 1) as f64).exp2();
        if self.numerator.sign() == Sign::Minus {
            -magnitude
        } else {
            magnitude
        }
    }
}

impl Ord for Fraction {
    fn cmp(&self, other: &Self) -> Ordering {
        (&self.numerator * &other.denominator).cmp(&(&other.numerator * &self.denominator))
    }
}

impl PartialOrd for Fraction {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Fraction {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Fraction {}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_kind_of_float_is_taken_apart_and_put_together() {
        let least = f32::from_bits(1);
        for x in [1.0, -1.5, 0.1, f32::MAX, f32::MIN_POSITIVE, least, -3e-42] {
            let (m, e) = decode(x);
            assert!(m % 2 != 0, "{x}");
            assert_eq!(m as f64 * f64::from(e).exp2(), f64::from(x));
        }
        assert_eq!(decode(-0.0).0, 0);
    }

    fn fraction(n: i64, d: i64) -> Fraction {
        Fraction::new(n.into(), d.into(), 0)
    }

    #[test]
    fn halfway_goes_to_even_and_a_hair_beyond_goes_up() {
        let half = (1_i64 << 53) + 1;
        assert_eq!(fraction(half, 1).to_f64(), (1_i64 << 53) as f64);
        let [top, bottom] = [half, 1].map(|x| BigInt::from(x) << 200_u32);
        let beyond = Fraction::new(top + 1, bottom, 0);
        assert_eq!(beyond.to_f64(), ((1_i64 << 53) + 2) as f64);
    }

    proptest! {
        #[test]
        fn a_quotient_of_small_integers_rounds_as_the_processor_does(
            n in -(1_i64 << 53)..1_i64 << 53, d in 1_i64..1 << 53, e in -400..400_i32,
        ) {
            let scaled = Fraction::new(n.into(), d.into(), e).to_f64();
            prop_assert_eq!(scaled, n as f64 / d as f64 * f64::from(e).exp2());
        }
    }
}
