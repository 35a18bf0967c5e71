//! Floats as whole numbers of a common unit, and vectors of such.

use geom::Point;
use num_bigint::BigInt;
use num_traits::Float;

/// A vector of integers.
pub(crate) type Vector = [BigInt; 3];

/// `x = m * 2^e`; `None` for zero.
fn parts(x: f32) -> Option<(i32, i32)> {
    let (m, e, sign) = x.integer_decode();
    (m > 0).then(|| (i32::from(sign) * m as i32, e.into()))
}

/// The exponent of the largest unit that every one of `points` is made of, as their floats write it.
pub(crate) fn unit(points: &[Point]) -> i32 {
    let exponents = points.iter().flatten().filter_map(|&x| parts(x));
    exponents.map(|(_, e)| e).min().unwrap_or(0)
}

/// A point in units of `2^unit`, which must be at most [`unit`] of it.
pub(crate) fn whole(point: Point, unit: i32) -> Vector {
    point.map(|x| match parts(x) {
        None => BigInt::ZERO,
        Some((m, e)) => BigInt::from(m) << (e - unit).unsigned_abs(),
    })
}

pub(crate) fn minus(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|i| &a[i] - &b[i])
}

pub(crate) fn dot(a: &Vector, b: &Vector) -> BigInt {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

pub(crate) fn cross(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        &a[j] * &b[k] - &a[k] * &b[j]
    })
}
