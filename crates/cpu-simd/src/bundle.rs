//! Boxes against many rays at once, by interval arithmetic (Boulos, Wald, Shirley 2006).
//!
//! Every operation of the box test is monotone in the ray's start, in `|r|` and in `q`, rounding included. So from
//! their bounds come bounds of every ray's entry and exit; what these exclude, each ray's own test excludes too.

use crate::simd::{Halves, Lanes, each};
use crate::tree::Planes;
use crate::walk::BoxTest;

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
    pub(crate) fn new<L: Lanes>(
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
}

impl<P: Halves> Bundle<P> {
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
