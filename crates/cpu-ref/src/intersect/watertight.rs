//! The watertight test: no leak and no double hit at edges and vertices of triangles with a nonzero area.
//!
//! Woop, Benthin, Wald, *Watertight Ray/Triangle Intersection* (JCGT 2013).
//! Exact signs and a symbolic perturbation (Edelsbrunner, Mücke 1990) replace the paper's double-precision fallback. So
//! a ray through a shared edge or vertex is treated like a ray that passes very close to it.

use super::triangle_data::{TriangleData, TriangleHit};
use crate::scale::{PreparedRay, flushed};
use geom::Triangle;
use glam::Vec3;

/// A ray for the test of Woop, Benthin, Wald 2013. Axes are in the order `kx, ky, kz`, and the shear aligns the ray
/// with axis `kz`. [`TriangleData`] holds the coordinates of the three vertices, axis by axis.
#[derive(Clone, Copy, Debug)]
pub struct Watertight {
    axes: [usize; 3],
    origin: [f32; 3],
    shear: [f32; 3],
}

/// A number for each vertex or for each edge of a triangle.
type Three = [f32; 3];

/// A triangle's vertices in the space where the ray is the axis `kz`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sheared {
    pub(crate) x: Three,
    pub(crate) y: Three,
    /// Distance from the ray's origin along `kz`, not divided by the direction.
    pub(crate) along: Three,
}

impl Watertight {
    pub(crate) fn preprocess([a, b, c]: &Triangle) -> TriangleData {
        TriangleData([0, 1, 2].map(|axis| [a[axis], b[axis], c[axis], 0.0]))
    }

    pub(crate) fn new(ray: &PreparedRay) -> Self {
        let d = ray.direction;
        // The axis of the largest component, the first of equals.
        let kz = Vec3::from_array(d).abs().max_position();
        let axes = [(kz + 1) % 3, (kz + 2) % 3, kz];
        let [dx, dy, dz] = axes.map(|k| d[k]);
        Self {
            axes,
            origin: axes.map(|k| ray.origin[k]),
            shear: [dx / dz, dy / dz, 1.0 / dz],
        }
    }

    #[inline]
    pub(crate) fn intersect(&self, data: &TriangleData) -> Option<TriangleHit> {
        let sheared = self.sheared(data);
        let edges = sheared.edges();
        let some_negative = edges.iter().any(|&e| e < 0.0);
        let some_positive = edges.iter().any(|&e| e > 0.0);
        if some_negative && some_positive {
            return None;
        }
        let some_open = edges.iter().any(|&e| e == 0.0 || e.is_nan());
        if some_open && !has_equal_signs(&edges, &sheared.x, &sheared.y) {
            return None;
        }
        Some(solve(&edges, &self.depths(&sheared)))
    }

    #[inline]
    pub(crate) fn sheared(&self, data: &TriangleData) -> Sheared {
        let from_origin: [Three; 3] = std::array::from_fn(|i| {
            let [a, b, c, _] = data.0[self.axes[i]];
            [a, b, c].map(|coordinate| coordinate - self.origin[i])
        });
        let [x, y, along] = from_origin;
        let [sx, sy, _] = self.shear;
        Sheared {
            x: std::array::from_fn(|vertex| x[vertex] - sx * along[vertex]),
            y: std::array::from_fn(|vertex| y[vertex] - sy * along[vertex]),
            along,
        }
    }

    /// Returns the distances of the vertices in units of the direction.
    #[inline]
    pub(crate) fn depths(&self, sheared: &Sheared) -> Three {
        sheared.along.map(|along| self.shear[2] * along)
    }
}

impl Sheared {
    /// Computes the edge functions `U = cx*by - cy*bx`, and `V` and `W` cyclically.
    #[inline]
    pub(crate) fn edges(&self) -> Three {
        let Self { x, y, .. } = self;
        std::array::from_fn(|i| {
            let (p, q) = ((i + 2) % 3, (i + 1) % 3);
            x[p] * y[q] - y[p] * x[q]
        })
    }
}

/// Computes distance and weights of a hit from its edge functions and depths.
#[inline]
pub(crate) fn solve(edges: &Three, depths: &Three) -> TriangleHit {
    let [e0, e1, e2] = edges.map(flushed);
    let det = (e0 + e1) + e2;
    if det == 0.0 || !det.is_finite() {
        return TriangleHit {
            t: depths[0],
            u: 0.0,
            v: 0.0,
        };
    }
    let sum = (flushed(e0 * depths[0]) + flushed(e1 * depths[1])) + flushed(e2 * depths[2]);
    TriangleHit {
        t: sum / det,
        u: e1 / det,
        v: e2 / det,
    }
}

/// Returns whether all three edge functions have the same sign, for vertices at sheared `x` and `y`. If an edge
/// function is zero or NaN, computes its exact sign.
#[cold]
#[inline(never)]
pub fn has_equal_signs(edges: &[f32; 3], x: &[f32; 3], y: &[f32; 3]) -> bool {
    let sign = |edge: usize| {
        let (p, q) = ((edge + 2) % 3, (edge + 1) % 3);
        let rounded = order(&edges[edge], &0.0);
        if rounded == 0 {
            exact_sign([x[p], y[p]], [x[q], y[q]])
        } else {
            rounded
        }
    };
    let u = sign(0);
    u != 0 && u == sign(1) && u == sign(2)
}

/// Returns the exact sign of `p x q`. If `p x q` is zero, returns its sign after the ray moves by `(e, e^2)` for an
/// infinitesimal `e`. This is zero only if `p` equals `q`.
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
