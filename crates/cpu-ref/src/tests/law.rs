//! What a hit is, written out from `docs/design/hits.md` word by word: one ray, every triangle, no tree.

use crate::extreme::{Rule, shadow_ray};
use crate::geometry::Geometry;
use crate::intersect::{Meeting, TriangleTest};
use crate::ray::PreparedRay;
use crate::scale::Scale;
use exact::Line;
use geom::{Aabb, Hit, Point, Range, Ray, Triangle, is_active, is_degenerate};

/// A ray-triangle test as a plain function, and how it answers extreme rays.
#[derive(Clone, Copy)]
pub(crate) struct Test {
    meet: fn(&PreparedRay, &Triangle) -> Option<Meeting>,
    extremes: Option<Rule>,
}

impl Test {
    /// The watertight test, written out below.
    pub(crate) const WATERTIGHT: Self = Self {
        meet: watertight,
        extremes: Some(Rule::Moved),
    };

    /// One of the crate's own tests.
    pub(crate) const fn of<T: TriangleTest>() -> Self {
        Self {
            meet: |ray, corners| T::meet(&T::prepare(ray), &T::record(corners)),
            extremes: T::EXTREMES,
        }
    }
}

/// All triangles that can be hit, scaled, and the box of all.
pub(crate) struct World {
    scale: Scale,
    triangles: Vec<(u32, Triangle)>,
    root: Aabb,
    /// All triangles, in the scene's units.
    given: Vec<Triangle>,
    range: Range,
}

impl World {
    pub(crate) fn new(geometry: Geometry<'_>) -> Self {
        let all = 0..geometry.triangles.len() as u32;
        let given: Vec<_> = all.clone().map(|i| geometry.corners(i)).collect();
        let hittable = |&i: &u32| {
            let corners = &given[i as usize];
            is_active(corners) && !is_degenerate(corners)
        };
        let triangles = all.filter(hittable);
        let triangles: Vec<_> = triangles.map(|i| (i, geometry.scaled_corners(i))).collect();
        let boxes = triangles.iter().map(|(_, t)| Aabb::of_triangle(t));
        Self {
            scale: geometry.scale,
            range: geometry.range,
            root: boxes.fold(Aabb::EMPTY, Aabb::union),
            triangles,
            given,
        }
    }

    pub(crate) fn closest(&self, ray: &Ray, test: Test) -> Hit {
        if let Some(rule) = self.rule(ray, test) {
            return self.extreme(ray, rule, None);
        }
        let Some(ray) = PreparedRay::new(ray, self.scale) else {
            return Hit::MISS;
        };
        let hits = self.triangles.iter().filter_map(|(triangle, corners)| {
            let Meeting { t, u, v } = self.hit(&ray, corners, test)?;
            let triangle = *triangle;
            Some(Hit { t, u, v, triangle })
        });
        let mut hit = first(hits);
        if hit.is_hit() {
            hit.t = ray.unscaled(hit.t);
        }
        hit
    }

