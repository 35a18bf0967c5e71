//! Checks whether rounding may cause a triangle to block the shadow ray from a point on itself to the light. A driver
//! also tests that triangle. Only the offset of `docs/design/hits.md` ("Shadow rays") keeps the shadow ray off it.
//!
//! Let `u = 2^-24`, `L` be the longest edge, `N` the normal, and `p` and `E` as there. All quantities are in scaled
//! units. Each component of the computed `N` is a difference of two products, each with an error of `3 u`. So `N` is
//! tilted by at most `6 u L^2 / |N|`.
//!
//! - On the triangle, heights above its plane have an error of `11 u L + u L^3 / |N| + 4 u |p|`. The point `p` and its
//!   move contribute `3 u L` and `3.5 u |p|`. The sheared corners of a driver's watertight test contribute `8 u L`.
//!   Products in its weights contribute `3 u |a| |b| |c| / |N|`, with the corners relative to `p`: at most
//!   `u L^3 / |N|`.
//! - At a distance `D` from `p`, heights have that error, plus the tilt times `D`, plus `4 u D` for difference and
//!   product.
//! - Up to `2^-98 / |N|` is lost in addition, as tilt and as height, where products count as zero.
//!
//! A point whose height exceeds its error is on a certain side of the plane. If the light or else the eye is on a
//! certain side, the start moves off the plane. It moves by at least the offset minus the first of these errors. The
//! shadow ray is straight, so the least heights of its ends determine the earliest point at which it may cross the
//! plane. The triangle blocks it only if it extends to that point.

use super::{distance_to_triangle, largest, longest_edge, ulp};
use glam::DVec3;

/// Error from products below `2^-100`, which count as zero.
const LOST: f64 = 4.0 / (1_u128 << 100) as f64;

/// The plane of a triangle, with one of its points as origin.
struct Plane {
    point: DVec3,
    normal: DVec3,
    /// Maximum tilt of the normal.
    lean: f64,
    /// Longest edge of the triangle along an axis, which is a lower bound of `E`.
    extent: f64,
    /// Maximum error of heights on the triangle.
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

    /// Returns whether the side of a point is certain, and its least possible height above the plane on the side of the
    /// start.
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

/// Returns whether the triangle may block the shadow ray from `point` on it to the light, within `margin`.
///
/// The eye is the origin of the ray that hit the triangle at `point`. `E` is at least `extent`.
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
