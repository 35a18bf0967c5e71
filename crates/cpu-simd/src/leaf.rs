//! The watertight test in lanes, and code that all triangle tests share. Each lane tests one ray with one triangle:
//! one ray with eight triangles, or the rays of a packet with one triangle.

use crate::rays::{MOST_RAYS, OneRay, PreparedRays};
use crate::simd::{Lanes, SetLanes, each};
use crate::tree::{Bvh8, LANES};
use crate::units::flushed;
use cpu_ref::intersect::has_equal_signs;
use cpu_ref::{MAX_PADDING_DISTANCE, MIN_PADDING_DISTANCE, PAD};

/// Rays prepared for the tests: one per lane, or the same ray in all lanes.
///
/// All rays have the same main axis. Axes are in the order `kx, ky, kz` unless stated otherwise.
#[derive(Clone, Copy)]
pub(crate) struct TriangleRay<L> {
    axes: [usize; 3],
    origin: [L; 3],
    shear: [L; 3],
    /// Reciprocal of the direction, `r`, for the triangles' own boxes.
    inverse: [L; 3],
    pub(crate) t_min: L,
    pub(crate) t_max: L,
    /// Origin with axes in the order x, y, z, as for `direction`.
    pub(crate) start: [L; 3],
    pub(crate) direction: [L; 3],
    /// Factor from distances to units of the caller's ray.
    pub(crate) back: L,
}

/// Triangles that are tested in lanes.
pub(crate) trait Triangles<L> {
    /// A coordinate of a corner. Must be `#[inline(always)]`.
    fn corner(&self, axis: usize, corner: usize) -> L;

    /// A number of the triangles' data for Woop's test. Must be `#[inline(always)]`.
    fn data(&self, row: usize, column: usize) -> L;
}

/// All triangles of a block, one in each lane.
#[derive(Clone, Copy)]
pub(crate) struct BlockTriangles<'a> {
    pub(crate) tree: &'a Bvh8,
    pub(crate) block: usize,
}

impl<L: Lanes<Array = [f32; LANES]>> Triangles<L> for BlockTriangles<'_> {
    #[inline(always)]
    fn corner(&self, axis: usize, corner: usize) -> L {
        L::load(&self.tree.blocks[self.block].corners[axis][corner])
    }

    #[inline(always)]
    fn data(&self, row: usize, column: usize) -> L {
        L::load(&self.tree.triangle_data[self.block].0[row][column])
    }
}

/// One triangle of a block, in all lanes.
#[derive(Clone, Copy)]
pub(crate) struct BroadcastTriangle<'a> {
    pub(crate) tree: &'a Bvh8,
    pub(crate) block: usize,
    pub(crate) lane: usize,
}

impl<L: Lanes> Triangles<L> for BroadcastTriangle<'_> {
    #[inline(always)]
    fn corner(&self, axis: usize, corner: usize) -> L {
        L::splat(self.tree.blocks[self.block].corners[axis][corner][self.lane])
    }

    #[inline(always)]
    fn data(&self, row: usize, column: usize) -> L {
        L::splat(self.tree.triangle_data[self.block].0[row][column][self.lane])
    }
}

/// Returns the padding of boxes before the multiplication by `|r|`. The argument holds the `[lower, upper]` planes of
/// each axis, relative to the ray's origin.
#[inline(always)]
pub(crate) fn slack<L: Lanes>([x, y, z]: &[[L; 2]; 3]) -> L {
    let below = x[0].abs().max(y[0].abs()).max(z[0].abs());
    let above = x[1].abs().max(y[1].abs()).max(z[1].abs());
    let reach = below.max(above);
    L::splat(PAD).mul(
        reach
            .max(L::splat(MIN_PADDING_DISTANCE))
            .min(L::splat(MAX_PADDING_DISTANCE)),
    )
}

/// The axes `kx, ky, kz` for each `kz`.
const AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];

/// The result of a triangle test, lane by lane.
pub(crate) struct TriangleHits<L: Lanes> {
    /// Bit `lane` is set if that lane has a hit.
    pub(crate) lanes: u32,
    pub(crate) t: L,
    pub(crate) u: L,
    pub(crate) v: L,
}

/// A ray's spans within the boxes of single triangles.
pub(crate) struct Spans<L: Lanes> {
    /// Bit `lane` is set if that box cannot be skipped.
    pub(crate) lanes: u32,
    /// The later of entry and `t_min`.
    pub(crate) entry: L,
    pub(crate) exit: L,
}