    /// Whether the way from a hit of `ray` to a light is blocked.
    pub(crate) fn blocked(&self, ray: &Ray, hit: &Hit, light: Point, test: Test) -> bool {
        let Some((_, [v0, v1, v2])) = self.triangles.iter().find(|(i, _)| *i == hit.triangle)
        else {
            return false;
        };
        if let Some(rule) = self.rule(ray, test) {
            let way = shadow_ray(ray, hit, &self.given[hit.triangle as usize], light);
            return self.extreme(&way, rule, Some(hit.triangle)).is_hit();
        }
        let [eye, light] = [ray.origin, light].map(|p| self.scale.apply(p));
        let unit = 2.0_f32.powi(-24);
        let [e1, e2]: [Point; 2] = [v1, v2].map(|v| std::array::from_fn(|i| v[i] - v0[i]));
        let p: Point =
            std::array::from_fn(|i| zero_below(-64, v0[i] + (hit.u * e1[i] + hit.v * e2[i])));
        let normal = [
            e1[1] * e2[2] - e1[2] * e2[1],
            e1[2] * e2[0] - e1[0] * e2[2],
            e1[0] * e2[1] - e1[1] * e2[0],
        ]
        .map(|x| zero_below(-100, x));
        let above = |q: Point| {
            let d: Point = std::array::from_fn(|i| q[i] - p[i]);
            let terms: Point = std::array::from_fn(|i| zero_below(-100, normal[i] * d[i]));
            let height = terms[0] + terms[1] + terms[2];
            i32::from(height > 0.0) - i32::from(height < 0.0)
        };
        let side = if above(light) == 0 {
            above(eye)
        } else {
            above(light)
        };
        let edges: Point = std::array::from_fn(|i| self.root.max[i] - self.root.min[i]);
        let longest = edges.into_iter().fold(0.0, f32::max);
        let largest = p.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
        let own = e1.iter().chain(&e2).fold(0.0_f32, |m, x| m.max(x.abs()));
        let counted = longest.min(own.max(self.range.clearance * self.scale.factor()));
        let delta = 4.0 * unit * largest + 32.0 * unit * counted;
        let mut origin = p;
        for i in 0..3 {
            let up = i32::from(normal[i] > 0.0) - i32::from(normal[i] < 0.0);
            match side * up {
                1 => origin[i] += delta,
                -1 => origin[i] -= delta,
                _ => {}
            }
        }
        let ray = Ray {
            origin,
            t_min: 0.0,
            direction: std::array::from_fn(|i| light[i] - origin[i]),
            t_max: 1.0,
        };
        let Some(ray) = PreparedRay::new(&ray, Scale::ONE) else {
            return false;
        };
        let others = self.triangles.iter().filter(|(i, _)| *i != hit.triangle);
        others
            .into_iter()
            .any(|(_, corners)| self.hit(&ray, corners, test).is_some())
    }

    /// How a ray is answered that is beyond what rounded tests can tell.
    fn rule(&self, ray: &Ray, test: Test) -> Option<Rule> {
        let is_extreme = self.range.is_extreme(self.scale.apply(ray.origin));
        test.extremes.filter(|_| is_extreme)
    }

    /// The closest hit of such a ray.
    fn extreme(&self, ray: &Ray, rule: Rule, but: Option<u32>) -> Hit {
        if !ray.is_valid() {
            return Hit::MISS;
        }
        assert_eq!(rule, Rule::Moved, "exact arithmetic has its own oracle");
        let (ray, shift) = (*ray, 0);
        let line = Line { ray, shift };
        let others = self.triangles.iter().filter(|(i, _)| Some(*i) != but);
        let hits = others.filter_map(|(triangle, _)| {
            let corners = &self.given[*triangle as usize];
            let t = line.meet_moved(corners)?.t() + 0.0;
            let ([u, v], triangle) = (line.weights(corners), *triangle);
            let hit = Hit { t, u, v, triangle };
            (ray.t_min < t && t < ray.t_max).then_some(hit)
        });
        first(hits)
    }

    /// Triangles that a test hits ahead of the ray's start though the box test misses their box.
    pub(crate) fn lost_by_boxes(&self, ray: &Ray, test: Test) -> usize {
        let Some(ray) = PreparedRay::new(ray, self.scale) else {
            return 0;
        };
        let lost = |corners: &Triangle| {
            (test.meet)(&ray, corners).is_some_and(|m| m.t > 0.0)
                && self.box_test(&ray, &Aabb::of_triangle(corners)).is_none()
        };
        self.triangles.iter().filter(|(_, t)| lost(t)).count()
    }

    fn hit(&self, ray: &PreparedRay, corners: &Triangle, test: Test) -> Option<Meeting> {
        let (n, f) = self.box_test(ray, &Aabb::of_triangle(corners))?;
        let mut m = (test.meet)(ray, corners)?;
        if m.t < n {
            m.t = n;
        }
        if m.t > f {
            m.t = f;
        }
        m.t = zero_below(-100, m.t);
        (ray.t_min < m.t && m.t < ray.t_max).then_some(m)
    }

