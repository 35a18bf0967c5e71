//! Ranges of coordinates. They determine where ray tests in floating point do not suffice.

use crate::sizes::{Sizes, size};
use crate::{Point, Pose};

/// If the largest coordinate of a key frame exceeds this multiple of [`Sizes::typical`], the scene is not scaled.
const OUTLYING: f32 = 65_536.0;
/// A key frame is spread if its largest coordinate exceeds this multiple of [`Sizes::typical`].
///
/// A box is padded by `17 * 2^-24` of `D`, the largest distance along one axis from the ray's origin to a corner. At
/// this limit, if `D` equals the largest coordinate, the padding is `17 * 2^-14` of the typical size.
const SPREAD: f32 = 1024.0;
/// [`CoordinateRange::clearance`] as a multiple of the typical size.
const CLEARANCE: f32 = 256.0;
/// A triangle is tiny if all its coordinates are below this number of scaled units, `2^-32`.
const TINY: f32 = 1.0 / 4_294_967_296.0;

/// Range of the coordinates of one moment. A *scaled unit* is `2^k` scene units, where `k` is the
/// [scale exponent](crate::Animation::scale_exponent).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoordinateRange {
    /// True if some coordinates are so large that `watertight` and `exact` must test every ray in exact arithmetic.
    pub extreme: bool,
    /// True if some triangles may be so small and so close to zero that rays that start there need exact arithmetic.
    pub tiny: bool,
    /// True if the largest coordinate far exceeds the typical one. Backends then compute the padding of each inner box
    /// from that box instead of the root box. This changes no hit.
    pub spread: bool,
    /// The offset of shadow rays grows with the root box's longest edge. A longer edge than this, in scene units, counts
    /// as this length.
    pub clearance: f32,
}

impl CoordinateRange {
    /// Range without extreme coordinates.
    pub const ORDINARY: Self = Self {
        extreme: false,
        tiny: false,
        spread: false,
        clearance: f32::INFINITY,
    };

    /// A ray is extreme if a coordinate of its origin is at least `2^40` scaled units. A moment is extreme if a vertex
    /// of one of its key frames has a larger coordinate.
    pub const FAR: f32 = 1_099_511_627_776.0;
    /// In a moment with tiny triangles, a ray is also extreme if all coordinates of its origin are below `2^-24` scaled
    /// units.
    pub const NEAR: f32 = 1.0 / 16_777_216.0;

    /// Returns whether a ray from `origin`, in scaled units, is extreme. `watertight` and `exact` trace such rays in
    /// exact arithmetic.
    #[inline]
    pub fn is_extreme(&self, origin: Point) -> bool {
        let farthest = size(origin);
        let is_near = self.tiny && farthest < Self::NEAR;
        self.extreme || farthest.is_nan() || farthest >= Self::FAR || is_near
    }

    /// Maximum number of vertices from which the typical size of a key frame is estimated.
    pub const SAMPLES: usize = 4096;

    /// Returns the stride at which at most [`Self::SAMPLES`] of `vertices` vertices are sampled.
    pub fn sample_step(vertices: usize) -> usize {
        vertices.div_ceil(Self::SAMPLES).max(1)
    }

    /// Returns the range of a key frame with these sizes, in a scene with this scale.
    pub(crate) fn of(sizes: &Sizes, scale_exponent: i32) -> Self {
        Self {
            extreme: sizes.largest > to_scene_units(Self::FAR, scale_exponent),
            tiny: sizes.second_smallest < to_scene_units(TINY, scale_exponent),
            spread: sizes.largest > sizes.typical * SPREAD,
            clearance: (sizes.typical * CLEARANCE).min(f32::MAX),
        }
    }

    /// Returns the [scale exponent](crate::Animation::scale_exponent) of a scene and the ranges of its key frames.
    pub(crate) fn of_keys(sizes: &[Sizes]) -> (i32, Vec<Self>) {
        let largest = sizes.iter().fold(0.0_f32, |m, s| m.max(s.largest));
        // A few distant vertices must not scale the others.
        let scale_exponent = if sizes.iter().any(is_outlying) {
            0
        } else {
            exponent_for(largest)
        };
        let ranges = sizes.iter().map(|sizes| Self::of(sizes, scale_exponent));
        (scale_exponent, ranges.collect())
    }

    /// Returns the range at `pose`, from the ranges of the key frames.
    pub(crate) fn at(keys: &[Self], pose: Pose) -> Self {
        let earlier = keys[pose.key as usize];
        match keys.get(pose.key as usize + 1) {
            Some(next) if pose.alpha != 0.0 => Self {
                extreme: earlier.extreme || next.extreme,
                tiny: earlier.tiny || next.tiny,
                spread: earlier.spread || next.spread,
                clearance: earlier.clearance.max(next.clearance),
            },
            _ => earlier,
        }
    }
}

