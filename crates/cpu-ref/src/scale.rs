//! The scale of a scene, rays in scaled units, and exact scaling by powers of two.

use geom::{Aabb, Animation, Point, Ray};

/// Least nonzero component of a direction, `2^-37`, where the largest is in `[1, 2)`. Smaller ones are flushed to zero.
pub const MIN_NONZERO_COMPONENT: f32 = power(-37);
/// Least nonzero edge function, product or distance, `2^-100`. Smaller ones are flushed to zero.
pub const MIN_NONZERO: f32 = power(-100);

/// The factor `2^-k` of all vertices, so that products of a few coordinates neither overflow nor vanish.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scale {
    k: i32,
}

impl Scale {
    /// The factor 1.
    pub const ONE: Self = Self { k: 0 };
    /// Least nonzero scaled coordinate, `2^-64`. Smaller ones are flushed to zero.
    pub const MIN_NONZERO_COORDINATE: f32 = power(-64);

    /// Returns the scale of a scene: see [`Animation::scale_exponent`].
    pub fn of(animation: &Animation) -> Self {
        Self {
            k: animation.scale_exponent(),
        }
    }

    /// Returns the factor of vertices, `2^-k`.
    #[inline]
    pub fn factor(self) -> f32 {
        power(-self.k)
    }

    /// Returns the factor from scaled units to scene units, `2^k`, or `None` if `|k|` exceeds 60.
    #[inline]
    pub fn usual_inverse(self) -> Option<f32> {
        (self.k.abs() <= 60).then(|| power(self.k))
    }

    /// Returns the exponent `k`.
    pub fn k(self) -> i32 {
        self.k
    }

    /// Converts scene units to scaled units. Results whose magnitude is below `2^-64` become zero.
    #[inline]
    pub fn apply(self, p: Point) -> Point {
        p.map(|x| without(Self::MIN_NONZERO_COORDINATE, x * self.factor()))
    }

    /// Converts scaled units to scene units.
    pub fn undo(self, b: Aabb) -> Aabb {
        let back = |p: Point| p.map(|x| x * power(self.k));
        Aabb {
            min: back(b.min),
            max: back(b.max),
        }
    }
}

/// A ray, prepared for all tests: `o' + t' * d'` in scaled units, with the largest `|d'_i|` in `[1, 2)`.
#[derive(Clone, Copy, Debug)]
pub struct PreparedRay {
    /// Origin, `o'`.
    pub origin: Point,
    /// Direction, `d'`.
    pub direction: Point,
    /// Exclusive lower limit of hits, in scaled units.
    pub t_min: f32,
    /// Exclusive upper limit of hits, in scaled units.
    pub t_max: f32,
    /// Exponent `m` of the conversion `t = t' * 2^m`.
    unscale: i32,
}

/// An open interval of distances in scaled units.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Exclusive lower limit.
    pub after: f32,
    /// Exclusive upper limit.
    pub before: f32,
}

impl PreparedRay {
    /// Returns the prepared ray, or `None` if the ray cannot hit anything.
    #[inline]
    pub fn new(ray: &Ray, scale: Scale) -> Option<Self> {
        if !ray.is_valid() {
            return None;
        }
        let origin = scale.apply(ray.origin);
        if !origin.iter().all(|x| x.is_finite()) {
            return None;
        }
        let [x, y, z] = ray.direction.map(f32::abs);
        let e = exponent(x.max(y).max(z));
        let up = e - scale.k();
        Some(Self {
            origin,
            direction: unit_direction(ray.direction, e),
            t_min: flushed(ldexp(ray.t_min, up)),
            t_max: flushed(ldexp(ray.t_max, up)),
            unscale: -up,
        })
    }

    /// Returns limits that prove distances valid. If floats `low` and `high` are strictly between them, every exact
    /// `t'` in `low..=high` is valid: converted to the ray's own units and rounded once, it is strictly between the
    /// ray's `t_min` and `t_max`.
    ///
    /// A limit of the ray suffices if it is a normal number: `low` is at least the next float after `t_min`, and
    /// rounding is monotone. Subnormal numbers have fewer bits than scaled ones. So small limits are replaced. Let `s`
    /// be `2^-125` in the ray's own units, but at least `2^-99` in scaled units. A lower limit within `-s..s` is
    /// replaced by `s`, an upper one by `-s`. Both make the interval smaller. Large numbers overflow. So the interval
    /// is limited to `-2^127..2^127` in the ray's own units.
    pub fn sure_limits(&self) -> Limits {
        // 2^-125 and 2^127 in the ray's own units. Scaled distances below `MIN_NONZERO`, 2^-100, are flushed to zero.
        let small = ldexp(1.0, -125 - self.unscale).max(power(-99));
        let large = ldexp(1.0, 127 - self.unscale);
        let replace_tiny = |limit: f32, small: f32| {
            if limit.abs() < small.abs() {
                small
            } else {
                limit
            }
        };
        Limits {
            after: replace_tiny(self.t_min, small).max(-large),
            before: replace_tiny(self.t_max, -small).min(large),
        }
    }

    /// Converts a distance to units of the given ray's direction. A zero result is `+0`.
    #[inline]
    pub fn unscaled(&self, t: f32) -> f32 {
        let t = ldexp(t, self.unscale);
        if t == 0.0 { 0.0 } else { t }
    }
}

