//! Intersector `exact`: single precision with proven error bounds, and integers where the bounds do not suffice.
//!
//! The single-precision part is a floating-point filter (Shewchuk 1997). It bounds the errors of the watertight test's
//! intermediate results. The bounds and their proof are in `docs/design/hits.md`.

use crate::intersect::{Watertight, solve};
use crate::scale::{Limits, MIN_NONZERO, PreparedRay};
use crate::search::RaySearch;
use crate::traversal::VisitedTriangle;
use geom::exact::{ExactDistance, RoundedHit};
use geom::{Hit, is_active, is_degenerate};
use std::cmp::Ordering;

/// Bound on the error of a sheared coordinate relative to the magnitude of its terms, `9.5 * 2^-24`.
pub const SHEAR_ERROR: f32 = 9.5 / 16_777_216.0;
/// Bound on the rounding errors of `t`, relative to the largest depth, `32 * 2^-24`.
pub const T_ERROR: f32 = 32.0 / 16_777_216.0;
/// Bound on the error from flushing small numbers to zero, `2^-60`.
pub const FILTER_UNDERFLOW_ERROR: f32 = f32::from_bits((127 - 60) << 23);

/// A triangle that the filter does not reject.
#[derive(Clone, Copy, Debug)]
struct PossibleHit {
    triangle: u32,
    /// Set if the hit is certain and within the ray's limits.
    is_certain: bool,
    /// Interval `low..=high` of the exact `t`, if the triangle is hit.
    low: f32,
    high: f32,
}

/// A ray, prepared for the filter.
struct FilterRay {
    ray: PreparedRay,
    test: Watertight,
    /// See [`PreparedRay::sure_limits`].
    limits: Limits,
}

impl RaySearch<'_> {
    pub(crate) fn closest_exact(&self) -> Option<Hit> {
        let ray = FilterRay::new(self)?;
        let mut possible = Vec::new();
        self.tree.traverse(&ray.ray, &mut |visited, bound| {
            let hit = ray.filter(visited).filter(|hit| hit.low <= bound);
            possible.extend(hit);
            let certain = hit.filter(|hit| hit.is_certain);
            Some(certain.map_or(bound, |hit| bound.min(hit.high)))
        });
        let certain = possible.iter().filter(|hit| hit.is_certain);
        let bound = certain.fold(ray.ray.t_max, |bound, hit| bound.min(hit.high));
        possible.retain(|hit| hit.low <= bound);
        match possible[..] {
            [] => None,
            [only] if only.is_certain => self.certain_hit(only.triangle),
            _ => {
                self.count_exact();
                let (line, first) = (self.exact_ray(), self.first(&possible)?);
                let rounded = line.rounded(&self.geometry.corners(first))?;
                Some(hit(first, rounded))
            }
        }
    }

    /// Returns whether the ray hits any triangle except `skipped`.
    pub(crate) fn any_exact(&self, skipped: Option<u32>) -> bool {
        let Some(ray) = FilterRay::new(self) else {
            return false;
        };
        let mut possible = Vec::new();
        let is_hit = self.tree.traverse(&ray.ray, &mut |visited, bound| {
            let is_other = Some(visited.triangle) != skipped;
            let hit = ray.filter(visited).filter(|_| is_other);
            possible.extend(hit);
            (!hit.is_some_and(|hit| hit.is_certain)).then_some(bound)
        });
        if is_hit || possible.is_empty() {
            return is_hit;
        }
        self.count_exact();
        let mut possible = possible.iter();
        possible.any(|hit| self.crossing(hit.triangle).is_some())
    }

    /// Returns the hit of a triangle that the ray certainly hits. `t`, `u` and `v` are rounded once.
    pub fn certain_hit(&self, triangle: u32) -> Option<Hit> {
        let (line, corners) = (self.exact_ray(), self.geometry.corners(triangle));
        let rounded = line.try_rounded(&corners).or_else(|| {
            self.count_exact();
            line.rounded(&corners)
        });
        Some(hit(triangle, rounded?))
    }

    /// Returns the triangle that the ray hits at the least exact `t`. Of several with this `t`, the least index.
    fn first(&self, possible: &[PossibleHit]) -> Option<u32> {
        let possible = possible.iter().map(|hit| hit.triangle);
        let crossings = possible.filter_map(|t| Some((self.crossing(t)?, t)));
        let first = crossings.reduce(|a, b| {
            let order = a.0.order(&b.0).then(a.1.cmp(&b.1));
            if order.is_gt() { b } else { a }
        });
        Some(first?.1)
    }

    /// Returns the exact distance to a triangle, or `None` if the ray does not hit it.
    ///
    /// With `watertight`, the ray is perturbed: see [`geom::exact::ExactRay::intersect_perturbed`].
    pub(crate) fn crossing(&self, triangle: u32) -> Option<ExactDistance> {
        let (line, corners) = (self.exact_ray(), self.geometry.corners(triangle));
        if !is_active(&corners) || is_degenerate(&corners) {
            return None;
        }
        if self.intersector.is_exact() {
            line.intersect(&corners)
        } else {
            line.intersect_perturbed(&corners)
        }
    }
}