fn is_outlying(sizes: &Sizes) -> bool {
    sizes.largest > sizes.typical * OUTLYING
}

/// Returns 0 if `largest` is 0 or within `[2^-10, 2^30]`, else its exponent, clamped to `-126..=126`.
fn exponent_for(largest: f32) -> i32 {
    if largest == 0.0 || (2.0_f32.powi(-10)..=2.0_f32.powi(30)).contains(&largest) {
        return 0;
    }
    // The exponent field of a double represents the exponent of every `f32`, including subnormal numbers.
    let exponent = (f64::from(largest).to_bits() >> 52) as i32 - 1023;
    exponent.clamp(-126, 126)
}

/// Converts a size from scaled units to scene units.
fn to_scene_units(size: f32, exponent: i32) -> f32 {
    (f64::from(size) * f64::from(exponent).exp2()) as f32
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::Animation;

    /// Returns a point cloud of about unit size, with one vertex at `far`.
    pub(crate) fn cloud(far: f32) -> Vec<Point> {
        let mut points: Vec<Point> = (1..=20).map(|i| [i as f32 * 0.1, 0.3, -0.2]).collect();
        points[7] = [far, 0.0, 0.0];
        points
    }

    fn range(keys: &[Vec<Point>], time: f64) -> (i32, CoordinateRange) {
        let animation = Animation::new(keys.to_vec(), vec![[0, 1, 2], [6, 7, 8]]).unwrap();
        let range = animation.range(animation.pose(time));
        (animation.scale_exponent(), range)
    }

    #[test]
    fn far_vertex_marks_spread_or_extreme() {
        for far in [1e6, 1e12, 1.2e12, 1e19, f32::MAX] {
            let keys = [cloud(0.7), cloud(0.7), cloud(far)];
            for (time, blends_far_key) in [(0.0, false), (1.0, false), (1.25, true), (2.0, true)] {
                let (k, range) = range(&keys, time);
                let extreme = blends_far_key && far > CoordinateRange::FAR;
                let found = (k, range.spread, range.extreme);
                assert_eq!(found, (0, blends_far_key, extreme), "{far} at {time}");
            }
        }
        assert!(!range(&[cloud(500.0)], 0.0).1.spread);
    }

    #[test]
    fn uniform_scale_is_always_ordinary() {
        for e in [-120, -60, -3, 0, 20, 40, 100, 126] {
            let by = 2.0_f32.powi(e);
            let key: Vec<Point> = cloud(0.5).iter().map(|p| p.map(|x| x * by)).collect();
            let (_, range) = range(&[key], 0.0);
            let found = [range.extreme, range.tiny, range.spread];
            assert_eq!(found, [false; 3], "2^{e}");
            assert!(range.clearance.is_finite(), "2^{e}");
        }
    }

    #[test]
    fn tiny_triangles_make_nearby_rays_extreme() {
        let mut key = cloud(0.7);
        for (i, x) in [1e-12, 2e-12, 3e-20].into_iter().enumerate() {
            key[i] = [x, 0.0, 0.0];
        }
        let (_, range) = range(&[key], 0.0);
        assert!(range.tiny && !range.extreme);
        assert!(range.is_extreme([1e-9, 0.0, 0.0]) && !range.is_extreme([1e-3, 0.0, 0.0]));
    }

    #[test]
    fn origin_vertices_are_not_tiny_triangles() {
        let mut key = cloud(0.7);
        key[..3].fill([0.0; 3]);
        assert!(!range(&[key.clone()], 0.0).1.tiny);
        key[3] = [1e-12, 0.0, 0.0];
        assert!(!range(&[key], 0.0).1.tiny);
    }

    #[test]
    fn distant_rays_are_always_extreme() {
        let range = CoordinateRange::ORDINARY;
        assert!(!range.is_extreme([0.0, -1e12, 0.0]) && !range.is_extreme([0.0; 3]));
        for x in [1.2e12, f32::INFINITY, f32::NAN] {
            assert!(range.is_extreme([0.0, -x, 1.0]), "{x}");
        }
    }

    #[test]
    fn typical_size_ignores_non_finite_vertices() {
        let mut key = cloud(2.0);
        key[3] = [f32::NAN, 1e30, 0.0];
        key[4] = [f32::INFINITY; 3];
        key[5] = [0.0; 3];
        let sizes = Sizes::of(&key);
        assert!(
            sizes.typical > 0.2 && sizes.typical < 1.0,
            "{}",
            sizes.typical
        );
        assert_eq!(Sizes::of(&[[0.0; 3]]).typical, 0.0);
    }
}
