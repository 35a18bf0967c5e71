//! Floats to whole numbers: every finite `f32` is `m * 2^e`.

use num_bigint::BigInt;

/// `m` and `e` with `x = m * 2^e` and `m` odd, or `(0, i32::MAX)` for zero.
///
/// # Panics
/// If `x` is not finite.
pub(crate) fn decode(x: f32) -> (i64, i32) {
    assert!(
        x.is_finite(),
        "only finite numbers are whole multiples of a power of two"
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_float_is_taken_apart_and_put_together() {
        for x in [
            1.0,
            -1.5,
            0.1,
            f32::MAX,
            f32::MIN_POSITIVE,
            f32::from_bits(1),
            -3e-42,
        ] {
            let (m, e) = decode(x);
            assert!(m % 2 != 0, "{x}");
            assert_eq!(m as f64 * f64::from(e).exp2(), f64::from(x));
        }
        assert_eq!(decode(-0.0).0, 0);
    }

    #[test]
    fn a_common_scale_keeps_the_ratios() {
        let (xs, e) = scale([0.5, -3.0, 0.0, 1e-45]);
        assert_eq!(e, -149);
        assert_eq!(xs[3], BigInt::from(1));
        assert_eq!(xs[0], BigInt::from(1) << 148);
        assert_eq!(xs[1], BigInt::from(-6) << 148);
        assert_eq!(scale([0.0; 2]), ([BigInt::ZERO, BigInt::ZERO], 0));
    }
}
