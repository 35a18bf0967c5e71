//! Neighbouring rays, prepared together: one in each lane; and boxes against all of them at once, by interval arithmetic
//! (Boulos, Wald, Shirley 2006).
//!
//! Every operation of the box test is monotone in the ray's start, in `|r|` and in `q`, rounding included. So from
//! their bounds come bounds of every ray's entry and exit; what these exclude, each ray's own test excludes too.

use crate::leaf::TriangleRay;
use crate::rays::USUAL;
use crate::simd::{Halves, Lanes, each};
use crate::tree::Planes;
use crate::walk::BoxTest;
use cpu_ref::scale::LEAST_COMPONENT;
use cpu_ref::slab::{CALM, PAD, SMALLEST};
use geom::Aabb;

/// Rays that run together.
pub(crate) struct Packet<L, P> {
    pub(crate) rays: TriangleRay<L>,
    pub(crate) bundle: Bundle<P>,
    /// `2^-e`: what directions were multiplied by.
    pub(crate) factor: L,
    /// Brings distances of all rays to the units of one of them.
    pub(crate) level: L,
}

/// How far exponents of one packet may lie apart: distances must not leave the normal range.
const APART: u32 = 4;

impl<L: Lanes, P: Halves> Packet<L, P> {
    /// Prepares rays over `(0, inf)` in scaled units just as [`cpu_ref::ray::PreparedRay`] and [`cpu_ref::slab::Reach`] do.
    /// Directions may have any length.
    ///
    /// `None` for rays that cannot run together: those whose directions differ in main axis or sign, or are
    /// unusual, or start far away.
    #[inline(always)]
    pub(crate) fn new(origin: &[L; 3], direction: &[L; 3], root: &Aabb) -> Option<Self> {
        let [dx, dy, dz] = direction;
        let sum = dx.abs().add(dy.abs()).add(dz.abs());
        if L::bits(sum.less(L::splat(f32::INFINITY))) != L::ALL {
            return None;
        }
        let (factor, level) = factors(dx.abs().max(dy.abs()).max(dz.abs()))?;
        let direction = each!(i => {
            let d = direction[i].mul(factor);
            d.replace(d.abs().less(L::splat(LEAST_COMPONENT)), L::splat(0.0))
        });
        let farthest = farthest(origin, root);
        if L::bits(farthest.less(L::splat(CALM))) != L::ALL {
            return None;
        }
        let main = main_axis(&direction)?;
        let [x, y, z] = direction;
        let turned = [is_negative(x)?, is_negative(y)?, is_negative(z)?];
        let inverse = each!(i => L::splat(1.0).div(direction[i].abs().max(L::splat(SMALLEST))));
        let padding = L::splat(PAD).mul(farthest);
        let pad = each!(i => inverse[i].mul(padding));
        Some(Self {
            rays: TriangleRay::new(origin, &direction, (&inverse, &pad), main),
            bundle: Bundle::new(origin, (&inverse, &pad), turned, level),
            factor,
            level,
        })
    }
}

/// `2^-e` of each lane, `e` being the exponent of `longest`; and `2^(e0 - e)` with the `e0` of the first lane.
#[inline(always)]
fn factors<L: Lanes>(longest: L) -> Option<(L, L)> {
    let (mut factors, mut levels) = (longest.store(), longest.store());
    let first = factors.as_ref()[0].to_bits() >> 23;
    let (mut least, mut most) = (first, first);
    for (factor, level) in factors.as_mut().iter_mut().zip(levels.as_mut()) {
        let biased = factor.to_bits() >> 23;
        least = least.min(biased);
        most = most.max(biased);
        *factor = f32::from_bits((254_u32.wrapping_sub(biased)) << 23);
        *level = f32::from_bits((127 + first).wrapping_sub(biased) << 23);
    }
    let usual = USUAL.contains(&least) && USUAL.contains(&most) && most - least <= APART;
    usual.then(|| (L::load(&factors), L::load(&levels)))
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

/// `kz`, where that is the same for all.
#[inline(always)]
fn main_axis<L: Lanes>(direction: &[L; 3]) -> Option<usize> {
    match main_axes(direction) {
        [is_x, _] if is_x == L::ALL => Some(0),
        [_, is_y] if is_y == L::ALL => Some(1),
        [is_x, is_y] => (is_x | is_y == 0).then_some(2),
    }
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
    /// `t_min` for the entries, no bound for the exits.
    floor: P,
}

impl<P: Halves> Bundle<P> {
    /// `level` brings distances of all rays to one unit, exactly; `turned` says which directions are negative.
    #[inline(always)]
    fn new<L: Lanes>(
        origin: &[L; 3],
        (inverse, pad): (&[L; 3], &[L; 3]),
        turned: [bool; 3],
        level: L,
    ) -> Self {
        Self {
            origin: each!(i => halves(origin[i].most(), origin[i].least())),
            inverse: each!(i => {
                let r = inverse[i].mul(level);
                let (least, most) = (r.least(), r.most());
                [halves(least, -least), halves(most, -most)]
            }),
            pad: each!(i => P::splat(pad[i].mul(level).most())),
            turned,
            floor: halves(0.0, f32::NEG_INFINITY),
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
