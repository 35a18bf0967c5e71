//! One ray against the eight triangles of a block.

use super::tree::{Block, LANES};
use crate::ray::PreparedRay;
use crate::scale::LEAST;
use crate::simd::Lanes;
use crate::slab::Reach;
use crate::watertight::{Shear, has_equal_signs};
use glam::Vec4;

/// What blocks need of a ray, in every lane: axes in the order `kx, ky, kz`.
#[derive(Clone, Copy)]
pub(crate) struct BlockRay<L> {
    axes: [usize; 3],
    origin: [L; 3],
    shear: [L; 3],
    /// `|r|` and `q`, for the triangles' own boxes.
    inverse: [L; 3],
    pad: [L; 3],
    sign: [f32; 3],
    t_min: L,
    t_max: L,
}

/// Where a ray meets triangles of a block.
pub(crate) struct Meetings<L: Lanes> {
    /// Bit `lane` is set if that triangle is hit.
    pub(crate) lanes: u32,
    pub(crate) t: L,
    pub(crate) u: L,
    pub(crate) v: L,
}

/// A ray's span within the boxes of single triangles.
pub(crate) struct Spans<L: Lanes> {
    /// Bit `lane` is set if that box cannot be skipped.
    pub(crate) lanes: u32,
    /// The later of entry and `t_min`.
    pub(crate) entry: L,
    pub(crate) exit: L,
}

/// Corners relative to the ray's start, by axis (in the ray's order) and corner.
type Relative<L> = [[L; 3]; 3];

impl<L: Lanes<Array = [f32; LANES]>> BlockRay<L> {
    #[inline(always)]
    pub(crate) fn new(ray: &PreparedRay, reach: &Reach) -> Self {
        let (axes, shear) = Shear::factors(ray);
        let splat = |x: [f32; 3]| [L::splat(x[0]), L::splat(x[1]), L::splat(x[2])];
        let turned = |x: [f32; 3]| [x[axes[0]], x[axes[1]], x[axes[2]]];
        let d = turned(ray.direction);
        Self {
            axes,
            origin: splat(turned(ray.origin)),
            shear: splat(shear),
            inverse: splat(turned(reach.inverse)),
            pad: splat(turned(reach.pad)),
            sign: [sign(d[0]), sign(d[1]), sign(d[2])],
            t_min: L::splat(ray.t_min),
            t_max: L::splat(ray.t_max),
        }
    }

    #[inline(always)]
    fn relative(&self, block: &Block) -> Relative<L> {
        let axis = |i: usize| {
            let [a, b, c] = &block.corners[self.axes[i]];
            let o = self.origin[i];
            [L::load(a).sub(o), L::load(b).sub(o), L::load(c).sub(o)]
        };
        [axis(0), axis(1), axis(2)]
    }

    /// The ray's span in each triangle's own box, as far as it begins no later than `best`.
    #[inline(always)]
    fn spans_of(&self, corners: &Relative<L>, best: L) -> Spans<L> {
        let (mut entry, mut exit) = (self.t_min, L::splat(f32::INFINITY));
        for (i, &[a, b, c]) in corners.iter().enumerate() {
            // With the ray's sign in r, the nearer plane is the one with the lesser product: rounding is monotone.
            let r = self.inverse[i].mul(L::splat(self.sign[i]));
            let (p, q) = (a.min(b).min(c).mul(r), a.max(b).max(c).mul(r));
            entry = entry.max(p.min(q).sub(self.pad[i]));
            exit = exit.min(p.max(q).add(self.pad[i]));
        }
        let lanes = L::bits(entry.at_most(exit.min(best)));
        Spans { lanes, entry, exit }
    }

    /// [`Spans`] of a whole block.
    #[inline(always)]
    pub(crate) fn spans(&self, block: &Block, best: f32) -> Spans<L> {
        self.spans_of(&self.relative(block), L::splat(best))
    }