/// Corners relative to the ray's origin, by axis (in the ray's order) and corner.
pub(crate) type Relative<L> = [[L; 3]; 3];

impl<L: Lanes> TriangleRay<L> {
    /// Loads a ray in each lane. All rays have the main axis `main`.
    #[inline(always)]
    pub(crate) fn all(group: &PreparedRays<L>, main: usize) -> Self {
        let axes = AXES[main];
        Self {
            axes,
            origin: each!(i => L::load(&group.origin[axes[i]])),
            shear: each!(i => L::load(&group.shear[i])),
            inverse: each!(i => L::load(&group.inverse[axes[i]])),
            t_min: L::load(&group.limits[0]),
            t_max: L::load(&group.limits[1]),
            start: each!(i => L::load(&group.origin[i])),
            direction: each!(i => L::load(&group.direction[i])),
            back: L::load(&group.back),
        }
    }

    /// Computes each ray's span in the own box of its triangle. `lanes` excludes boxes that are missed or entered after
    /// `best`.
    #[inline(always)]
    pub(crate) fn spans_of(&self, corners: &Relative<L>, best: L) -> Spans<L> {
        let (mut entry, mut exit) = (self.t_min, L::splat(f32::INFINITY));
        let planes = each!(i => {
            let [a, b, c] = corners[i];
            [a.min(b).min(c), a.max(b).max(c)]
        });
        let slack = slack(&planes);
        for (i, [low, high]) in planes.into_iter().enumerate() {
            // `r` has the sign of the direction and rounding is monotone. So the nearer plane has the smaller product.
            let r = self.inverse[i];
            let (p, q, pad) = (low.mul(r), high.mul(r), slack.mul(r.abs()));
            entry = entry.max(p.min(q).sub(pad));
            exit = exit.min(p.max(q).add(pad));
        }
        let lanes = L::bits(entry.at_most(exit.min(best)));
        Spans { lanes, entry, exit }
    }

    /// Runs the watertight test in each lane. Returns the hits whose `t`, clamped to the triangle's own box, is at most
    /// `best`.
    ///
    /// Distances must be below [`cpu_ref::MAX_FINITE_PRODUCT_DISTANCE`], so that no edge function overflows.
    #[inline(always)]
    pub(crate) fn intersect_watertight(
        &self,
        triangles: &impl Triangles<L>,
        best: L,
    ) -> Option<TriangleHits<L>> {
        let corners = &self.relative(triangles);
        let [x, y, along] = self.sheared(corners);
        let edges = edges(&x, &y);
        let open = L::bits(without_conflict(&edges));
        if open == 0 {
            return None;
        }
        let spans = self.spans_of(corners, best);
        let mut lanes = open & spans.lanes;
        if lanes == 0 {
            return None;
        }
        lanes = resolve_zeros(lanes, &edges, &x, &y);
        let depths = self.depths(&along);
        let [t, u, v] = solve(&edges, &depths);
        self.within(&spans, lanes, [t, u, v], best)
    }

    /// Clamps `t` to the triangle's own box. Returns the hits of `lanes` whose clamped `t` is within the ray's
    /// limits and at most `best`.
    #[inline(always)]
    pub(crate) fn within(
        &self,
        spans: &Spans<L>,
        mut lanes: u32,
        [t, u, v]: [L; 3],
        best: L,
    ) -> Option<TriangleHits<L>> {
        let t = t
            .replace(t.less(spans.entry), spans.entry)
            .replace(spans.exit.less(t), spans.exit);
        let t = flushed(t);
        let within = L::both(self.t_min.less(t), t.less(self.t_max));
        lanes &= L::bits(L::both(within, t.at_most(best)));
        (lanes != 0).then_some(TriangleHits { lanes, t, u, v })
    }

    /// Returns the corners relative to the ray's origin.
    #[inline(always)]
    pub(crate) fn relative(&self, triangles: &impl Triangles<L>) -> Relative<L> {
        each!(i => each!(c => triangles.corner(self.axes[i], c).sub(self.origin[i])))
    }

    /// Returns sheared `x`, sheared `y` and the distance along the ray's main axis, for each corner.
    #[inline(always)]
    pub(crate) fn sheared(&self, corners: &Relative<L>) -> [[L; 3]; 3] {
        let [from_x, from_y, along] = corners;
        [
            each!(c => from_x[c].sub(self.shear[0].mul(along[c]))),
            each!(c => from_y[c].sub(self.shear[1].mul(along[c]))),
            *along,
        ]
    }

