//! Exact arithmetic for rays and moments outside the range of single precision (`docs/design/hits.md`, "Extreme rays").
//!
//! Boxes are tested in double precision, in which no quotient overflows or underflows.

use crate::geometry::Geometry;
use crate::search::RaySearch;
use crate::traversal::Child;
use geom::exact::ExactDistance;
use geom::{Aabb, Hit, Point, Ray, Triangle, normal_signs, side_of};
use std::cmp::Ordering;

/// Returns whether a ray from `origin`, in the scene's units, is extreme. `watertight` and `exact` trace such rays in
/// exact arithmetic.
#[inline]
pub fn is_extreme(geometry: &Geometry<'_>, origin: Point) -> bool {
    geometry.range.is_extreme(geometry.scale.apply(origin))
}

impl RaySearch<'_> {
    /// Returns the hit with the least `t`, then the least index. `t` and weights are rounded once.
    #[cold]
    pub(crate) fn closest_extreme(&self) -> Option<Hit> {
        self.count_exact();
        let mut best: Option<(ExactDistance, u32)> = None;
        self.visit(|triangle, bound| {
            let crossing = self.crossing(triangle)?;
            let is_first = best.as_ref().is_none_or(|(first, index)| {
                let order = self.order(&crossing, first);
                order.then(triangle.cmp(index)).is_lt()
            });
            if is_first {
                *bound = bound.min(f64::from(crossing.t().next_up()));
                best = Some((crossing, triangle));
            }
            None::<()>
        });
        let (crossing, triangle) = best?;
        let [u, v] = self.exact_ray().weights(&self.geometry.corners(triangle));
        let t = crossing.t();
        Some(Hit { t, u, v, triangle })
    }

    /// Returns whether the ray meets any triangle except `skipped`.
    #[cold]
    pub(crate) fn any_extreme(&self, skipped: Option<u32>) -> bool {
        self.count_exact();
        let found = self.visit(|triangle, _| {
            let is_other = Some(triangle) != skipped;
            is_other.then(|| self.crossing(triangle)).flatten()
        });
        found.is_some()
    }

    fn order(&self, a: &ExactDistance, b: &ExactDistance) -> Ordering {
        if self.intersector.is_exact() {
            a.order(b)
        } else {
            a.t().total_cmp(&b.t())
        }
    }

    /// Calls `see` for each triangle in a box that the ray enters no later than the bound. Visits the children of each
    /// node in order of entry. The bound is `t_max` at first, and `see` may reduce it. Returns the first result of
    /// `see` that is `Some`.
    fn visit<T>(&self, mut see: impl FnMut(u32, &mut f64) -> Option<T>) -> Option<T> {
        let Self { tree, ray, .. } = self;
        if !ray.is_valid() {
            return None;
        }
        let mut bound = f64::from(ray.t_max);
        let unit = f64::from(self.geometry.scale.k()).exp2();
        let mut stack = vec![(f64::NEG_INFINITY, Child::Node(0))];
        while let Some((entered, child)) = stack.pop() {
            if entered > bound {
                continue;
            }
            match child {
                Child::Node(node) => {
                    let first = stack.len();
                    tree.children(node, &mut |bounds, child| {
                        let entry = entry(bounds, unit, ray, bound);
                        stack.extend(entry.map(|entry| (entry, child)));
                    });
                    stack[first..].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
                }
                Child::Triangle(triangle) => {
                    let found = see(triangle, &mut bound);
                    if found.is_some() {
                        return found;
                    }
                }
            }
        }
        None
    }
}

