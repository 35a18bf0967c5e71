//! The padded box test (`docs/design/hits.md`, "Box test"). A ray can hit a triangle only if it meets the triangle's own
//! box by this test. This does not apply to `exact`, nor to extreme rays with `watertight`.

use crate::scale::PreparedRay;
use geom::{Aabb, Point};

/// Least magnitude of a component of the direction, `2^-60`. Smaller components are replaced by this, with their sign.
pub const MIN_DIRECTION: f32 = f32::from_bits((127 - 60) << 23);
/// Padding of boxes as a fraction of `D`, `17 * 2^-24`. It bounds the errors of the watertight test and of this test.
///
/// `D` is the largest distance along one axis from the ray's origin to a corner of the box.
pub const PAD: f32 = 17.0 / 16_777_216.0;
/// Upper bound of `D`, `2^80`, so that the padding is finite.
pub const MAX_PADDING_DISTANCE: f32 = f32::from_bits((127 + 80) << 23);
/// Lower bound of `D`, `2^-38`. Coordinates that were flushed to zero are negligible relative to this.
pub const MIN_PADDING_DISTANCE: f32 = f32::from_bits((127 - 38) << 23);
/// For distances below this, `2^60`, every edge function of the watertight test is finite. Used by `cpu-simd`.
pub const MAX_FINITE_PRODUCT_DISTANCE: f32 = f32::from_bits((127 + 60) << 23);

/// A ray, prepared for the box test.
#[derive(Clone, Copy, Debug)]
pub struct BoxRay {
    origin: Point,
    /// `r`, the reciprocal of the direction, with the direction's sign.
    inverse: Point,
    t_min: f32,
}

/// The part of a ray within a box.
#[derive(Clone, Copy, Debug)]
pub struct BoxSpan {
    /// The later of entry and `t_min`. Hits before `t_min` do not count, so `t` may be clamped to it.
    pub entry: f32,
    /// Where the ray leaves the box.
    pub exit: f32,
}

impl BoxRay {
    /// Prepares a ray for the box test.
    pub fn new(ray: &PreparedRay) -> Self {
        Self {
            origin: ray.origin,
            inverse: ray
                .direction
                .map(|d| (1.0 / d.abs().max(MIN_DIRECTION)).copysign(d)),
            t_min: ray.t_min,
        }
    }

    /// Returns the part of the ray within a box. Returns `None` if the ray misses the box or enters it after `bound`.
    #[inline]
    pub fn meet(&self, bounds: &Aabb, bound: f32) -> Option<BoxSpan> {
        let from_origin = |plane: &Point, axis: usize| plane[axis] - self.origin[axis];
        let mut farthest = 0.0_f32;
        for axis in 0..3 {
            let [lower, upper] = [&bounds.min, &bounds.max].map(|p| from_origin(p, axis).abs());
            farthest = farthest.max(lower).max(upper);
        }
        let slack = farthest.clamp(MIN_PADDING_DISTANCE, MAX_PADDING_DISTANCE) * PAD;
        let (mut entry, mut exit) = (self.t_min, f32::INFINITY);
        for axis in 0..3 {
            let r = self.inverse[axis];
            let (near, far) = if r.is_sign_negative() {
                (&bounds.max, &bounds.min)
            } else {
                (&bounds.min, &bounds.max)
            };
            let pad = slack * r.abs();
            entry = entry.max(from_origin(near, axis) * r - pad);
            exit = exit.min(from_origin(far, axis) * r + pad);
        }
        (entry <= exit.min(bound)).then_some(BoxSpan { entry, exit })
    }
}