/// Returns `x`, or `+0` if `|x|` is below `least`.
#[inline]
fn without(least: f32, x: f32) -> f32 {
    if x.abs() < least { 0.0 } else { x }
}

/// Returns `x`, or `+0` if `|x|` is below `2^-100`. So devices that flush subnormal numbers compute the same hits.
#[inline]
pub fn flushed(x: f32) -> f32 {
    without(MIN_NONZERO, x)
}

/// Returns a direction times `2^-e`, which brings its largest component into `[1, 2)`. Components whose magnitude is
/// below `2^-37` become zero.
#[inline]
pub fn unit_direction(direction: Point, e: i32) -> Point {
    direction.map(|x| without(MIN_NONZERO_COMPONENT, ldexp(x, -e)))
}

/// Returns the exponent of a finite nonzero number: `2^e <= |x| < 2^(e + 1)`.
#[inline]
pub fn exponent(x: f32) -> i32 {
    let bits = x.to_bits() & 0x7fff_ffff;
    if bits >= 0x0080_0000 {
        (bits >> 23) as i32 - 127
    } else {
        31 - bits.leading_zeros() as i32 - 149
    }
}

/// Returns `2^m` for `m` in `-126..=127`.
#[inline]
pub const fn power(m: i32) -> f32 {
    f32::from_bits(((m + 127) as u32) << 23)
}

/// Returns `x * 2^m`, rounded once, for `|m|` up to 400.
#[inline]
pub fn ldexp(x: f32, m: i32) -> f32 {
    // Neither factor nor product leaves the normal range of f64.
    (f64::from(x) * f64::from_bits(((m + 1023) as u64) << 52)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_unusual_magnitudes_are_scaled() {
        let ordinary = [0.0, 1e-3, -1.0, 1e5, 1_073_741_824.0, f32::INFINITY];
        let odd = [(1e-9, -30), (1e-20, -67), (-1e20, 66), (f32::MAX, 126)];
        let least = [(9.765_625e-4, 0), (f32::from_bits(1), -126)];
        let ordinary = ordinary.map(|x| (x, 0));
        for (x, k) in ordinary.into_iter().chain(odd).chain(least) {
            let keys = vec![vec![[0.0; 3], [0.0, x, f32::NAN]]];
            let scale = Scale::of(&Animation::new(keys, vec![]).unwrap());
            assert_eq!(scale.k(), k, "{x}");
        }
    }

    #[test]
    fn flushes_tiny_values_to_zero() {
        let least = power(-64);
        let below = f32::from_bits(least.to_bits() - 1);
        let applied = Scale::ONE.apply([least, -below, -least]);
        assert_eq!(applied, [least, 0.0, -least]);
        assert_eq!(Scale::ONE.apply([-0.0; 3]).map(f32::to_bits), [0; 3]);
        assert!(Scale::ONE.apply([f32::NAN; 3])[0].is_nan());
        let unit = unit_direction([1.5, power(-37), power(-38)], 0);
        assert_eq!(unit, [1.5, power(-37), 0.0]);
        let kept = [power(-100), -power(-101), -1.0].map(flushed);
        assert_eq!(kept, [power(-100), 0.0, -1.0]);
        assert!(flushed(f32::NAN).is_nan());
    }

    #[test]
    fn exponent_handles_subnormals() {
        let normal = [(1.0, 0), (-1.99, 0), (0.5, -1), (f32::MAX, 127)];
        let subnormal = [(1, -149), (0x007f_ffff, -127)].map(|(bits, e)| (f32::from_bits(bits), e));
        for (x, e) in normal.into_iter().chain(subnormal) {
            assert_eq!(exponent(x), e);
        }
    }

    #[test]
    fn ldexp_rounds_once() {
        assert_eq!(ldexp(f32::from_bits(1), 149), 1.0);
        assert_eq!(ldexp(1.0, -149), f32::from_bits(1));
        assert_eq!(ldexp(f32::INFINITY, -200), f32::INFINITY);
        assert_eq!(ldexp(0.75, 128), f32::from_bits(0x7f40_0000));
        // Two roundings would return `2 * f32::from_bits(1)`.
        assert_eq!(ldexp(1.5 - f32::EPSILON, -149), f32::from_bits(1));
    }

    #[test]
    fn distances_survive_a_scaling_round_trip() {
        let huge = Animation::new(vec![vec![[1e30, 0.0, 0.0]]], vec![]).unwrap();
        let ray = Ray {
            t_min: 0.5,
            t_max: 7.0,
            ..Ray::new([1e30, 0.0, 0.0], [0.0, 1e12, 0.0])
        };
        let p = PreparedRay::new(&ray, Scale::of(&huge)).unwrap();
        assert_eq!((p.unscaled(p.t_min), p.unscaled(p.t_max)), (0.5, 7.0));
        assert_eq!(p.unscaled(-0.0).to_bits(), 0);
    }

    #[test]
    fn rejects_invalid_rays() {
        let tiny = Animation::new(vec![vec![[1e-30, 0.0, 0.0]]], vec![]).unwrap();
        let far = Ray::new([1e30, 0.0, 0.0], [1.0, 0.0, 0.0]);
        assert!(PreparedRay::new(&far, Scale::of(&tiny)).is_none());
        assert!(PreparedRay::new(&far, Scale::ONE).is_some());
        let still = Ray::new([0.0; 3], [0.0; 3]);
        assert!(PreparedRay::new(&still, Scale::ONE).is_none());
    }
}
