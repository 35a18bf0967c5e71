//! How far coordinates reach, and which moments that takes beyond what rounded tests of rays can tell.

use crate::sizes::{Sizes, size};
use crate::{Point, Pose};

/// A scene keeps its own units if the farthest coordinate of a key frame exceeds this multiple of the typical size.
const OUTLYING: f32 = 65_536.0;
/// A key frame is spread if its farthest coordinate exceeds this multiple of its typical size.
///
/// Boxes that are padded by the size of the whole scene are then `17 * 2^-14` of the typical size too large.
const SPREAD: f32 = 1024.0;
/// Shadow rays are offset by the extent of the scene, but at most by so many times its typical size.
const CLEARANCE: f32 = 256.0;
/// A triangle is tiny if all its scaled coordinates are below this, `2^-32`. It then has two such vertices that are not the
/// origin.
const TINY: f32 = 1.0 / 4_294_967_296.0;

/// The coordinates of one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Whether some lie so far away that `watertight` and `exact` answer every ray in exact arithmetic.
    pub extreme: bool,
    /// Whether there may be triangles so near the origin that rays from there need exact arithmetic.
    pub tiny: bool,
    /// Whether sizes differ so much that boxes of inner nodes are padded by their own distance. It changes no hit.
    pub spread: bool,
    /// The largest extent of the scene that offsets of shadow rays take into account, in the scene's units.
    pub clearance: f32,
}

impl Range {
    /// Coordinates of which nothing special is known.
    pub const ORDINARY: Self = Self {
        extreme: false,
        tiny: false,
        spread: false,
        clearance: f32::INFINITY,
    };

    /// Rays from here on, `2^40` scaled units, are extreme. So are moments with coordinates beyond.
    pub const FAR: f32 = 1_099_511_627_776.0;
    /// Rays from nearer to the origin than this, `2^-24` scaled units, are extreme where there are tiny triangles.
    pub const NEAR: f32 = 1.0 / 16_777_216.0;

    /// Whether a ray from `origin`, in scaled units, is answered in exact arithmetic.
    #[inline]
    pub fn is_extreme(&self, origin: Point) -> bool {
        let farthest = size(origin);
        let is_near = self.tiny && farthest < Self::NEAR;
        self.extreme || farthest.is_nan() || farthest >= Self::FAR || is_near
    }

    /// Vertices of a key frame from which its typical size is found, at most.
    pub const SAMPLES: usize = 4096;

    /// Of so many vertices, every how manieth that is.
    pub fn sample_step(vertices: usize) -> usize {
        vertices.div_ceil(Self::SAMPLES).max(1)
    }

    /// Of a key frame of these sizes, in a scene of this scale.
    pub(crate) fn of(sizes: &Sizes, scale_exponent: i32) -> Self {
        Self {
            extreme: sizes.largest > scaled(Self::FAR, scale_exponent),
            tiny: sizes.second < scaled(TINY, scale_exponent),
            spread: sizes.largest > sizes.typical * SPREAD,
            clearance: sizes.typical * CLEARANCE,
        }
    }

    /// The scale of a scene (see [`crate::Animation::scale_exponent`]) whose key frames are of these sizes, and their ranges.
    pub(crate) fn of_keys(sizes: &[Sizes]) -> (i32, Vec<Self>) {
        let largest = sizes.iter().fold(0.0_f32, |m, s| m.max(s.largest));
        // A few far vertices do not scale the others.
        let scale_exponent = if sizes.iter().any(is_outlying) {
            0
        } else {
            exponent_for(largest)
        };
        let ranges = sizes.iter().map(|sizes| Self::of(sizes, scale_exponent));
        (scale_exponent, ranges.collect())
    }

    /// Of the moment at `pose` of key frames of these ranges.
    pub(crate) fn at(keys: &[Self], pose: Pose) -> Self {
        let own = keys[pose.key as usize];
        match keys.get(pose.key as usize + 1) {
            Some(next) if pose.alpha != 0.0 => Self {
                extreme: own.extreme || next.extreme,
                tiny: own.tiny || next.tiny,
                spread: own.spread || next.spread,
                clearance: own.clearance.max(next.clearance),
            },
            _ => own,
        }
    }
}

