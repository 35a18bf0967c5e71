//! `watertight` against exact arithmetic.
//!
//! It answers for a ray within rounding of the given one. So it may name a neighbour, but only where the exact ray passes within
//! that rounding of an edge, or where distances are so near (to each other, or to the ray's limits) that rounding cannot tell
//! them apart. Everything else is wrong.

use backend::Intersector;
use conformance::oracle::{ExactHit, Oracle};
use conformance::stage::triangles;
use geom::{Aabb, Animation, Hit, Point, Ray, Triangle};
use integration::stage::Stage;
use rayon::prelude::*;
use std::sync::Arc;

/// `2^-24`.
const U: f64 = f32::EPSILON as f64 / 2.0;

/// The answer moves the ray by at most 8 roundings of the reach on each of the two axes across it: less than 12 in all.
const SIDEWAYS: f64 = 12.0;

/// A scene at rest, and the oracle over it.
pub(crate) struct Verifier {
    corners: Vec<Triangle>,
    /// Of all active triangles.
    bounds: Aabb,
    pub(crate) oracle: Oracle,
}

impl Verifier {
    pub(crate) fn at(animation: &Animation, time: f64) -> Self {
        let corners = triangles(animation, time);
        let active = corners.iter().filter(|c| geom::is_active(c));
        Self {
            bounds: active.map(Aabb::of_triangle).fold(Aabb::EMPTY, Aabb::union),
            oracle: Oracle::new(corners.clone()),
            corners,
        }
    }

    /// Judges what `watertight` found: whether it is another answer than the exact one; the error is what cannot be explained.
    fn differs(&self, ray: &Ray, found: &Hit) -> Result<bool, String> {
        let exact = self.oracle.closest(ray);
        let (differs, is_explained) = match (found.is_hit(), exact) {
            (false, None) => (false, true),
            (false, Some(_)) => (true, self.explains_miss(ray)),
            (true, None) => (true, self.excuses(ray, found.triangle)),
            (true, Some(e)) if e.triangle == found.triangle => {
                (false, self.distance_holds(ray, found, &e))
            }
            (true, Some(e)) => (true, self.explains_neighbour(ray, found, &e)),
        };
        let why = || format!("{ray:?}: found {found:?}, exact {exact:?}");
        is_explained.then_some(differs).ok_or_else(why)
    }

    /// Whether the answer for `triangle` may go either way.
    fn excuses(&self, ray: &Ray, triangle: u32) -> bool {
        let line = Ray {
            t_min: f32::NEG_INFINITY,
            ..Ray::new(ray.origin, ray.direction)
        };
        let near_limit = |on_line: ExactHit| {
            let rounding = self.rounding(ray, &on_line);
            let near = |limit: f32| (f64::from(limit) - on_line.t).abs() <= rounding;
            near(ray.t_min) || near(ray.t_max)
        };
        self.near_edge(ray, triangle) || self.hit_of(&line, triangle).is_some_and(near_limit)
    }

    fn hit_of(&self, ray: &Ray, triangle: u32) -> Option<ExactHit> {
        let mut all = self.oracle.all(ray).into_iter();
        all.find(|hit| hit.triangle == triangle)
    }

    /// The largest coordinate distance between the ray's origin and the box of all triangles.
    fn reach(&self, ray: &Ray) -> f64 {
        let away = |i: usize, x: f32| (f64::from(x) - f64::from(ray.origin[i])).abs();
        let both = |i| [self.bounds.min[i], self.bounds.max[i]].map(|x| away(i, x));
        (0..3).flat_map(both).fold(0.0, f64::max)
    }

