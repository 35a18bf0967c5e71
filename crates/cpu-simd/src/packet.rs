//! Neighbouring rays, prepared together: one in each lane; and boxes against all of them at once, by interval arithmetic
//! (Boulos, Wald, Shirley 2006).
//!
//! Every operation of the box test is monotone in the ray's start, in `|r|` and in `q`, rounding included. So from
//! their bounds come bounds of every ray's entry and exit; what these exclude, each ray's own test excludes too.

use crate::leaf::TriangleRay;
use crate::rays::Group;
use crate::simd::{Halves, Lanes, each};
use crate::tree::Planes;
use crate::walk::BoxTest;
use geom::Aabb;

/// Rays that run together.
pub(crate) struct Packet<L, P> {
    pub(crate) rays: TriangleRay<L>,
    pub(crate) bundle: Bundle<P>,
    /// Brings distances of all rays to the units of one of them.
    pub(crate) level: L,
    /// Where each ray ends, and the last of these ends in units of one ray.
    pub(crate) t_max: L,
    pub(crate) bound: f32,
}

/// How far lengths of one packet may differ: distances must not leave the normal range.
const APART: f32 = 16.0;

impl<L: Lanes, P: Halves> Packet<L, P> {
    /// `None` for rays that cannot run together: some are unusual, or their directions differ in main axis, sign or
    /// exponent.
    #[inline(always)]
    pub(crate) fn of(group: &Group<L>) -> Option<Self> {
        let main = group.main_of_all()?;
        let inverse = each!(i => L::load(&group.inverse[i]));
        let [x, y, z] = inverse;
        let turned = [is_negative(x)?, is_negative(y)?, is_negative(z)?];
        let back = L::load(&group.back);
        let level = back.mul(L::splat(1.0 / group.back.as_ref()[0]));
        if level.most() > APART * level.least() {
            return None;
        }
        let [t_min, t_max] = [L::load(&group.limits[0]), L::load(&group.limits[1])];
        Some(Self {
            rays: TriangleRay::all(group, main),
            bundle: Bundle::new(group, turned, level, t_min.mul(level).least()),
            level,
            t_max,
            bound: t_max.mul(level).most(),
        })
    }
}

/// `D` of each lane.
#[inline(always)]
pub(crate) fn farthest<L: Lanes>(origin: &[L; 3], root: &Aabb) -> L {
    let mut farthest = L::splat(0.0);
    for (axis, &o) in origin.iter().enumerate() {
        for plane in [root.min[axis], root.max[axis]] {
            farthest = farthest.max(L::splat(plane).sub(o).abs());
        }
    }
    farthest
}

/// Lanes whose `kz` is x, and is y: the axis of the largest component, the first of equals.
#[inline(always)]
pub(crate) fn main_axes<L: Lanes>([x, y, z]: &[L; 3]) -> [u32; 2] {
    let [x, y, z] = [x.abs(), y.abs(), z.abs()];
    let is_x = L::bits(L::both(y.at_most(x), z.at_most(x)));
    [is_x, L::bits(z.at_most(y)) & !is_x]
}

/// Whether a component is negative, where that is the same for all.
#[inline(always)]
fn is_negative<L: Lanes>(d: L) -> Option<bool> {
    let negative = L::bits(d.less(L::splat(0.0)));
    (negative == 0 || negative == L::ALL).then_some(negative != 0)
}

/// The bounds of a packet's rays: halves as in a node, lower planes first.
#[derive(Clone, Copy)]
pub(crate) struct Bundle<P> {
    /// The start that lies nearest to the far side: greatest for lower planes, least for upper ones.
    origin: [P; 3],
    /// The least `|r|`, then the greatest; negative for upper planes.
    inverse: [[P; 2]; 3],
    /// The greatest `q`.
    pad: [P; 3],
    turned: [bool; 3],
    /// The least `t_min` for the entries, no bound for the exits.
    floor: P,
}

impl<P: Halves> Bundle<P> {
    /// `level` brings distances of all rays to one unit, exactly; `turned` says which directions are negative.
    #[inline(always)]
    fn new<L: Lanes>(group: &Group<L>, turned: [bool; 3], level: L, t_min: f32) -> Self {
        let origin = each!(i => L::load(&group.origin[i]));
        Self {
            origin: each!(i => halves(origin[i].most(), origin[i].least())),
            inverse: each!(i => {
                let r = L::load(&group.inverse[i]).abs().mul(level);
                let (least, most) = (r.least(), r.most());
                [halves(least, -least), halves(most, -most)]
            }),
            pad: each!(i => P::splat(L::load(&group.pad[i]).mul(level).most())),
            turned,
            floor: halves(t_min, f32::NEG_INFINITY),
        }
    }

    /// [`BoxTest::meet`], for planes at hand: lower ones, then upper ones.
    #[inline(always)]
    pub(crate) fn meet_planes(&self, planes: &[P; 3], best: f32) -> (u32, P::Half) {
        let [x, y, z] = each!(axis => {
            let from = planes[axis].sub(self.origin[axis]);
            let [least, most] = self.inverse[axis];
            from.mul(least)
                .min(from.mul(most))
                .sub(self.pad[axis])
                .turned(self.turned[axis])
        });
        let spans = self.floor.max(x).max(y).max(z);
        let exit = spans.high().neg().min(P::Half::splat(best));
        (P::Half::bits(spans.low().at_most(exit)), spans.low())
    }
}

impl<P: Halves> BoxTest<P::Half> for Bundle<P> {
    #[inline(always)]
    fn meet(&self, planes: &Planes, best: f32) -> (u32, P::Half) {
        let planes = each!(axis => P::load(&planes[axis]));
        self.meet_planes(&planes, best)
    }
}

/// `low` for lower planes, `high` for upper ones.
#[inline(always)]
fn halves<P: Halves>(low: f32, high: f32) -> P {
    P::join(P::Half::splat(low), P::Half::splat(high))
}
