//! Distances and weights in double precision. Error bounds prove that they round like the exact values.

use super::{ExactRay, RoundedHit};
use crate::{Point, Triangle};

/// A number and a bound of its absolute error.
#[derive(Clone, Copy)]
struct WithError {
    value: f64,
    error: f64,
}

/// Relative bound of a few roundings: eight units of `2^-53`.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

impl ExactRay {
    /// Returns the distance and the weights at the intersection, each rounded once. The line must
    /// [intersect](Self::intersect) the triangle.
    ///
    /// Returns `None` if the error bounds of double precision allow several results. Use [`Self::rounded`] then.
    pub fn try_rounded(&self, corners: &Triangle) -> Option<RoundedHit> {
        // Corners are sheared along the direction's largest component, as in the watertight test but without a
        // division: `x * dz - dx * z`. Sheared coordinates of a triangle near the ray are small. So the errors of edge
        // functions grow with the distance times the triangle's size, not with the squared distance.
        //
        // `corner_shift` is a scale exponent or a difference of two, so `2^-corner_shift` is a normal number.
        let scale = f64::from_bits(((1023 - self.corner_shift) as u64) << 52);
        let axes = axes_along(self.ray.direction);
        let direction = axes.map(|k| f64::from(self.ray.direction[k]));
        let origin = axes.map(|k| f64::from(self.ray.origin[k]));
        let relative = corners.map(|corner| {
            let at = |i: usize| f64::from(corner[axes[i]]) * scale - origin[i];
            [at(0), at(1), at(2)]
        });
        let [a, b, c] = relative.map(|p| [0, 1].map(|i| sheared(p, direction, i)));
        let [u, v, w] = [edge(c, b), edge(a, c), edge(b, a)];
        let sum = WithError {
            value: u.value + v.value + w.value,
            error: 2.0 * (u.error + v.error + w.error),
        };
        let depth = |i: usize| relative[i][2];
        let deepest = depth(0).abs().max(depth(1).abs()).max(depth(2).abs());
        let numerator = WithError {
            value: u.value * depth(0) + v.value * depth(1) + w.value * depth(2),
            error: sum.error * deepest,
        };
        let denominator = WithError {
            value: sum.value * direction[2],
            error: sum.error * direction[2].abs(),
        };
        Some(RoundedHit {
            t: quotient(numerator, denominator)?,
            u: quotient(v, sum)?,
            v: quotient(w, sum)?,
        })
    }
}

/// Returns the three axes, the axis of the largest component last.
fn axes_along(direction: Point) -> [usize; 3] {
    let [x, y, z] = direction.map(f32::abs);
    if x >= y && x >= z {
        [1, 2, 0]
    } else if y >= z {
        [2, 0, 1]
    } else {
        [0, 1, 2]
    }
}

/// Returns `x * dz - dx * z` of a corner relative to the origin. The error bound includes the roundings of the corner.
fn sheared(p: [f64; 3], direction: [f64; 3], i: usize) -> WithError {
    let (x, z) = (p[i] * direction[2], direction[i] * p[2]);
    WithError {
        value: x - z,
        error: 0.5 * ROUNDING * (x.abs() + z.abs()),
    }
}

/// Returns the edge function `px * qy - py * qx`. Its error includes 16 units of `2^-53`, which suffice for the roundings
/// of this function and of the sums and products that follow.
fn edge(p: [WithError; 2], q: [WithError; 2]) -> WithError {
    let product = |a: WithError, b: WithError| WithError {
        value: a.value * b.value,
        error: a.error * b.value.abs() + a.value.abs() * b.error + a.error * b.error,
    };
    let (l, r) = (product(p[0], q[1]), product(p[1], q[0]));
    WithError {
        value: l.value - r.value,
        error: 1.01 * (l.error + r.error) + 2.0 * ROUNDING * (l.value.abs() + r.value.abs()),
    }
}

/// Returns the float to which all possible quotients round, or `None` if there are several.
fn quotient(n: WithError, d: WithError) -> Option<f32> {
    let q = n.value / d.value;
    let least = d.value.abs() - d.error;
    let error = (n.error + q.abs() * d.error) / least * 1.01 + ROUNDING * q.abs();
    let (low, high) = ((q - error) as f32, (q + error) as f32);
    // Also false if a value is NaN.
    (least > 0.0 && low == high).then_some(low + 0.0)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{point, unscaled};
    use super::*;
    use crate::Ray;
    use proptest::prelude::*;

    #[test]
    fn edge_on_triangle_reports_exact_distance() {
        let corners = [
            [0.002, -0.004, -0.003],
            [-0.002, 0.0, 0.003],
            [0.002, -0.004, 0.0],
        ];
        let ray = Ray::new([0.004, -0.006, -0.006], [-0.0050000004, 0.005, 0.01]);
        let line = unscaled(ray);
        let hit = line.rounded(&corners).unwrap();
        // In single precision, `t` is 0.3, and clamping to the own box yields 0.39999816.
        assert_eq!(hit.t, 0.5);
        let fast = line.try_rounded(&corners);
        assert!(fast.is_none_or(|fast| fast == hit), "{fast:?}");
    }

    #[test]
    fn double_precision_rounds_most_hits() {
        let corners = [[0.1, 0.2, 1.0], [1.3, 0.1, 1.2], [0.2, 1.7, 0.9]];
        let random = |i: u32| (i as f32 * 0.618).fract() - 0.5;
        let count = (0..1000).filter(|&i| {
            let line = unscaled(Ray::new(
                [random(i), random(3 * i + 1), -7.0],
                [0.1 * random(7 * i), 0.05, 1.1],
            ));
            line.rounded(&corners).is_none() || line.try_rounded(&corners).is_some()
        });
        assert!(count.count() > 990);
    }

    proptest! {
        #[test]
        fn certain_rounding_matches_exact_rounding(
            corners in [point(), point(), point()], from in point(), weights in [0.0_f32..1.0, 0.0_f32..1.0],
            thin in 0_i32..20, far in -10_i32..40, size in -60_i32..60, e in -60_i32..60, shift in -3_i32..4,
        ) {
            // Triangles of any shape and size, seen from near and far.
            let [a, b, c] = corners;
            let c = std::array::from_fn(|i| a[i] + (c[i] - a[i]) * (-thin as f32).exp2());
            let corners = [a, b, c].map(|p| p.map(|x| x * (size as f32).exp2()));
            let [v, w] = [weights[0], weights[1] * (1.0 - weights[0])];
            let scale = (-shift as f32).exp2();
            let at = |i: usize| scale * (corners[0][i] * (1.0 - v - w) + corners[1][i] * v + corners[2][i] * w);
            let origin: Point = std::array::from_fn(|i| from[i] * ((size + far) as f32).exp2());
            let direction: Point = std::array::from_fn(|i| (at(i) - origin[i]) * (e as f32).exp2());
            let line = ExactRay { ray: Ray::new(origin, direction), corner_shift: shift };
            prop_assume!(line.ray.is_valid());
            if let (Some(fast), Some(exact)) = (line.try_rounded(&corners), line.rounded(&corners)) {
                prop_assert_eq!(fast, exact);
            }
        }
    }
}