    /// Whether the ray's line passes within rounding of an edge of the triangle. Plain double precision: its error is far
    /// below the `2^-24` it is compared with.
    fn near_edge(&self, ray: &Ray, triangle: u32) -> bool {
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let d = ray.direction.map(f64::from);
        // Seen along the ray, the line is the point zero.
        let seen = self.corners[triangle as usize].map(|p| -> [f64; 3] {
            let v = std::array::from_fn(|i| f64::from(p[i]) - f64::from(ray.origin[i]));
            let along = dot(v, d) / dot(d, d);
            std::array::from_fn(|i| v[i] - along * d[i])
        });
        let distance = |i: usize| {
            let (p, q) = (seen[i], seen[(i + 1) % 3]);
            let e = std::array::from_fn(|k| q[k] - p[k]);
            let s = (-dot(p, e) / dot(e, e).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            let nearest = std::array::from_fn(|k| p[k] + s * e[k]);
            dot(nearest, nearest).sqrt()
        };
        let margin = SIDEWAYS * U * self.reach(ray);
        (0..3).any(|i| distance(i) <= margin)
    }

    /// A miss needs an excuse for every triangle that is hit: so where two share an edge well inside a closed mesh, the far
    /// side still counts.
    fn explains_miss(&self, ray: &Ray) -> bool {
        let all = self.oracle.all(ray);
        all.iter().all(|hit| self.excuses(ray, hit.triangle))
    }

    /// Two triangles differ. The one found must be hit, or have an excuse; and so must the exact one, unless it is not surely
    /// before the one found.
    fn explains_neighbour(&self, ray: &Ray, found: &Hit, exact: &ExactHit) -> bool {
        let may_be = match self.hit_of(ray, found.triangle) {
            Some(own) => self.distance_holds(ray, found, &own),
            None => self.excuses(ray, found.triangle),
        };
        let late = || f64::from(found.t) - exact.t <= self.rounding(ray, exact);
        may_be && (self.excuses(ray, exact.triangle) || late())
    }

    fn distance_holds(&self, ray: &Ray, found: &Hit, exact: &ExactHit) -> bool {
        (f64::from(found.t) - exact.t).abs() <= self.rounding(ray, exact)
    }

    /// How far a computed distance may be from the exact one.
    ///
    /// With sheared coordinates wrong by at most `8 u M` (and one more for products), `M = max |x|, |y| + max |z|`, each edge
    /// function is wrong by at most `e = E (|bx| + |by| + |cx| + |cy|) + 2 E^2`, `E = 9.06 u M`. So is `t`, the mean of the
    /// corners' `z`, by at most `sum |z - t| e / (|det| - sum e) + 30 u |t|`. Both distances also lie within the padded slabs of
    /// the triangle's own box.
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
        let by_edges = match clear > 0.0 {
            true => moved / clear,
            false => f64::INFINITY,
        };
        by_edges.min(self.by_slabs(ray, corners)) + 30.0 * U * exact.t.abs()
    }

    /// The narrowest slab of the triangle's own box, padded on both sides as a traced box is.
    fn by_slabs(&self, ray: &Ray, corners: &Triangle) -> f64 {
        let padding = 40.0 * U * self.reach(ray);
        let own = Aabb::of_triangle(corners);
        let slab = |i: usize| {
            let thickness = f64::from(own.max[i]) - f64::from(own.min[i]);
            (thickness + padding) / f64::from(ray.direction[i]).abs()
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

/// Judges every ray: how many answers differ from the exact ones, each of which can be explained.
pub(crate) fn differing(
    verify: &Verifier,
    animation: &Arc<Animation>,
    time: f64,
    rays: &[Ray],
) -> usize {
    let mut stage = Stage::new(animation, Intersector::Watertight, 2);
    stage.plant(time);
    let hits = stage.closest(time, rays).closest;
    let pairs = rays.par_iter().zip(&hits);
    let differs = |(ray, hit): &(&Ray, &Hit)| verify.differs(ray, hit).unwrap();
    pairs.filter(differs).count()
}

/// Triangles whose coordinates are small integers or anything, so that there are ties, at several sizes.
pub(crate) fn soups() {
    let mut rng = fastrand::Rng::with_seed(3);
    for case in 0..240 {
        let scale = [1.0, 1e-20, 1e20, 1024.0][case % 4];
        let point = |rng: &mut fastrand::Rng| -> Point {
            let coordinate = |()| match rng.bool() {
                true => f32::from(rng.i8(-4..=4)),
                false => 8.0 * rng.f32() - 4.0,
            };
            [(); 3].map(coordinate).map(|x| x * scale)
        };
        let count = rng.usize(1..40);
        let corners: Vec<Point> = (0..3 * count).map(|_| point(&mut rng)).collect();
        let indices = (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
        let animation = Arc::new(Animation::new(vec![corners], indices.collect()).unwrap());
        let verify = Verifier::at(&animation, 0.0);
        // Half of them at edges and vertices.
        let ray = |i: usize| {
            let origin = point(&mut rng);
            let [a, b, c] = verify.corners[rng.usize(..count)];
            let (v, w) = (rng.f32(), rng.f32());
            let [v, w] = match i % 4 {
                0 => [v, 0.0],
                1 => [v.round(), 0.0],
                _ => [v, w * (1.0 - v)],
            };
            let at: Point = std::array::from_fn(|k| a[k] + v * (b[k] - a[k]) + w * (c[k] - a[k]));
            Ray::new(origin, std::array::from_fn(|k| at[k] - origin[k]))
        };
        let rays: Vec<Ray> = (0..60).map(ray).filter(Ray::is_valid).collect();
        differing(&verify, &animation, 0.0, &rays);
    }
}