fn is_outlying(sizes: &Sizes) -> bool {
    sizes.largest > sizes.typical * OUTLYING
}

/// 0 if the largest coordinate lies within `[2^-10, 2^30]`, else its exponent, within `-126..=126`.
fn exponent_for(largest: f32) -> i32 {
    if largest == 0.0 || (2.0_f32.powi(-10)..=2.0_f32.powi(30)).contains(&largest) {
        return 0;
    }
    // The exponent field of a double holds every f32's exponent, subnormal ones included.
    let exponent = (f64::from(largest).to_bits() >> 52) as i32 - 1023;
    exponent.clamp(-126, 126)
}

/// A size in scaled units in the scene's.
fn scaled(size: f32, exponent: i32) -> f32 {
    (f64::from(size) * f64::from(exponent).exp2()) as f32
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::Animation;

    /// A cloud of unit size in which one vertex lies at `far`.
    pub(crate) fn cloud(far: f32) -> Vec<Point> {
        let mut points: Vec<Point> = (1..=20).map(|i| [i as f32 * 0.1, 0.3, -0.2]).collect();
        points[7] = [far, 0.0, 0.0];
        points
    }

    fn range(keys: &[Vec<Point>], time: f64) -> (i32, Range) {
        let animation = Animation::new(keys.to_vec(), vec![[0, 1, 2], [6, 7, 8]]).unwrap();
        let range = animation.range(animation.pose(time));
        (animation.scale_exponent(), range)
    }

    #[test]
    fn one_far_vertex_makes_its_moments_spread_and_extreme_only_beyond_bounds() {
        for far in [1e6, 1e12, 1.2e12, 1e19, f32::MAX] {
            let keys = [cloud(0.7), cloud(0.7), cloud(far)];
            for (time, is_near) in [(0.0, false), (1.0, false), (1.25, true), (2.0, true)] {
                let (k, range) = range(&keys, time);
                let extreme = is_near && far > Range::FAR;
                let found = (k, range.spread, range.extreme);
                assert_eq!(found, (0, is_near, extreme), "{far} at {time}");
            }
        }
        assert!(!range(&[cloud(500.0)], 0.0).1.spread);
    }

    #[test]
    fn scenes_of_one_size_are_ordinary_at_any_size() {
        for e in [-120, -60, -3, 0, 20, 40, 100] {
            let by = 2.0_f32.powi(e);
            let key: Vec<Point> = cloud(0.5).iter().map(|p| p.map(|x| x * by)).collect();
            let (_, range) = range(&[key], 0.0);
            let found = [range.extreme, range.tiny, range.spread];
            assert_eq!(found, [false; 3], "2^{e}");
        }
    }

    #[test]
    fn tiny_triangles_make_rays_beside_them_extreme() {
        let mut key = cloud(0.7);
        for (i, x) in [1e-12, 2e-12, 3e-20].into_iter().enumerate() {
            key[i] = [x, 0.0, 0.0];
        }
        let (_, range) = range(&[key], 0.0);
        assert!(range.tiny && !range.extreme);
        assert!(range.is_extreme([1e-9, 0.0, 0.0]) && !range.is_extreme([1e-3, 0.0, 0.0]));
    }

    #[test]
    fn vertices_at_the_origin_make_no_tiny_triangles() {
        let mut key = cloud(0.7);
        key[..3].fill([0.0; 3]);
        assert!(!range(&[key.clone()], 0.0).1.tiny);
        key[3] = [1e-12, 0.0, 0.0];
        assert!(!range(&[key], 0.0).1.tiny);
    }

    #[test]
    fn rays_from_far_away_are_extreme_in_any_scene() {
        let range = Range::ORDINARY;
        assert!(!range.is_extreme([0.0, -1e12, 0.0]) && !range.is_extreme([0.0; 3]));
        for x in [1.2e12, f32::INFINITY, f32::NAN] {
            assert!(range.is_extreme([0.0, -x, 1.0]), "{x}");
        }
    }

    #[test]
    fn what_is_not_finite_or_zero_says_nothing_of_the_typical_size() {
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