    fn box_test(&self, ray: &PreparedRay, b: &Aabb) -> Option<(f32, f32)> {
        let two = |e: i32| 2.0_f32.powi(e);
        let mut d = 0.0_f32;
        for corner in [self.root.min, self.root.max] {
            for (c, o) in corner.iter().zip(ray.origin) {
                d = d.max((c - o).abs());
            }
        }
        let d = d.min(two(80));
        let (mut n, mut f) = (f32::NEG_INFINITY, f32::INFINITY);
        for i in 0..3 {
            let magnitude = ray.direction[i].abs().max(two(-60));
            let r = 1.0 / magnitude.copysign(ray.direction[i]);
            let q = (17.0 * two(-24) * d) * r.abs();
            let (near, far) = if r > 0.0 {
                (b.min[i], b.max[i])
            } else {
                (b.max[i], b.min[i])
            };
            n = n.max((near - ray.origin[i]) * r - q);
            f = f.min((far - ray.origin[i]) * r + q);
        }
        (n <= f).then_some((n, f))
    }
}

/// The closest of hits, by the least index of equals.
fn first(hits: impl Iterator<Item = Hit>) -> Hit {
    let best = hits.reduce(|a, b| if b.is_before(&a) { b } else { a });
    best.unwrap_or(Hit::MISS)
}

/// The watertight test, one number at a time.
fn watertight(ray: &PreparedRay, corners: &Triangle) -> Option<Meeting> {
    let d = ray.direction;
    let mut kz = 0;
    for k in 1..3 {
        if d[k].abs() > d[kz].abs() {
            kz = k;
        }
    }
    let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
    let (sx, sy, sz) = (d[kx] / d[kz], d[ky] / d[kz], 1.0 / d[kz]);
    let [a, b, c] = corners.map(|v| -> Point {
        let a: Point = std::array::from_fn(|i| v[i] - ray.origin[i]);
        [a[kx] - sx * a[kz], a[ky] - sy * a[kz], sz * a[kz]]
    });
    let u = c[0] * b[1] - c[1] * b[0];
    let v = a[0] * c[1] - a[1] * c[0];
    let w = b[0] * a[1] - b[1] * a[0];
    let rounded = [u, v, w];
    if rounded.iter().any(|&x| x < 0.0) && rounded.iter().any(|&x| x > 0.0) {
        return None;
    }
    let signs = [sign(u, c, b), sign(v, a, c), sign(w, b, a)];
    if signs != [1; 3] && signs != [-1; 3] {
        return None;
    }
    let [u, v, w] = rounded.map(|x| zero_below(-100, x));
    let det = (u + v) + w;
    if det == 0.0 || !det.is_finite() {
        let (t, u, v) = (a[2], 0.0, 0.0);
        return Some(Meeting { t, u, v });
    }
    let [ta, tb, tc] = [u * a[2], v * b[2], w * c[2]].map(|x| zero_below(-100, x));
    let [t, u, v] = [(ta + tb) + tc, v, w].map(|x| x / det);
    Some(Meeting { t, u, v })
}

/// `x`, or zero if it is smaller than `2^e`.
fn zero_below(e: i32, x: f32) -> f32 {
    if x.abs() < 2.0_f32.powi(e) { 0.0 } else { x }
}

/// The sign of an edge function whose rounded value is `rounded`: of `px*qy - py*qx`, perturbed.
fn sign(rounded: f32, p: Point, q: Point) -> i32 {
    let of = |x: f64| i32::from(x > 0.0) - i32::from(x < 0.0);
    let [px, py, qx, qy] = [p[0], p[1], q[0], q[1]].map(f64::from);
    let exact = of(px * qy - py * qx);
    let all = [of(rounded.into()), exact, of(py - qy), of(qx - px)];
    all.into_iter().find(|&sign| sign != 0).unwrap_or(0)
}
