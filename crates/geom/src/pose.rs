//! A pose of an animation, and the formula that blends two key frames.

use crate::Point;

/// Blend of key frames `key` and `key + 1`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Index of the earlier key frame.
    pub key: u32,
    /// Weight of the later key frame. Weights above 1 extrapolate. At 0 the later frame is not read. [`Pose::at`]
    /// returns weights in `0.0..1.0`.
    pub alpha: f32,
}

impl Pose {
    /// Returns the pose at `time`, measured in key frames and clamped to `0.0..=keys - 1`. A weight that rounds to 1
    /// becomes weight 0 of the next key frame.
    ///
    /// # Panics
    /// If `keys` is 0 or `time` is NaN.
    #[must_use]
    pub fn at(time: f64, keys: usize) -> Self {
        assert!(keys > 0, "an animation has at least one key frame");
        assert!(!time.is_nan(), "time must be a number");
        let last = (keys - 1) as f64;
        let time = time.clamp(0.0, last);
        let (key, alpha) = (time.floor() as u32, time.fract() as f32);
        if alpha < 1.0 {
            return Self { key, alpha };
        }
        Self {
            key: key + 1,
            alpha: 0.0,
        }
    }

    /// Returns the pose at `time` after key frame `last`, by extrapolation from key frames `last - 1` and `last`.
    pub(crate) fn beyond(time: f64, last: usize) -> Self {
        Self {
            key: last as u32 - 1,
            alpha: (time - last as f64 + 1.0) as f32,
        }
    }

    /// Returns the indices of the one or two key frames that are read.
    pub fn keys(self) -> impl Iterator<Item = usize> {
        let later = (self.alpha != 0.0).then_some(self.key as usize + 1);
        std::iter::once(self.key as usize).chain(later)
    }

    /// Returns the position of a vertex at `a` in key frame `key` and at `b` in key frame `key + 1`.
    ///
    /// The position is `a + (b - a) * alpha`, with each operation rounded once and never fused. If `alpha` is 0, the
    /// position is `a`, bit for bit. Otherwise, if `a` and `b` are equal and finite, the result has the bits of `a`,
    /// except that `-0` becomes `+0`. If `a` is not finite, neither is the result. If `alpha` is not 0, the same holds
    /// for `b`.
    #[inline]
    pub fn blend(self, a: Point, b: Point) -> Point {
        if self.alpha == 0.0 {
            return a;
        }
        std::array::from_fn(|i| a[i] + (b[i] - a[i]) * self.alpha)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pose_at_clamps_and_snaps_times() {
        for (time, expected) in [
            (3.0, (3, 0.0)),
            (9.0, (4, 0.0)),
            (-1.0, (0, 0.0)),
            (1.0 - 1e-12, (1, 0.0)),
            (1.25, (1, 0.25)),
        ] {
            let pose = Pose::at(time, 5);
            assert_eq!((pose.key, pose.alpha), expected, "{time}");
        }
    }

    #[test]
    fn zero_alpha_copies_key_frame_bits() {
        let a = [-0.0, f32::MAX, 1.0];
        let b = [f32::INFINITY, f32::MIN, f32::NAN];
        let p = Pose { key: 0, alpha: 0.0 }.blend(a, b);
        assert_eq!(p.map(f32::to_bits), a.map(f32::to_bits));
    }
}
