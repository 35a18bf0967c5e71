//! Rounding of exact numbers to the nearest `f32`, ties to even, by comparison with the midpoint between neighbours.

use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::ToPrimitive;
use std::cmp::Ordering;

/// Returns whether the float nearest to `t` is greater than `limit`.
pub(super) fn is_nearest_above(t: &BigRational, limit: f32) -> bool {
    limit < f32::INFINITY && rounds_to(t, [limit, limit.next_up()]) == limit.next_up()
}

/// Returns whether the float nearest to `t` is less than `limit`.
pub(super) fn is_nearest_below(t: &BigRational, limit: f32) -> bool {
    limit > f32::NEG_INFINITY && rounds_to(t, [limit.next_down(), limit]) == limit.next_down()
}

/// Returns the float nearest to `t`, where a zero is positive.
pub(super) fn nearest(t: &BigRational) -> f32 {
    // Rounding twice results in the nearest float or in one of its neighbours.
    let near = t.to_f64().map_or(f32::INFINITY, |t| t as f32);
    let upper = if is_nearest_above(t, near) {
        near.next_up()
    } else {
        near
    };
    let lower = upper.next_down();
    let is_lower = lower > f32::NEG_INFINITY && !is_nearest_above(t, lower);
    // Adding zero makes a negative zero positive.
    (if is_lower { lower } else { upper }) + 0.0
}

/// Returns the first of two neighbours if `t` rounds to it or below, else the second.
fn rounds_to(t: &BigRational, [below, above]: [f32; 2]) -> f32 {
    let is_even = |x: f32| x.to_bits() & 1 == 0;
    match t.cmp(&((exact(below) + exact(above)) / BigInt::from(2))) {
        Ordering::Less => below,
        Ordering::Equal if is_even(below) => below,
        Ordering::Equal | Ordering::Greater => above,
    }
}

/// Converts a float exactly. Infinity becomes the next power of two after the largest float.
fn exact(x: f32) -> BigRational {
    let next = BigRational::from_integer(BigInt::from(1) << 128_u32);
    let of_infinite = if x > 0.0 { next } else { -next };
    BigRational::from_float(x).unwrap_or(of_infinite)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the number `quarters` quarters of the way from one float to another.
    fn between(x: f32, y: f32, quarters: i32) -> BigRational {
        exact(x) + (exact(y) - exact(x)) * BigInt::from(quarters) / BigInt::from(4)
    }

    #[test]
    fn rounds_ties_to_even() {
        let least = f32::from_bits(1);
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
        }
        assert_eq!(nearest(&between(0.0, -least, 1)).to_bits(), 0);
    }

    #[test]
    fn limits_exclude_values_rounding_to_them() {
        let [x, y, z] = [1.0_f32.next_down(), 1.0, 1.0_f32.next_up()];
        for (t, above, below) in [
            (between(x, y, 1), false, true),
            (between(x, y, 2), false, false),
            (between(y, z, 2), false, false),
            (between(y, z, 3), true, false),
        ] {
            assert_eq!(
                (is_nearest_above(&t, y), is_nearest_below(&t, y)),
                (above, below),
                "{t}"
            );
        }
        let most = between(f32::MAX, f32::INFINITY, 1);
        assert!(
            is_nearest_below(&most, f32::INFINITY) && is_nearest_above(&most, f32::NEG_INFINITY)
        );
        let beyond = between(f32::MAX, f32::INFINITY, 2);
        assert!(!is_nearest_below(&beyond, f32::INFINITY));
    }
}