fn hit(triangle: u32, RoundedHit { t, u, v }: RoundedHit) -> Hit {
    Hit { t, u, v, triangle }
}

impl FilterRay {
    fn new(search: &RaySearch<'_>) -> Option<Self> {
        let ray = PreparedRay::new(&search.ray, search.scale)?;
        Some(Self {
            test: Watertight::new(&ray),
            limits: ray.sure_limits(),
            ray,
        })
    }

    /// Tests a triangle in rounded arithmetic. Returns `None` for a certain miss.
    fn filter(&self, visited: &VisitedTriangle<'_>) -> Option<PossibleHit> {
        let sheared = self.test.sheared(visited.data);
        let edges = sheared.edges();
        let wide = largest(sheared.x).max(largest(sheared.y));
        let slack = SHEAR_ERROR * (wide + 2.0 * largest(sheared.along)) + FILTER_UNDERFLOW_ERROR;
        let doubt = slack * (4.0 * wide + 2.0 * slack);
        let (least, most) = (least(edges), greatest(edges));
        if least < -doubt && most > doubt {
            return None;
        }
        let is_inside =
            (least > doubt || most < -doubt) && edges.iter().all(|edge| edge.is_finite());
        let depths = self.test.depths(&sheared);
        let own_box = [visited.entry, visited.exit];
        let [low, high] = is_inside
            .then(|| interval_of_t(edges, depths, doubt))
            .flatten()
            .map(|[low, high]| [visited.entry.max(low), visited.exit.min(high)])
            .filter(|[low, high]| low <= high)
            .unwrap_or(own_box);
        let Limits { after, before } = self.limits;
        Some(PossibleHit {
            triangle: visited.triangle,
            is_certain: is_inside && low > after && high < before,
            low,
            high,
        })
    }
}

/// Returns an interval around the rounded `t` that contains the exact `t` of a certain hit. Returns `None` if the error
/// has no useful bound. `doubt` bounds the error of each edge function.
fn interval_of_t(edges: [f32; 3], depths: [f32; 3], doubt: f32) -> Option<[f32; 2]> {
    let least_det = (edges[0] + edges[1] + edges[2]).abs() - 4.0 * doubt;
    if least_det.partial_cmp(&(4.0 * doubt)) != Some(Ordering::Greater) {
        return None;
    }
    let spread = greatest(depths) - least(depths);
    let size = largest(depths);
    let of_weights = 3.0 * (doubt * spread + MIN_NONZERO * (1.0 + size)) / least_det;
    let error = of_weights + T_ERROR * size + FILTER_UNDERFLOW_ERROR;
    let t = solve(&edges, &depths).t;
    Some([t - error, t + error])
}

fn largest([a, b, c]: [f32; 3]) -> f32 {
    a.abs().max(b.abs()).max(c.abs())
}

fn greatest([a, b, c]: [f32; 3]) -> f32 {
    a.max(b).max(c)
}

fn least([a, b, c]: [f32; 3]) -> f32 {
    a.min(b).min(c)
}