    /// Returns depths in units of the direction.
    #[inline(always)]
    pub(crate) fn depths(&self, along: &[L; 3]) -> [L; 3] {
        each!(i => self.shear[2].mul(along[i]))
    }
}

/// Operations on one ray and eight triangles.
impl<L: Lanes<Array = [f32; LANES]>> TriangleRay<L> {
    #[inline(always)]
    pub(crate) fn single(ray: &OneRay<'_, impl Lanes>) -> Self {
        let (axes, group) = (AXES[ray.main()], ray.group);
        Self {
            axes,
            origin: each!(i => L::splat(ray.at(&group.origin[axes[i]]))),
            shear: each!(i => L::splat(ray.at(&group.shear[i]))),
            inverse: each!(i => L::splat(ray.at(&group.inverse[axes[i]]))),
            t_min: L::splat(ray.at(&group.limits[0])),
            t_max: L::splat(ray.t_max()),
            start: each!(i => L::splat(ray.at(&group.origin[i]))),
            direction: each!(i => L::splat(ray.at(&group.direction[i]))),
            back: L::splat(ray.at(&group.back)),
        }
    }
}

/// Computes the edge functions `U`, `V`, `W`.
#[inline(always)]
pub(crate) fn edges<L: Lanes>(x: &[L; 3], y: &[L; 3]) -> [L; 3] {
    each!(i => {
        let (p, q) = ([2, 0, 1][i], [1, 2, 0][i]);
        x[p].mul(y[q]).sub(y[p].mul(x[q]))
    })
}

/// Returns the lanes where no two edge functions have opposite signs. Excludes lanes where all edge functions are NaN,
/// which are those of triangles that cannot be hit. No other lane may have a NaN.
#[inline(always)]
fn without_conflict<L: Lanes>([u, v, w]: &[L; 3]) -> L::Mask {
    let zero = L::splat(0.0);
    let (least, most) = (u.min(*v).min(*w), u.max(*v).max(*w));
    L::either(zero.at_most(least), most.at_most(zero))
}

/// Computes the exact signs of edge functions that are zero, and returns the `lanes` that still hit. The nonzero edge
/// functions of each lane must have equal signs.
#[inline(always)]
fn resolve_zeros<L: Lanes>(lanes: u32, edges: &[L; 3], x: &[L; 3], y: &[L; 3]) -> u32 {
    let zero = L::splat(0.0);
    let [u, v, w] = edges;
    let (least, most) = (u.min(*v).min(*w), u.max(*v).max(*w));
    let sure = L::bits(L::either(zero.less(least), most.less(zero)));
    if lanes & !sure == 0 {
        return lanes;
    }
    let stored = [
        each!(i => edges[i].store()),
        each!(i => x[i].store()),
        each!(i => y[i].store()),
    ];
    lanes & (sure | resolve_exactly::<L>(lanes & !sure, &stored))
}

/// Returns the subset of `lanes` that are hit, with all signs exact.
#[cold]
#[inline(never)]
fn resolve_exactly<L: Lanes>(lanes: u32, [edges, x, y]: &[[L::Array; 3]; 3]) -> u32 {
    let mut hit = 0;
    for lane in SetLanes::<MOST_RAYS>(lanes) {
        let at = |of: &[L::Array; 3]| of.each_ref().map(|x| x.as_ref()[lane]);
        hit |= u32::from(has_equal_signs(&at(edges), &at(x), &at(y))) << lane;
    }
    hit
}

/// Computes the distance and the weights of each lane, with the same operations as `solve` of `cpu-ref`.
#[inline(always)]
pub(crate) fn solve<L: Lanes>(edges: &[L; 3], depths: &[L; 3]) -> [L; 3] {
    let [u, v, w] = [flushed(edges[0]), flushed(edges[1]), flushed(edges[2])];
    let det = u.add(v).add(w);
    let size = det.abs();
    let zero = L::splat(0.0);
    let useful = L::both(zero.less(size), size.at_most(L::splat(f32::MAX)));
    let p = [
        flushed(u.mul(depths[0])),
        flushed(v.mul(depths[1])),
        flushed(w.mul(depths[2])),
    ];
    let t = p[0].add(p[1]).add(p[2]).div(det);
    [
        depths[0].replace(useful, t),
        zero.replace(useful, v.div(det)),
        zero.replace(useful, w.div(det)),
    ]
}
