//! Flushing of small numbers to zero, with the same results as `cpu-ref`.

use crate::simd::Lanes;
use cpu_ref::scale::{MIN_NONZERO, Scale};

/// Returns `x`, or zero where `|x|` is below `2^-100`.
#[inline(always)]
pub(crate) fn flushed<L: Lanes>(x: L) -> L {
    x.replace(x.abs().less(L::splat(MIN_NONZERO)), L::splat(0.0))
}

/// Applies [`Scale::apply`] to each lane.
#[inline(always)]
pub(crate) fn scaled<L: Lanes>(scale: Scale, x: L) -> L {
    let x = x.mul(L::splat(scale.factor()));
    let least = L::splat(Scale::MIN_NONZERO_COORDINATE);
    x.replace(x.abs().less(least), L::splat(0.0))
}
