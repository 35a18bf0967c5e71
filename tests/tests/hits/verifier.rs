//! Judges a watertight answer by the exact one.
//!
//! `watertight` answers for a ray within rounding of the given one, so it may
//! name a neighbour, but only where the exact ray passes within that rounding
//! of an edge, or where distances are so near (to each other, or to the ray's
//! limits) that rounding cannot tell them apart. Everything else is wrong.

use conformance::oracle::{ExactHit, Oracle};
use geom::{Hit, Ray, Triangle};

/// `2^-24`.
const U: f64 = f32::EPSILON as f64 / 2.0;

/// The answer moves the ray by at most 8 roundings of the reach on each of the
/// two axes across it: less than 12 in all.
const SIDEWAYS: f64 = 12.0;

/// How an answer relates to the exact one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Verdict {
    /// The same triangle, or a miss on both sides.
    Same,
    /// Another answer, because the exact ray passes within rounding of an edge.
    NearEdge,
    /// Another answer, because distances are within rounding of each other or of a limit.
    NearTie,
    /// Not to be explained.
    Wrong(String),
}

/// A scene at rest, and the oracle over it.
pub(crate) struct Verifier {
    corners: Vec<Triangle>,
    oracle: Oracle,
}

impl Verifier {
    /// Over triangles in the order of their indices.
    pub(crate) fn new(corners: Vec<Triangle>) -> Self {
        let oracle = Oracle::new(corners.clone());
        Self { corners, oracle }
    }

    /// The exact answer.
    pub(crate) fn exact(&self, ray: &Ray) -> Option<ExactHit> {
        self.oracle.closest(ray)
    }

    /// Judges what `watertight` found.
    pub(crate) fn verify(&self, ray: &Ray, found: &Hit) -> Verdict {
        let exact = self.exact(ray);
        let verdict = match (found.is_hit(), exact) {
            (false, None) => Some(Verdict::Same),
            (false, Some(_)) => self.judge_miss(ray),
            (true, None) => self.excuse(ray, found.triangle),
            (true, Some(e)) if e.triangle == found.triangle => {
                self.distance_holds(ray, found, &e).then_some(Verdict::Same)
            }
            (true, Some(e)) => self.judge_neighbour(ray, found, &e),
        };
        verdict
            .unwrap_or_else(|| Verdict::Wrong(format!("{ray:?}: found {found:?}, exact {exact:?}")))
    }

    /// Why the answer for `triangle` may go either way, if it may.
    fn excuse(&self, ray: &Ray, triangle: u32) -> Option<Verdict> {
        if self.oracle.near_edge(ray, triangle, SIDEWAYS) {
            return Some(Verdict::NearEdge);
        }
        let (t_min, t_max) = (f32::NEG_INFINITY, f32::INFINITY);
        let line = Ray {
            t_min,
            t_max,
            ..*ray
        };
        let on_line = self.oracle.hit_of(&line, triangle)?;
        let rounding = self.rounding(ray, &on_line);
        [ray.t_min, ray.t_max]
            .iter()
            .any(|&limit| (f64::from(limit) - on_line.t).abs() <= rounding)
            .then_some(Verdict::NearTie)
    }

    /// A miss needs an excuse for every triangle that is hit: so where two
    /// share an edge well inside a closed mesh, the far side still counts.
    fn judge_miss(&self, ray: &Ray) -> Option<Verdict> {
        let all = self.oracle.all(ray);
        let excuses = all.iter().map(|hit| self.excuse(ray, hit.triangle));
        excuses.reduce(|a, b| a.and(b)).flatten()
    }

    /// Two triangles differ. The one found must be hit, or have an excuse; and so
    /// must the exact one, unless it is not surely before the one found.
    fn judge_neighbour(&self, ray: &Ray, found: &Hit, exact: &ExactHit) -> Option<Verdict> {
        let own = self.oracle.hit_of(ray, found.triangle);
        let excuse = match own {
            Some(own) if !self.distance_holds(ray, found, &own) => return None,
            Some(_) => None,
            None => Some(self.excuse(ray, found.triangle)?),
        };
        if let Some(missed) = self.excuse(ray, exact.triangle) {
            return Some(missed);
        }
        let late = f64::from(found.t) - exact.t;
        (late <= self.rounding(ray, exact)).then(|| excuse.unwrap_or(Verdict::NearTie))
    }

