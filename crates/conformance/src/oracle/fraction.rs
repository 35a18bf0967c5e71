//! An exact quotient: compared by cross-multiplying, rounded once.

use crate::oracle::integers::decode;
use num_bigint::{BigInt, BigUint, Sign};
use num_traits::{ToPrimitive, Zero};
use std::cmp::Ordering;

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

    fn fraction(n: i64, d: i64) -> Fraction {
        Fraction::new(n.into(), d.into(), 0)
    }

    #[test]
    fn signs_move_to_the_top() {
        assert_eq!(fraction(1, -3), fraction(-2, 6));
        assert!(fraction(-1, 3) < fraction(1, 1000));
        assert_eq!(fraction(3, 4).cmp_f32(0.75), Ordering::Equal);
        assert_eq!(
            fraction(-3, 4).cmp_f32(f32::NEG_INFINITY),
            Ordering::Greater
        );
        assert_eq!(fraction(0, 4).cmp_f32(0.0), Ordering::Equal);
        assert_eq!(fraction(1, 3).cmp_f32(1.0 / 3.0), Ordering::Less);
    }

    #[test]
    fn halfway_goes_to_even_and_a_hair_beyond_goes_up() {
        let half = (1_i64 << 53) + 1;
        assert_eq!(fraction(half, 1).to_f64(), (1_i64 << 53) as f64);
        let beyond = Fraction::new(
            (BigInt::from(half) << 200_u32) + 1,
            BigInt::from(1) << 200_u32,
            0,
        );
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
