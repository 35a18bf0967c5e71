//! Checks whether a result is within rounding of the exact one, for backends whose driver determines hits.
//!
//! The Vulkan specification (chapter *Ray Traversal*) leaves the precision of a driver's intersections open. It
//! requires only that they use single-precision arithmetic on the given numbers, and that rays cannot pass through
//! shared edges. So a ray may be shifted by up to [`ULPS`] units in the last place of the largest coordinate involved.
//! Every result that such a shift explains is accepted, and no other. This module computes in double precision, whose
//! own rounding is negligible.

mod itself;

use crate::stage;
use geom::{Animation, Hit, Point, Ray, is_active};
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

/// Maximum shift in units in the last place (`2^-24` of the largest coordinate). The transform by an instance, the
/// shift to the ray's origin, the shear and the edge functions are about 16 roundings. This is twice that.
const ULPS: f64 = 32.0;

/// Range of sizes in which products of three coordinates neither overflow nor underflow in single precision.
const TAME: [f64; 2] = [1e-9, 1e9];

/// The triangles of a scene at one time.
pub(crate) struct Verifier {
    /// Active triangles, by index.
    triangles: BTreeMap<u32, [DVec3; 3]>,
    /// Largest coordinate of all triangles.
    size: f64,
    /// Longest box edge of the first key frame and of all key frames. Backends offset shadow rays by a length between
    /// the two.
    extents: [f64; 2],
    /// Factor from scene units to scaled units.
    scale: f64,
}

/// A ray in double precision.
struct Line {
    origin: DVec3,
    direction: DVec3,
    t_min: f64,
    t_max: f64,
    /// Maximum distance by which the ray may be shifted.
    margin: f64,
}

/// Intersection of a ray with a triangle that it does not certainly miss.
///
/// Contains the approximate `t`, its maximum error, and whether the triangle is certainly hit.
struct Meeting {
    t: f64,
    slack: f64,
    surely: bool,
}

impl Verifier {
    pub(crate) fn new(animation: &Animation, time: f64) -> Self {
        let all = (0..).zip(stage::triangles(animation, time));
        let active = all.filter(|(_, corners)| is_active(corners));
        let triangles: BTreeMap<_, _> = active.map(|(i, c)| (i, c.map(wide))).collect();
        let sizes = triangles.values().flat_map(|c| c.map(largest));
        let bounds = [animation.key_bounds()[0], animation.bounds()];
        Self {
            size: sizes.fold(0.0, f64::max),
            triangles,
            extents: bounds.map(|b| largest(wide(b.extent()))),
            scale: (-f64::from(animation.scale_exponent())).exp2(),
        }
    }

    /// Returns whether results for the ray are determined in single precision (see [`TAME`]) and defined for drivers,
    /// which ignore hits behind a ray's origin.
    pub(crate) fn admits(&self, ray: &Ray) -> bool {
        let tame = |x: f64| (TAME[0]..=TAME[1]).contains(&x);
        let size = self.size.max(largest(wide(ray.origin)));
        ray.is_valid() && ray.t_min >= 0.0 && tame(size) && tame(largest(wide(ray.direction)))
    }

    fn line(&self, ray: &Ray) -> Line {
        let origin = wide(ray.origin);
        Line {
            origin,
            direction: wide(ray.direction),
            t_min: f64::from(ray.t_min),
            t_max: f64::from(ray.t_max),
            margin: ULPS * ulp(self.size.max(largest(origin))),
        }
    }

    /// Returns why `hit` cannot be the closest hit of the ray, or `None` if it may be.
    pub(crate) fn refutes(&self, ray: &Ray, hit: &Hit) -> Option<String> {
        let line = self.line(ray);
        if hit.is_hit()
            && let Some(why) = self.refutes_hit(&line, hit)
        {
            return Some(why);
        }
        self.triangles.iter().find_map(|(i, corners)| {
            let Meeting { t, slack, surely } = line.meets(corners)?;
            let nearer = !hit.is_hit() || t + slack < f64::from(hit.t);
            let text = || format!("triangle {i} is surely hit at {t:?}, give or take {slack:e}");
            (surely && *i != hit.triangle && nearer).then(text)
        })
    }