    /// The watertight test, on all triangles of a block. `t` is clamped, and no later than `best`.
    ///
    /// The ray must not be [far](Reach::is_calm): no edge function may overflow.
    #[inline(always)]
    pub(crate) fn meet(&self, block: &Block, best: f32) -> Option<Meetings<L>> {
        let corners = self.relative(block);
        let [x, y, along] = shear(&corners, &self.shear);
        let edges = edges(&x, &y);
        let open = without_conflict(&edges);
        if L::bits(open) == 0 {
            return None;
        }
        let spans = self.spans_of(&corners, L::splat(best));
        let mut lanes = L::bits(open) & spans.lanes;
        if lanes == 0 {
            return None;
        }
        lanes = settle(lanes, &edges, &x, &y);
        let depths = [
            self.shear[2].mul(along[0]),
            self.shear[2].mul(along[1]),
            self.shear[2].mul(along[2]),
        ];
        let [t, u, v] = solve(&edges, &depths);
        let t = flushed(
            t.replace(t.less(spans.entry), spans.entry)
                .replace(spans.exit.less(t), spans.exit),
        );
        let within = L::both(self.t_min.less(t), t.less(self.t_max));
        lanes &= L::bits(L::both(within, t.at_most(L::splat(best))));
        (lanes != 0).then_some(Meetings { lanes, t, u, v })
    }
}

/// 1 or -1; a zero has a sign too.
#[inline(always)]
fn sign(x: f32) -> f32 {
    1.0_f32.copysign(x)
}

/// Sheared `x`, `y`, and depths along the ray's axis, not scaled; for each corner.
#[inline(always)]
fn shear<L: Lanes>(corners: &Relative<L>, shear: &[L; 3]) -> [[L; 3]; 3] {
    let [from_x, from_y, along] = corners;
    let sheared = |from: &[L; 3], s: L| {
        [
            from[0].sub(s.mul(along[0])),
            from[1].sub(s.mul(along[1])),
            from[2].sub(s.mul(along[2])),
        ]
    };
    [sheared(from_x, shear[0]), sheared(from_y, shear[1]), *along]
}

/// `U`, `V`, `W`.
#[inline(always)]
fn edges<L: Lanes>(x: &[L; 3], y: &[L; 3]) -> [L; 3] {
    let edge = |p: usize, q: usize| x[p].mul(y[q]).sub(y[p].mul(x[q]));
    [edge(2, 1), edge(0, 2), edge(1, 0)]
}

/// Lanes where no two edge functions have opposite signs. Numbers that are none conflict.
#[inline(always)]
fn without_conflict<L: Lanes>([u, v, w]: &[L; 3]) -> L::Mask {
    let zero = L::splat(0.0);
    let (least, most) = (u.min(*v).min(*w), u.max(*v).max(*w));
    L::either(zero.at_most(least), most.at_most(zero))
}

/// Takes from `lanes`, which have no conflict, those that are missed when signs of zeros are taken exactly.
#[inline(always)]
fn settle<L: Lanes<Array = [f32; LANES]>>(
    lanes: u32,
    edges: &[L; 3],
    x: &[L; 3],
    y: &[L; 3],
) -> u32 {
    let zero = L::splat(0.0);
    let [u, v, w] = edges;
    let (least, most) = (u.min(*v).min(*w), u.max(*v).max(*w));
    let sure = L::bits(L::either(zero.less(least), most.less(zero)));
    if lanes & !sure == 0 {
        return lanes;
    }
    let stored = |of: &[L; 3]| [of[0].store(), of[1].store(), of[2].store()];
    lanes & (sure | settle_exactly(lanes & !sure, &[stored(edges), stored(x), stored(y)]))
}

/// Which of `lanes` are hit.
#[cold]
#[inline(never)]
fn settle_exactly(lanes: u32, [edges, x, y]: &[[[f32; LANES]; 3]; 3]) -> u32 {
    let at =
        |of: &[[f32; LANES]; 3], lane: usize| Vec4::new(of[0][lane], of[1][lane], of[2][lane], 0.0);
    let hit = |&lane: &usize| {
        lanes >> lane & 1 == 1 && has_equal_signs(at(edges, lane), at(x, lane), at(y, lane))
    };
    (0..LANES)
        .filter(hit)
        .fold(0, |bits, lane| bits | 1 << lane)
}

/// Zero where below `2^-100`.
#[inline(always)]
fn flushed<L: Lanes>(x: L) -> L {
    x.replace(x.abs().less(L::splat(LEAST)), L::splat(0.0))
}

/// Distance and weights: [`crate::watertight::solve`], lane by lane.
#[inline(always)]
fn solve<L: Lanes>(edges: &[L; 3], depths: &[L; 3]) -> [L; 3] {
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
