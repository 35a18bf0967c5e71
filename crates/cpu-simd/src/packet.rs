//! Neighbouring rays, prepared together: one in each lane.

use crate::bundle::Bundle;
use crate::leaf::{Prepared, TriangleRay};
use crate::simd::{Halves, Lanes, each};
use cpu_ref::scale::LEAST_COMPONENT;
use cpu_ref::slab::{CALM, PAD, SMALLEST};
use geom::Aabb;

/// Rays over `(0, t_max)` in scaled units, but for their directions, which may have any length.
pub(crate) struct Rays<L> {
    pub(crate) origin: [L; 3],
    pub(crate) direction: [L; 3],
    pub(crate) t_max: L,
}

/// Rays that run together.
pub(crate) struct Packet<L, P> {
    pub(crate) rays: TriangleRay<L>,
    pub(crate) bundle: Bundle<P>,
    /// `t_max` in units of the prepared directions.
    pub(crate) t_max: L,
    /// `2^-e`: what directions were multiplied by.
    pub(crate) factor: L,
    /// Brings distances of all rays to the units of one of them.
    pub(crate) level: L,
}

/// Biased exponents of directions that are prepared here; the rest is left to single rays.
const USUAL: std::ops::RangeInclusive<u32> = 127 - 60..=127 + 60;
/// How far exponents of one packet may lie apart: distances must not leave the normal range.
const APART: u32 = 4;

impl<L: Lanes, P: Halves> Packet<L, P> {
    /// Prepares rays just as [`cpu_ref::ray::PreparedRay`] and [`cpu_ref::slab::Reach`] do.
    ///
    /// `None` for rays that cannot run together: those whose directions differ in main axis or sign, or are
    /// unusual, or start far away.
    #[inline(always)]
    pub(crate) fn new(rays: &Rays<L>, root: &Aabb) -> Option<Self> {
        let [dx, dy, dz] = &rays.direction;
        let sum = dx.abs().add(dy.abs()).add(dz.abs());
        if L::bits(sum.less(L::splat(f32::INFINITY))) != L::ALL {
            return None;
        }
        let (factor, level) = factors(dx.abs().max(dy.abs()).max(dz.abs()))?;
        let direction = each!(i => {
            let d = rays.direction[i].mul(factor);
            d.replace(d.abs().less(L::splat(LEAST_COMPONENT)), L::splat(0.0))
        });
        let farthest = farthest(&rays.origin, root);
        if L::bits(farthest.less(L::splat(CALM))) != L::ALL {
            return None;
        }
        let main = main_axis(&direction)?;
        let [x, y, z] = direction;
        let turned = [is_negative(x)?, is_negative(y)?, is_negative(z)?];
        let inverse = each!(i => L::splat(1.0).div(direction[i].abs().max(L::splat(SMALLEST))));
        let padding = L::splat(PAD).mul(farthest);
        let pad = each!(i => inverse[i].mul(padding));
        let t_max = rays.t_max.div(factor);
        let bundle = Bundle::new(&rays.origin, (&inverse, &pad), turned, level);
        let rays = TriangleRay::new(&Prepared {
            origin: rays.origin,
            direction,
            inverse,
            pad,
            main,
            t_min: L::splat(0.0),
            t_max,
        });
        Some(Self {
            rays,
            bundle,
            t_max,
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

/// `kz` of all lanes: the axis of the largest component, the first of equals.
#[inline(always)]
fn main_axis<L: Lanes>([x, y, z]: &[L; 3]) -> Option<usize> {
    let [x, y, z] = [x.abs(), y.abs(), z.abs()];
    let is_x = L::bits(L::both(y.at_most(x), z.at_most(x)));
    let is_y = L::bits(z.at_most(y)) & !is_x;
    if is_x == L::ALL {
        Some(0)
    } else if is_y == L::ALL {
        Some(1)
    } else {
        (is_x | is_y == 0).then_some(2)
    }
}

/// Whether a component is negative, where that is the same for all.
#[inline(always)]
fn is_negative<L: Lanes>(d: L) -> Option<bool> {
    let negative = L::bits(d.less(L::splat(0.0)));
    (negative == 0 || negative == L::ALL).then_some(negative != 0)
}
