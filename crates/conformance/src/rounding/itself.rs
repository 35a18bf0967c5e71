//! Whether rounding may have a triangle block the way from a point of itself to the light: a driver is asked of that
//! triangle too, and only the offset of `docs/design/hits.md` ("Shadow rays") keeps the way off it.
//!
//! Let `u = 2^-24`, `L` be the longest edge, `N` the normal, and `p` and `E` as there. All is in scaled units.
//! A component of the computed `N` is a difference of two products, each off by `3 u`: `N` leans by at most `6 u L^2 / |N|`.
//!
//! - On the triangle, heights over its plane are off by `11 u L + u L^3 / |N| + 4 u |p|`. `p` and its move make `3 u L` and
//!   `3.5 u |p|` of it. The sheared corners of a driver's watertight test make `8 u L`. Products in its weights make
//!   `3 u |a| |b| |c| / |N|`, with the corners as seen from `p`: at most `u L^3 / |N|`.
//! - At a distance `D` from `p`, heights are off by that, by the lean times `D`, and by `4 u D` for difference and product.
//! - Up to `2^-98 / |N|` is lost besides, as lean and as height, where products count as zero.
//!
//! What is higher has a sure side. If the light or else the eye has, the start is moved, and as high as the offset less the first
//! of these errors. The way is straight: the least heights of its ends tell where it crosses the plane at the earliest.
//! The triangle blocks it only if it reaches as far.

use super::{distance_to_triangle, largest, longest_edge, ulp};
use glam::DVec3;

/// What is lost where products below `2^-100` count as zero.
const LOST: f64 = 4.0 / (1_u128 << 100) as f64;

/// A triangle's plane around a point of it.
struct Plane {
    point: DVec3,
    normal: DVec3,
    /// By how much the normal may lean.
    lean: f64,
    /// The triangle's longest edge along an axis: `E` is no less.
    extent: f64,
    /// How far off heights on the triangle are.
    near: f64,
}

impl Plane {
    fn of(corners @ [a, b, c]: &[DVec3; 3], point: DVec3) -> Self {
        let longest = longest_edge(corners);
        let normal = (b - a).cross(c - a);
        let lost = LOST / normal.length();
        let thin = ulp(longest * longest) / normal.length();
        Self {
            point,
            normal: normal.normalize(),
            lean: 6.0 * thin + lost,
            extent: largest(b - a).max(largest(c - a)),
            near: 11.0 * ulp(longest) + thin * longest + 4.0 * ulp(largest(point)) + lost,
        }
    }

    /// Whether the side of a point is sure, and the least height that it may have over the side where the start is.
    fn height(&self, at: DVec3) -> (bool, f64) {
        let way = at - self.point;
        let doubt = self.near + self.lean * way.length() + 4.0 * ulp(way.length());
        let height = self.normal.dot(way).abs();
        match height > doubt {
            true => (true, height - doubt),
            false => (false, -height - doubt),
        }
    }
}

/// Whether the triangle may block the way from `point` on it to the light, give or take `margin`. The eye is where the ray
/// came from that hit it there, and `E` is at least `extent`.
pub(super) fn may_block(
    corners: &[DVec3; 3],
    [point, light, eye]: [DVec3; 3],
    [extent, margin]: [f64; 2],
) -> bool {
    let plane = Plane::of(corners, point);
    let (is_sure, above) = plane.height(light);
    let is_moved = is_sure || plane.height(eye).0;
    let offset = 4.0 * ulp(largest(point)) + 32.0 * ulp(extent.max(plane.extent));
    let start = match is_moved {
        true => offset * (1.0 - 4.0 * plane.lean) - plane.near,
        false => 0.0,
    };
    let from = match start > 0.0 {
        true => start / (start - above.min(0.0)),
        false => 0.0,
    };
    distance_to_triangle(point.lerp(light, from), corners) <= margin
}
