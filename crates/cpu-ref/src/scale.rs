//! Powers of two: a scene's scale, and multiplications that round nothing.

use geom::{Aabb, Animation, Point};

/// The widest power of two that is a normal number in both directions.
const WIDEST: i32 = 126;

/// Vertices are multiplied by `2^-k`, so that products of a few of them neither overflow nor vanish.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Scale {
    k: i32,
}

impl Scale {
    /// Already in scaled units.
    pub(crate) const ONE: Self = Self { k: 0 };

    /// Chosen by the largest finite coordinate of all key frames.
    pub(crate) fn of(animation: &Animation) -> Self {
        Self {
            k: animation.scale_exponent(),
        }
    }

    /// The exponent `k`.
    pub(crate) fn k(self) -> i32 {
        self.k
    }

    /// The factor `2^-k`.
    #[inline]
    pub(crate) fn factor(self) -> f32 {
        power(-self.k)
    }

    /// Scene units to scaled units.
    #[inline]
    pub(crate) fn apply(self, p: Point) -> Point {
        p.map(|x| x * self.factor())
    }

    /// Scaled units to scene units.
    pub(crate) fn undo(self, b: Aabb) -> Aabb {
        let back = |p: Point| p.map(|x| x * power(self.k));
        Aabb {
            min: back(b.min),
            max: back(b.max),
        }
    }
}

/// The exponent of a finite number that is not zero: `2^e <= |x| < 2^(e + 1)`.
#[inline]
pub(crate) fn exponent(x: f32) -> i32 {
    let bits = x.to_bits() & 0x7fff_ffff;
    if bits >= 0x0080_0000 {
        (bits >> 23) as i32 - 127
    } else {
        31 - bits.leading_zeros() as i32 - 149
    }
}

/// `2^m` for `m` in `-126..=127`.
#[inline]
fn power(m: i32) -> f32 {
    f32::from_bits(((m + 127) as u32) << 23)
}

/// `x * 2^m`: one multiplication, and a second one where `m` is beyond what one factor can hold.
#[inline]
pub(crate) fn ldexp(x: f32, m: i32) -> f32 {
    let first = m.clamp(-WIDEST, WIDEST);
    let scaled = x * power(first);
    if first == m {
        return scaled;
    }
    scaled * power((m - first).clamp(-WIDEST, WIDEST))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale_of(x: f32) -> i32 {
        let keys = vec![vec![[0.0; 3], [0.0, x, f32::NAN]]];
        Scale::of(&Animation::new(keys, vec![]).unwrap()).k()
    }

    #[test]
    fn ordinary_scenes_are_not_scaled() {
        for x in [0.0, 1e-9, -1.0, 1e5, 1_073_741_824.0, 9.313_226e-10] {
            assert_eq!(scale_of(x), 0, "{x}");
        }
    }

    #[test]
    fn odd_scenes_are_scaled_by_their_exponent() {
        assert_eq!(scale_of(1e-20), -67);
        assert_eq!(scale_of(-1e20), 66);
        assert_eq!(scale_of(f32::MAX), 126);
        assert_eq!(scale_of(f32::from_bits(1)), -126);
        assert_eq!(scale_of(f32::INFINITY), 0);
    }

    #[test]
    fn exponents_hold_for_subnormal_numbers_too() {
        for (x, e) in [(1.0, 0), (-1.99, 0), (0.5, -1), (f32::MAX, 127)] {
            assert_eq!(exponent(x), e);
        }
        assert_eq!(exponent(f32::from_bits(1)), -149);
        assert_eq!(exponent(f32::from_bits(0x007f_ffff)), -127);
    }

    #[test]
    fn powers_beyond_one_factor_are_reached() {
        assert_eq!(ldexp(f32::from_bits(1), 149), 1.0);
        assert_eq!(ldexp(1.0, -149), f32::from_bits(1));
        assert_eq!(ldexp(f32::INFINITY, -200), f32::INFINITY);
        assert_eq!(ldexp(0.75, 128), f32::from_bits(0x7f40_0000));
    }
}
