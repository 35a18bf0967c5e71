//! The padded box test of both boxes of a pair at once.

use crate::bvh2::Pair;
use crate::scale::PreparedRay;
use glam::{Vec3A, Vec4, Vec4Swizzles};

/// Least magnitude of a direction's component, `2^-60`. Smaller ones are pushed away from zero to it.
pub const SMALLEST: f32 = f32::from_bits((127 - 60) << 23);
/// `17 * 2^-24`: bound on the errors of the watertight test and of this test, in units of `D`.
pub const PAD: f32 = 17.0 / 16_777_216.0;
/// Upper bound of `D`, `2^80`, so that no product is infinite. `D` is the largest distance on one axis from the ray's
/// origin to a corner of the box.
pub const FARTHEST: f32 = f32::from_bits((127 + 80) << 23);

/// Bound on distances up to which every product of the watertight test is finite, `2^60`.
pub const CALM: f32 = f32::from_bits((127 + 60) << 23);

/// A ray, prepared for the box test.
///
/// Lanes are those of a [`Pair`]: both lower planes, both upper planes. With
/// `|r|` in the lower lanes and `-|r|` in the upper ones, `(plane - o) * r - q`
/// is the entry in one half and the negated exit in the other, whatever the
/// direction's sign. `turned` is set where the entry is in the upper half.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slab {
    origin: [Vec4; 3],
    inverse: [Vec4; 3],
    /// `|r|` in all lanes.
    magnitude: [Vec4; 3],
    turned: [bool; 3],
    /// `t_min` for the entries, negative infinity for the negated exits.
    floor: Vec4,
}

/// Spans of a ray within the boxes of a pair.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Met {
    /// Bit `lane` is set if that box cannot be skipped.
    pub(crate) lanes: u32,
    /// The later of `t_min` and the entry in lanes 0 and 1, then the negated exits.
    spans: Vec4,
}

impl Met {
    /// Returns the later of entry and `t_min`. Hits before `t_min` do not count, so `t` may be clamped to it.
    #[inline]
    pub(crate) fn entry(&self, lane: usize) -> f32 {
        let [first, second, ..] = self.spans.to_array();
        if lane == 0 { first } else { second }
    }

    /// Returns the exit.
    #[inline]
    pub(crate) fn exit(&self, lane: usize) -> f32 {
        let [.., first, second] = self.spans.to_array();
        -if lane == 0 { first } else { second }
    }
}

impl Slab {
    /// Prepares a ray.
    #[inline]
    pub(crate) fn new(ray: &PreparedRay) -> Self {
        let halves = |x: f32| Vec4::new(x, x, -x, -x);
        let direction = Vec3A::from_array(ray.direction);
        let inverse = Vec3A::ONE / direction.abs().max(Vec3A::splat(SMALLEST));
        Self {
            origin: ray.origin.map(Vec4::splat),
            inverse: inverse.to_array().map(halves),
            magnitude: inverse.to_array().map(Vec4::splat),
            turned: ray.direction.map(f32::is_sign_negative),
            floor: Vec4::new(ray.t_min, ray.t_min, f32::NEG_INFINITY, f32::NEG_INFINITY),
        }
    }

    /// Tests both boxes of a pair against the part of the ray before `best`.
    #[inline(always)]
    pub(crate) fn meet(&self, pair: &Pair, best: f32) -> Met {
        let from = [0, 1, 2].map(|axis| Vec4::from_array(pair.planes[axis]) - self.origin[axis]);
        let [x, y, z] = from.map(Vec4::abs);
        let reach = x.max(y).max(z);
        // Both planes of a box use the same `D`.
        let reach = reach.max(reach.zwxy()).min(Vec4::splat(FARTHEST));
        let slack = reach * PAD;
        let side = |axis: usize| {
            let t = from[axis] * self.inverse[axis] - slack * self.magnitude[axis];
            if self.turned[axis] {
                Vec4::new(t.z, t.w, t.x, t.y)
            } else {
                t
            }
        };
        let spans = self.floor.max(side(0)).max(side(1)).max(side(2));
        let exits = -Vec4::new(spans.z, spans.w, spans.x, spans.y);
        let lanes = spans.cmple(exits.min(Vec4::splat(best))).bitmask() & 3;
        Met { lanes, spans }
    }
}
