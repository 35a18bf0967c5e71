//! Exact arithmetic for rays and moments outside the range of rounded tests (`docs/design/hits.md`, "Extreme rays").
//!
//! Boxes are tested in double precision, whose range holds every product that is needed here.

use crate::Geometry;
use crate::intersect::Asked;
use crate::traverse::{Below, Tree};
use geom::exact::{ExactDistance, Line};
use geom::{Aabb, Hit, Point, Ray, Triangle, is_active, is_degenerate, normal_signs, side_of};
use std::cmp::Ordering;
use std::sync::atomic::Ordering::Relaxed;

/// The definition of a hit for extreme rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// The rule of `exact`: triangles are closed, the exact `t` orders hits, and the limits apply to the rounded `t`.
    Closed,
    /// The rule of `watertight`: the ray moves by an infinitesimal offset. Order and limits apply to the rounded `t`.
    Moved,
}

/// Returns the hit with the least `t`, then the least index. `t` and weights are rounded once.
#[cold]
#[inline(never)]
pub fn closest<N: Tree>(asked: &Asked<'_, N>, rule: Rule) -> Option<Hit> {
    let line = line(asked)?;
    let mut best: Option<(ExactDistance, u32)> = None;
    let mut bound = f64::from(asked.ray.t_max);
    visit(asked, &mut bound, |triangle, bound| {
        let Some(crossing) = rule.meet(&asked.geometry, &line, triangle) else {
            return false;
        };
        let is_first = best.as_ref().is_none_or(|(first, index)| {
            rule.order(&crossing, first)
                .then(triangle.cmp(index))
                .is_lt()
        });
        if is_first {
            *bound = bound.min(f64::from(crossing.t().next_up()));
            best = Some((crossing, triangle));
        }
        false
    });
    let (crossing, triangle) = best?;
    let [u, v] = line.weights(&asked.geometry.corners(triangle));
    let t = crossing.t();
    Some(Hit { t, u, v, triangle })
}

impl Rule {
    pub(crate) fn meet(
        self,
        geometry: &Geometry<'_>,
        line: &Line,
        triangle: u32,
    ) -> Option<ExactDistance> {
        let corners = geometry.corners(triangle);
        if !is_active(&corners) || is_degenerate(&corners) {
            return None;
        }
        match self {
            Self::Closed => line.intersect(&corners),
            Self::Moved => {
                let within = |t: f32| line.ray.t_min < t && t < line.ray.t_max;
                line.intersect_perturbed(&corners).filter(|c| within(c.t()))
            }
        }
    }

    fn order(self, a: &ExactDistance, b: &ExactDistance) -> Ordering {
        match self {
            Self::Closed => a.order(b),
            Self::Moved => a.t().total_cmp(&b.t()),
        }
    }
}

/// Returns whether the ray meets any triangle except `skipped`.
#[cold]
#[inline(never)]
pub fn any<N: Tree>(asked: &Asked<'_, N>, rule: Rule, skipped: Option<u32>) -> bool {
    let Some(line) = line(asked) else {
        return false;
    };
    let mut bound = f64::from(asked.ray.t_max);
    visit(asked, &mut bound, |triangle, _| {
        Some(triangle) != skipped && rule.meet(&asked.geometry, &line, triangle).is_some()
    })
}

fn line<N: Tree>(asked: &Asked<'_, N>) -> Option<Line> {
    asked.settled.fetch_add(1, Relaxed);
    asked.ray.is_valid().then(|| asked.line())
}

/// Calls `see` for each triangle whose box the ray meets before `bound`, nearer boxes first. Ends when `see` returns
/// `true`.
fn visit<N: Tree>(
    asked: &Asked<'_, N>,
    bound: &mut f64,
    mut see: impl FnMut(u32, &mut f64) -> bool,
) -> bool {
    let tree = asked.tree;
    let unit = f64::from(asked.geometry.scale.k()).exp2();
    let mut stack = vec![(f64::NEG_INFINITY, Below::ROOT)];
    while let Some((entered, below)) = stack.pop() {
        if entered > *bound {
            continue;
        }
        match below {
            Below::Node(node) => {
                let first = stack.len();
                tree.children(node, |bounds, child| {
                    let entry = entry(&asked.ray, (bounds, unit), *bound);
                    stack.extend(entry.map(|entry| (entry, child)));
                });
                stack[first..].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
            }
            Below::Places { first, count } => {
                let mut places = first..first + count;
                if places.any(|p| tree.triangle(p).is_some_and(|t| see(t, bound))) {
                    return true;
                }
            }
        }
    }
    false
}

/// Returns a lower bound on the `t` of the ray's points in the box, within its limits, or `None` if the ray misses the
/// box. The box is in units of `unit`.
///
/// A quotient of a difference is rounded twice, so its relative error is below `4 * 2^-53`.
fn entry(ray: &Ray, (bounds, unit): (&Aabb, f64), bound: f64) -> Option<f64> {
    if bounds.is_empty() {
        return None;
    }
    let (mut low, mut high) = (f64::from(ray.t_min), bound);
    for axis in 0..3 {
        let [o, d] = [ray.origin, ray.direction].map(|v| f64::from(v[axis]));
        // A plane at zero may represent a coordinate that was flushed to zero: see `Scale`.
        let plane = |x: f32, outward: f64| match x == 0.0 {
            true => outward * (-64.0_f64).exp2() * unit,
            false => f64::from(x) * unit,
        };
        let planes = [plane(bounds.min[axis], -1.0), plane(bounds.max[axis], 1.0)];
        if d == 0.0 {
            if o < planes[0] || o > planes[1] {
                return None;
            }
            continue;
        }
        let [p, q] = planes.map(|x: f64| (x - o) / d);
        let (near, far) = if d > 0.0 { (p, q) } else { (q, p) };
        low = low.max(near - 2.0 * f64::EPSILON * near.abs());
        high = high.min(far + 2.0 * f64::EPSILON * far.abs());
    }
    (low <= high).then_some(low)
}

/// Returns the shadow ray from a hit of `ray` to a light, over `t` in `(0, 2)`, in the scene's units.
///
/// The hit point is computed along the ray or within the triangle, whichever has the smaller error. It is then moved to
/// the light's side of the triangle by at least that error. The direction is half the vector to the light, which cannot
/// overflow.
pub fn shadow_ray(ray: &Ray, hit: &Hit, corners: &Triangle, light: Point) -> Ray {
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
fn hit_point(ray: &Ray, hit: &Hit, corners: &Triangle) -> (Point, f32) {
    const UNIT: f32 = 1.0 / 16_777_216.0;
    let way: Point = std::array::from_fn(|i| saturated(hit.t * ray.direction[i]));
    let along = largest(&[ray.origin, way]);
    let within = largest(corners);
    if saturated(4.0 * within) > along {
        let point: Point = std::array::from_fn(|i| saturated(ray.origin[i] + way[i]));
        return (point, 4.0 * UNIT * along.max(largest(&[point])));
    }
    let [a, b, c] = corners;
    let point = std::array::from_fn(|i| a[i] + (hit.u * (b[i] - a[i]) + hit.v * (c[i] - a[i])));
    (point, 12.0 * UNIT * within)
}

fn largest(points: &[Point]) -> f32 {
    let sizes = points.iter().flatten().map(|x| x.abs());
    sizes.fold(0.0, f32::max)
}

/// Replaces an infinite number by the largest finite one of its sign.
fn saturated(x: f32) -> f32 {
    x.clamp(-f32::MAX, f32::MAX)
}