    fn distance_holds(&self, ray: &Ray, found: &Hit, exact: &ExactHit) -> bool {
        (f64::from(found.t) - exact.t).abs() <= self.rounding(ray, exact)
    }

    /// How far a computed distance may be from the exact one.
    ///
    /// With sheared coordinates wrong by at most `8 u M` (and one more for
    /// products), `M = max |x|, |y| + max |z|`, each edge function is wrong by at most
    /// `e = E (|bx| + |by| + |cx| + |cy|) + 2 E^2`, `E = 9.06 u M`; and so is `t`, the
    /// mean of the corners' `z`, by at most `sum |z - t| e / (|det| - sum e) + 30 u |t|`.
    /// Both distances also lie within the padded slabs of the triangle's own box.
    fn rounding(&self, ray: &Ray, exact: &ExactHit) -> f64 {
        let corners = &self.corners[exact.triangle as usize];
        let [a, b, c] = sheared(ray, corners);
        let most = |f: fn([f64; 3]) -> f64| f(a).max(f(b)).max(f(c));
        let m = most(|p| p[0].abs().max(p[1].abs())) + most(|p| p[2].abs());
        let unit = 9.06 * U * m;
        let edge = |p: [f64; 3], q: [f64; 3]| {
            let size = p[0].abs() + p[1].abs() + q[0].abs() + q[1].abs();
            let value = q[0] * p[1] - q[1] * p[0];
            (value, unit * size + 2.0 * unit * unit)
        };
        let edges = [edge(b, c), edge(c, a), edge(a, b)];
        let (det, error) = edges.iter().fold((0.0, 0.0), |s, e| (s.0 + e.0, s.1 + e.1));
        // `z` was taken along the main axis; `t` is that over the direction's part.
        let main = largest(ray.direction);
        let z = |p: [f64; 3]| (p[2] / f64::from(ray.direction[main]) - exact.t).abs();
        let moved: f64 = [a, b, c].iter().zip(edges).map(|(&p, e)| z(p) * e.1).sum();
        let clear = det.abs() - error;
        let by_edges = if clear > 0.0 {
            moved / clear
        } else {
            f64::INFINITY
        };
        by_edges.min(self.by_slabs(ray, corners)) + 30.0 * U * exact.t.abs()
    }

    /// The narrowest slab of the triangle's own box, padded on both sides as a traced box is.
    fn by_slabs(&self, ray: &Ray, corners: &Triangle) -> f64 {
        let padding = 40.0 * U * self.oracle.reach(ray);
        let slab = |i: usize| {
            let [low, high] = [f32::min, f32::max]
                .map(|f| f64::from(corners.iter().map(|p| p[i]).reduce(f).unwrap_or(0.0)));
            (high - low + padding) / f64::from(ray.direction[i]).abs()
        };
        slab(0).min(slab(1)).min(slab(2))
    }
}

fn largest(d: [f32; 3]) -> usize {
    (1..3).fold(0, |k, i| if d[i].abs() > d[k].abs() { i } else { k })
}

/// Corners seen along the ray: two coordinates across it, and one along its main axis.
fn sheared(ray: &Ray, corners: &Triangle) -> [[f64; 3]; 3] {
    let kz = largest(ray.direction);
    let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
    let d = ray.direction.map(f64::from);
    corners.map(|p| {
        let v: [f64; 3] = std::array::from_fn(|i| f64::from(p[i]) - f64::from(ray.origin[i]));
        let z = v[kz];
        [v[kx] - d[kx] / d[kz] * z, v[ky] - d[ky] / d[kz] * z, z]
    })
}