    /// Returns why the reported triangle cannot be hit with the reported `t`, `u` and `v`, or `None` if it may be.
    fn refutes_hit(&self, line: &Line, hit: &Hit) -> Option<String> {
        let i = hit.triangle;
        let Some(corners) = self.triangles.get(&i) else {
            return Some(format!("triangle {i} is not there"));
        };
        let Some(Meeting { t, slack, .. }) = line.meets(corners) else {
            return Some(format!("triangle {i} is surely missed"));
        };
        let reported = f64::from(hit.t);
        if (reported - t).abs() > slack + 4.0 * ulp(t) {
            return Some(format!("t should be {t:?}, give or take {slack:e}"));
        }
        let (_, height) = line.inside(corners.map(|p| p - line.origin));
        let allowed = slack * line.direction.length() + line.blur(height) * longest_edge(corners);
        let at = line.origin + reported * line.direction;
        let off = (at - point_at(corners, hit)).length();
        let is_far = off > allowed + 2.0 * line.margin;
        is_far.then(|| format!("u and v are off by {off:e}, more than {allowed:e}"))
    }

    /// Returns why a ray cannot be `blocked`, or cannot be unblocked, or `None` if it may be.
    pub(crate) fn refutes_any(&self, ray: &Ray, blocked: bool) -> Option<String> {
        self.refutes_line(&self.line(ray), blocked, None)
    }

    /// Returns why the shadow ray from a hit to a light cannot be `blocked`, or cannot be unblocked, or `None` if it
    /// may be.
    ///
    /// Ignores the triangle that was hit, whose surface the shadow ray leaves as defined in `docs/design/hits.md`,
    /// "Shadow rays". A driver also tests that triangle: see [`itself`].
    pub(crate) fn refutes_shadow(
        &self,
        ray: &Ray,
        hit: &Hit,
        light: Point,
        blocked: bool,
    ) -> Option<String> {
        if !hit.is_hit() {
            return blocked.then(|| "a miss is in no shadow".to_owned());
        }
        let corners = self.triangles.get(&hit.triangle)?;
        let (origin, light) = (point_at(corners, hit), wide(light));
        let reach = self.size.max(largest(light));
        let margin = ULPS * ulp(reach);
        // Nothing is certain if the shadow ray is not longer than rounding errors, or if the weights of a tiny triangle
        // are NaN.
        let length = (light - origin).length();
        if length.is_nan() || length <= margin {
            return None;
        }
        let ([extent, most], scale) = (self.extents, self.scale);
        let triangle = corners.map(|p| scale * p);
        let way = [origin, light, wide(ray.origin)].map(|p| scale * p);
        if blocked && itself::may_block(&triangle, way, [extent, margin].map(|x| scale * x)) {
            return None;
        }
        let off_surface = 8.0 * ulp(reach) + 64.0 * ulp(most);
        let line = Line {
            origin,
            direction: light - origin,
            t_min: 0.0,
            t_max: 1.0,
            margin: margin + off_surface,
        };
        self.refutes_line(&line, blocked, Some(hit.triangle))
    }

    fn refutes_line(&self, line: &Line, blocked: bool, but: Option<u32>) -> Option<String> {
        let asked = self.triangles.iter().filter(|(i, _)| Some(**i) != but);
        let mut met = asked.filter_map(|(i, corners)| Some((i, line.meets(corners)?)));
        if blocked {
            let free = met.next().is_none();
            return free.then(|| "every triangle is surely missed".to_owned());
        }
        let (i, at) = met.find(|(_, at)| at.surely)?;
        Some(format!("triangle {i} is surely in the way, at {:?}", at.t))
    }
}

impl Line {
    /// Returns `None` if the line misses the triangle by more than the margin.
    fn meets(&self, corners: &[DVec3; 3]) -> Option<Meeting> {
        let from_origin = corners.map(|p| p - self.origin);
        let (inside, height) = self.inside(from_origin);
        let (t, slack) = self.about(from_origin, height);
        let off = t + slack < self.t_min || t - slack > self.t_max;
        let within = t - slack > self.t_min && t + slack < self.t_max;
        let surely = inside > self.margin && within;
        (inside >= -self.margin && !off).then_some(Meeting { t, slack, surely })
    }