/// Returns a lower bound on the `t` at which a ray enters a scaled box. Returns `None` if the ray misses the box or
/// enters it after `bound`. A scaled unit is `unit` scene units.
///
/// The box is converted to the scene's units. It then also contains the original positions of points with coordinates
/// that scaling flushed to zero or turned into infinity. Each quotient has two roundings, so its relative error is
/// below `4 * 2^-53`.
fn entry(scaled: &Aabb, unit: f64, ray: &Ray, bound: f64) -> Option<f64> {
    // A plane at zero may represent a coordinate that was flushed to zero: see `Scale`.
    let plane = |x: f32, if_zero: f64| unit * if x == 0.0 { if_zero } else { f64::from(x) };
    let least = (-64.0_f64).exp2();
    let (mut low, mut high) = (f64::from(ray.t_min), bound);
    for axis in 0..3 {
        let [o, d] = [ray.origin, ray.direction].map(|v| f64::from(v[axis]));
        // An infinite coordinate represents one that is beyond `f32::MAX` scaled units.
        let min = plane(scaled.min[axis].min(f32::MAX), -least);
        let max = plane(scaled.max[axis].max(-f32::MAX), least);
        if min > max {
            return None;
        }
        if d == 0.0 {
            if o < min || o > max {
                return None;
            }
            continue;
        }
        let [p, q] = [min, max].map(|x| (x - o) / d);
        let (near, far) = if d > 0.0 { (p, q) } else { (q, p) };
        low = low.max(near - 2.0 * f64::EPSILON * near.abs());
        high = high.min(far + 2.0 * f64::EPSILON * far.abs());
    }
    (low <= high).then_some(low)
}

/// Returns the shadow ray from a hit of `ray` to a light, with `t` in `(0, 2)`, in the scene's units.
///
/// The [hit point](hit_point) is moved to the light's side of the triangle. Before rounding, it moves by at least its
/// error bound along each axis where the normal is not zero. The direction is half the vector to the light, which
/// cannot overflow.
pub(crate) fn shadow_ray(ray: &Ray, hit: &Hit, corners: &Triangle, light: Point) -> Ray {
    let (point, error) = hit_point(ray, hit, corners);
    let side = match side_of(corners, light) {
        0 => side_of(corners, ray.origin),
        side => side,
    };
    // 2^-147, four times the smallest positive number.
    let delta = error.max(f32::from_bits(4));
    let signs = normal_signs(corners);
    let origin: Point =
        std::array::from_fn(|i| saturated(point[i] + (side * signs[i]) as f32 * delta));
    Ray {
        t_max: 2.0,
        ..Ray::new(
            origin,
            std::array::from_fn(|i| 0.5 * light[i] - 0.5 * origin[i]),
        )
    }
}

/// Returns the point where a ray hits, and a bound on the error of each coordinate.
///
/// Computes the point along the ray. If the largest `|coordinate|` of the origin and of `t * direction` is at least
/// four times that of the corners, computes the point from the corners, because the error is then smaller.
fn hit_point(ray: &Ray, hit: &Hit, corners: &Triangle) -> (Point, f32) {
    const UNIT: f32 = 1.0 / 16_777_216.0;
    let offset: Point = std::array::from_fn(|i| saturated(hit.t * ray.direction[i]));
    let along = largest(&[ray.origin, offset]);
    let within = largest(corners);
    if saturated(4.0 * within) > along {
        let point: Point = std::array::from_fn(|i| saturated(ray.origin[i] + offset[i]));
        return (point, 4.0 * UNIT * along.max(largest(&[point])));
    }
    let [a, b, c] = corners;
    let point = std::array::from_fn(|i| {
        let by_u = saturated(hit.u * saturated(b[i] - a[i]));
        let by_v = saturated(hit.v * saturated(c[i] - a[i]));
        saturated(a[i] + saturated(by_u + by_v))
    });
    (point, 12.0 * UNIT * within)
}

fn largest(points: &[Point]) -> f32 {
    let sizes = points.iter().flatten().map(|x| x.abs());
    sizes.fold(0.0, f32::max)
}

/// Replaces an infinite number by the largest finite number of the same sign.
fn saturated(x: f32) -> f32 {
    x.clamp(-f32::MAX, f32::MAX)
}
