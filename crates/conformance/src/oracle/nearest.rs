//! Rounding of exact numbers to the nearest `f32`, ties to even.

use num_rational::BigRational;
use num_traits::ToPrimitive;
use std::cmp::Ordering;

/// Returns the float nearest to `t`, where a zero is positive.
pub(super) fn nearest(t: &BigRational) -> f32 {
    let near = t.to_f64().expect("the denominator is not 0");
    let is_even = near.to_bits() & 1 == 0;
    // Rounding to `f64` and then to `f32` finds the nearest `f32` if the last bit of an inexact `f64` is odd (Boldo,
    // Melquiond 2008). An infinite `f64` stays infinite.
    let odd = match BigRational::from_float(near).map(|near| t.cmp(&near)) {
        Some(Ordering::Less) if is_even => near.next_down(),
        Some(Ordering::Greater) if is_even => near.next_up(),
        _ => near,
    };
    // Adding zero makes a negative zero positive.
    odd as f32 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_bigint::BigInt;

    /// Converts a float exactly. Infinity becomes the next power of two after the largest float.
    fn exact(x: f32) -> BigRational {
        let finite = f64::from(x).min(2_f64.powi(128));
        BigRational::from_float(finite).expect("the number is finite")
    }

    /// Returns the number `quarters` quarters of the way from one float to another.
    fn between(x: f32, y: f32, quarters: i32) -> BigRational {
        exact(x) + (exact(y) - exact(x)) * BigInt::from(quarters) / BigInt::from(4)
    }

    #[test]
    fn rounds_ties_to_even() {
        let least = f32::from_bits(1);
        let tiny = BigRational::from_float(f64::MIN_POSITIVE).expect("the number is finite");
        for x in [
            0.0,
            least,
            f32::MIN_POSITIVE,
            1.0,
            1.0_f32.next_up(),
            -1.5,
            f32::MAX,
        ] {
            let y = x.next_up();
            let even = if x.to_bits() & 1 == 0 { x } else { y };
            let rounded = [0, 1, 2, 3].map(|quarters| nearest(&between(x, y, quarters)));
            assert_eq!(rounded, [x, x, even, y], "{x:e}");
            // Two numbers below the midpoint, then two above. The nearest `f64` of the first is the midpoint. That of
            // the second is the midpoint's neighbour, whose last bit is odd.
            let middle = between(x, y, 2);
            let near = middle.to_f64().expect("the number is finite");
            let [below, above] = [near.next_down(), near.next_up()]
                .map(|side| BigRational::from_float(side).expect("the number is finite"));
            let sides = [
                &middle - &tiny,
                below + &tiny,
                &middle + &tiny,
                above - &tiny,
            ];
            assert_eq!(sides.map(|t| nearest(&t)), [x, x, y, y], "{x:e}");
        }
        assert_eq!(nearest(&between(0.0, -least, 1)).to_bits(), 0);
    }
}
