//! The triangle tests in lanes. Each returns the same bits as the reference.

use crate::leaf::{TriangleHits, TriangleRay, Triangles};
use crate::simd::{Lanes, each};
use cpu_ref::intersect::{MollerTrumbore, Watertight, Woop};

/// A test that computes `t`, `u` and `v` of each hit. The filter of `exact` does not.
pub(crate) trait LaneTest: Sync {
    /// Returns the hits whose `t`, clamped to the triangle's own box, is at most `best`. Must be `#[inline(always)]`.
    fn intersect<L: Lanes>(
        ray: &TriangleRay<L>,
        triangles: &impl Triangles<L>,
        best: L,
    ) -> Option<TriangleHits<L>>;
}

/// A test that any-hit searches use.
pub(crate) trait AnyHitTest: Sync {
    /// Returns the lanes that hit within the ray's limits. Must be `#[inline(always)]`.
    fn any_hit<L: Lanes>(ray: &TriangleRay<L>, triangles: &impl Triangles<L>) -> AnyHits;
}

/// Lanes that certainly hit, and open lanes, which the filter of `exact` cannot decide.
#[derive(Clone, Copy, Default)]
pub(crate) struct AnyHits {
    pub(crate) hit: u32,
    pub(crate) open: u32,
}

impl<T: LaneTest> AnyHitTest for T {
    #[inline(always)]
    fn any_hit<L: Lanes>(ray: &TriangleRay<L>, triangles: &impl Triangles<L>) -> AnyHits {
        let hit = match T::intersect(ray, triangles, ray.t_max) {
            Some(hits) => hits.lanes,
            None => 0,
        };
        AnyHits { hit, open: 0 }
    }
}

impl LaneTest for Watertight {
    #[inline(always)]
    fn intersect<L: Lanes>(
        ray: &TriangleRay<L>,
        triangles: &impl Triangles<L>,
        best: L,
    ) -> Option<TriangleHits<L>> {
        ray.intersect_watertight(triangles, best)
    }
}

impl LaneTest for MollerTrumbore {
    #[inline(always)]
    fn intersect<L: Lanes>(
        ray: &TriangleRay<L>,
        triangles: &impl Triangles<L>,
        best: L,
    ) -> Option<TriangleHits<L>> {
        let [a, b, c] = each!(c => each!(i => triangles.corner(i, c)));
        let (e1, e2) = (each!(i => b[i].sub(a[i])), each!(i => c[i].sub(a[i])));
        let p = cross(&ray.direction, &e2);
        let inverse = L::splat(1.0).div(dot(&e1, &p));
        let s = each!(i => ray.start[i].sub(a[i]));
        let u = dot(&s, &p).mul(inverse);
        let q = cross(&s, &e1);
        let v = dot(&ray.direction, &q).mul(inverse);
        let t = dot(&e2, &q).mul(inverse);
        clamp_inside(ray, triangles, [t, u, v], best)
    }
}

impl LaneTest for Woop {
    #[inline(always)]
    fn intersect<L: Lanes>(
        ray: &TriangleRay<L>,
        triangles: &impl Triangles<L>,
        best: L,
    ) -> Option<TriangleHits<L>> {
        let [to_u, to_v, to_height] = each!(row => Row {
            vector: each!(i => triangles.data(row, i)),
            offset: triangles.data(row, 3),
        });
        let [one, none] = [L::splat(1.0), L::splat(0.0)];
        let height = to_height.of(&ray.start, one);
        let t = height.neg().div(to_height.of(&ray.direction, none));
        let u = to_u.of(&ray.start, one);
        let u = u.add(t.mul(to_u.of(&ray.direction, none)));
        let v = to_v.of(&ray.start, one);
        let v = v.add(t.mul(to_v.of(&ray.direction, none)));
        clamp_inside(ray, triangles, [t, u, v], best)
    }
}

/// A row of Woop's transform.
#[derive(Clone, Copy)]
struct Row<L> {
    vector: [L; 3],
    offset: L,
}

impl<L: Lanes> Row<L> {
    /// Returns the row's product with `v` and `w`, summed in the reference's order.
    #[inline(always)]
    fn of(&self, v: &[L; 3], w: L) -> L {
        let [x, y, z] = each!(i => self.vector[i].mul(v[i]));
        x.add(z).add(y.add(self.offset.mul(w)))
    }
}

/// Returns the hits that are inside their triangle, with `t` clamped to the triangle's box.
#[inline(always)]
fn clamp_inside<L: Lanes>(
    ray: &TriangleRay<L>,
    triangles: &impl Triangles<L>,
    [t, u, v]: [L; 3],
    best: L,
) -> Option<TriangleHits<L>> {
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let positive = L::both(zero.at_most(u), zero.at_most(v));
    let inside = L::bits(L::both(positive, u.add(v).at_most(one)));
    if inside == 0 {
        return None;
    }
    let spans = ray.spans_of(&ray.relative(triangles), best);
    let lanes = inside & spans.lanes;
    if lanes == 0 {
        return None;
    }
    ray.within(&spans, lanes, [t, u, v], best)
}

#[inline(always)]
fn dot<L: Lanes>(a: &[L; 3], b: &[L; 3]) -> L {
    let [x, y, z] = each!(i => a[i].mul(b[i]));
    x.add(y).add(z)
}

#[inline(always)]
fn cross<L: Lanes>(a: &[L; 3], b: &[L; 3]) -> [L; 3] {
    each!(i => {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j].mul(b[k]).sub(a[k].mul(b[j]))
    })
}
