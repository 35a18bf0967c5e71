//! One ray against one triangle in whole numbers.

use crate::oracle::fraction::Fraction;
use crate::oracle::integers::scale;
use geom::{Ray, Triangle};
use num_bigint::{BigInt, Sign};
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