    /// Returns `t` of the triangle along the line, and its maximum error.
    ///
    /// The depths of the corners have an error of at most the margin. They are interpolated by weights, whose error
    /// grows as the triangle appears narrower.
    fn about(&self, corners: [DVec3; 3], height: f64) -> (f64, f64) {
        let square = self.direction.length_squared();
        let depths = corners.map(|p| p.dot(self.direction) / square);
        let (low, high) = (least(depths), most(depths));
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a);
        let t = normal.dot(a) / normal.dot(self.direction);
        let t = if t.is_finite() { t } else { low };
        let slack = 2.0 * self.margin / square.sqrt() + self.blur(height) * (high - low);
        (t.clamp(low, high), slack)
    }

    /// Returns the maximum error of the weights of a triangle that is `height` high in projection.
    fn blur(&self, height: f64) -> f64 {
        match height > 0.0 {
            true => (4.0 * self.margin / height).min(1.0),
            false => 1.0,
        }
    }

    /// Returns the distance by which the line passes inside the triangle, which is negative outside, and a height.
    ///
    /// The height is the least height of the triangle in projection along the line.
    fn inside(&self, corners: [DVec3; 3]) -> (f64, f64) {
        let (x, y) = self.direction.normalize().any_orthonormal_pair();
        let [a, b, c] = corners.map(|p| DVec2::new(p.dot(x), p.dot(y)));
        let area = (b - a).perp_dot(c - a);
        let edges = [[a, b], [b, c], [c, a]];
        let height = area.abs() / most(edges.map(|[p, q]| (q - p).length()));
        let depth = edges.map(|[p, q]| p.perp_dot(q) * area.signum() / (q - p).length());
        let depth = least(depth);
        if depth > 0.0 && area != 0.0 {
            return (depth, height);
        }
        let outside = edges.map(|[p, q]| to_segment(p.extend(0.0), q.extend(0.0)));
        (-least(outside), height)
    }
}

/// Returns the distance from a point to a closed triangle.
fn distance_to_triangle(p: DVec3, corners: &[DVec3; 3]) -> f64 {
    let [a, b, c] = corners.map(|q| q - p);
    let normal = (b - a).cross(c - a);
    let edges = [[a, b], [b, c], [c, a]];
    // True if the point projects to the interior, from either side of the plane.
    if edges.iter().all(|[q, r]| q.cross(*r).dot(normal) > 0.0) {
        return a.dot(normal.normalize()).abs();
    }
    least(edges.map(|[q, r]| to_segment(q, r)))
}

/// Returns the distance from the origin to a segment.
fn to_segment(p: DVec3, q: DVec3) -> f64 {
    let way = q - p;
    let square = way.length_squared();
    let s = match square > 0.0 {
        true => (-p.dot(way) / square).clamp(0.0, 1.0),
        false => 0.0,
    };
    (p + s * way).length()
}

fn point_at([a, b, c]: &[DVec3; 3], hit: &Hit) -> DVec3 {
    a + (f64::from(hit.u) * (b - a) + f64::from(hit.v) * (c - a))
}

fn longest_edge([a, b, c]: &[DVec3; 3]) -> f64 {
    most([b - a, c - b, a - c].map(DVec3::length))
}

fn least(all: [f64; 3]) -> f64 {
    all.into_iter().fold(f64::INFINITY, f64::min)
}

fn most(all: [f64; 3]) -> f64 {
    all.into_iter().fold(f64::NEG_INFINITY, f64::max)
}

fn wide(p: Point) -> DVec3 {
    DVec3::from(p.map(f64::from))
}

/// Returns the largest `|coordinate|`.
fn largest(p: DVec3) -> f64 {
    p.abs().max_element()
}

fn ulp(x: f64) -> f64 {
    x.abs() * f64::from(f32::EPSILON / 2.0)
}

#[cfg(test)]
mod tests;
