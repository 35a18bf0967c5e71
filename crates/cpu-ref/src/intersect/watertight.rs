//! The watertight test: no leak and no double hit at edges and vertices.
//!
//! Woop, Benthin, Wald, *Watertight Ray/Triangle Intersection* (JCGT 2013).
//! Exact signs and a symbolic perturbation (Edelsbrunner, Mücke 1990) replace
//! the double-precision fallback: shared edges are decided as for one generic
//! point. All three vertices are sheared at once, one in each lane.

use super::{Meeting, Record, TriangleTest};
use crate::extreme::Rule;
use crate::scale::{PreparedRay, flushed4};
use geom::{Point, Triangle};
use glam::{Vec4, Vec4Swizzles};

/// Woop, Benthin, Wald 2013. A record holds, for each axis, the coordinate of all three vertices.
pub struct Watertight;

/// Axes in the order `kx, ky, kz`, and the shear that aligns the ray with axis `kz`.
#[derive(Clone, Copy, Debug)]
pub struct Shear {
    axes: [usize; 3],
    origin: [Vec4; 3],
    shear: [Vec4; 3],
}

/// Mask of the lanes that hold a vertex.
const VERTICES: u32 = 0b111;

impl TriangleTest for Watertight {
    const EXTREMES: Option<Rule> = Some(Rule::Moved);

    type Ray = Shear;

    #[inline]
    fn record([a, b, c]: &Triangle) -> Record {
        Record([0, 1, 2].map(|axis| [a[axis], b[axis], c[axis], 0.0]))
    }

    #[inline]
    fn prepare(ray: &PreparedRay) -> Shear {
        let d = ray.direction;
        let kz = main_axis(d);
        let axes = [(kz + 1) % 3, (kz + 2) % 3, kz];
        let [dx, dy, dz] = axes.map(|k| d[k]);
        Shear {
            axes,
            origin: axes.map(|k| Vec4::splat(ray.origin[k])),
            shear: [dx / dz, dy / dz, 1.0 / dz].map(Vec4::splat),
        }
    }

    #[inline(always)]
    fn meet(ray: &Shear, record: &Record) -> Option<Meeting> {
        let sheared = ray.apply(record);
        let edges = sheared.edges();
        let negative = edges.cmplt(Vec4::ZERO).bitmask() & VERTICES;
        let positive = edges.cmpgt(Vec4::ZERO).bitmask() & VERTICES;
        if negative != 0 && positive != 0 {
            return None;
        }
        if negative | positive != VERTICES && !has_equal_signs(edges, sheared.x, sheared.y) {
            return None;
        }
        Some(solve(edges, ray.depths(&sheared)))
    }
}

/// Returns `kz`: the axis of the largest component, the first of equals.
#[inline]
fn main_axis(direction: Point) -> usize {
    let [x, y, z] = direction.map(f32::abs);
    if x >= y && x >= z {
        0
    } else if y >= z {
        1
    } else {
        2
    }
}

/// A triangle's vertices in the space where the ray is the axis `kz`, one in each lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sheared {
    pub(crate) x: Vec4,
    pub(crate) y: Vec4,
    /// Distance from the ray's origin along `kz`, not scaled.
    pub(crate) along: Vec4,
}

impl Shear {
    #[inline(always)]
    pub(crate) fn apply(&self, record: &Record) -> Sheared {
        let [kx, ky, kz] = self.axes;
        let [sx, sy, _] = self.shear;
        let from_origin = |k: usize, i: usize| Vec4::from_array(record.0[k]) - self.origin[i];
        let along = from_origin(kz, 2);
        Sheared {
            x: from_origin(kx, 0) - sx * along,
            y: from_origin(ky, 1) - sy * along,
            along,
        }
    }

    /// Returns the distances of the vertices in units of the direction.
    #[inline(always)]
    pub(crate) fn depths(&self, sheared: &Sheared) -> Vec4 {
        self.shear[2] * sheared.along
    }
}

impl Sheared {
    /// Computes `U = cx*by - cy*bx` in lane 0, and `V` and `W` cyclically in lanes 1 and 2.
    #[inline(always)]
    pub(crate) fn edges(&self) -> Vec4 {
        self.x.zxyw() * self.y.yzxw() - self.y.zxyw() * self.x.yzxw()
    }
}

/// Computes distance and weights of a hit from its edge functions and depths.
#[inline]
pub(crate) fn solve(edges: Vec4, depths: Vec4) -> Meeting {
    let edges = flushed4(edges);
    let det = (edges.x + edges.y) + edges.z;
    if det == 0.0 || !det.is_finite() {
        return Meeting {
            t: depths.x,
            u: 0.0,
            v: 0.0,
        };
    }
    let p = flushed4(edges * depths);
    let [t, u, v, _] = (Vec4::new((p.x + p.y) + p.z, edges.y, edges.z, 0.0) / det).to_array();
    Meeting { t, u, v }
}

/// Returns whether all three edge functions have the same sign. Signs that rounding left open are computed exactly.
#[cold]
#[inline(never)]
pub fn has_equal_signs(edges: Vec4, x: Vec4, y: Vec4) -> bool {
    let sign = |e: f32, p: usize, q: usize| {
        let rounded = order(&e, &0.0);
        if rounded == 0 {
            exact_sign([x[p], y[p]], [x[q], y[q]])
        } else {
            rounded
        }
    };
    let u = sign(edges.x, 2, 1);
    u != 0 && u == sign(edges.y, 0, 2) && u == sign(edges.z, 1, 0)
}

/// Returns the sign of `p x q`. If that is zero, the ray moves by `(e, e^2)`. The result is zero only if `p` is `q`.
fn exact_sign(p: [f32; 2], q: [f32; 2]) -> i32 {
    // Products of two f32 are exact in f64.
    let product = |a: f32, b: f32| f64::from(a) * f64::from(b);
    let (l, r) = (product(p[0], q[1]), product(p[1], q[0]));
    [order(&l, &r), order(&p[1], &q[1]), order(&q[0], &p[0])]
        .into_iter()
        .find(|&s| s != 0)
        .unwrap_or(0)
}

/// Returns the sign of `a - b`, or 0 if either is NaN.
fn order<T: PartialOrd>(a: &T, b: &T) -> i32 {
    i32::from(a > b) - i32::from(a < b)
}
