//! Binning with vectors of eight lanes. One vector holds a whole box. The bins are the same bit for bit as without
//! AVX2.

#![expect(
    unsafe_code,
    reason = "AVX2 instructions, called only if the processor has them"
)]

use super::{Bins, Grid};
use crate::prim::{Prim, PrimBounds};
use std::arch::x86_64::*;

/// Returns [`Bins::add`] for AVX2, if the processor has it.
#[inline]
pub(super) fn add() -> Option<fn(&mut Bins, &[Prim], &Grid)> {
    // SAFETY: the closure is returned only if the processor has AVX2, which is all that `add_wide` requires.
    let add = |bins: &mut Bins, prims: &[Prim], grid: &Grid| unsafe { add_wide(bins, prims, grid) };
    std::arch::is_x86_feature_detected!("avx2").then_some(add)
}

#[target_feature(enable = "avx2")]
fn add_wide(bins: &mut Bins, prims: &[Prim], grid: &Grid) {
    for prim in prims {
        let bounds = lanes(&prim.bounds);
        for (axis, bin) in grid.bins_of(prim).into_iter().enumerate() {
            let mine = &mut bins.boxes[axis][bin];
            let grown = _mm256_min_ps(lanes(mine), bounds);
            mine.lo = _mm256_castps256_ps128(grown).into();
            mine.up = _mm256_extractf128_ps::<1>(grown).into();
            bins.counts[axis][bin] += 1;
        }
    }
}

#[inline]
#[target_feature(enable = "avx2")]
fn lanes(bounds: &PrimBounds) -> __m256 {
    _mm256_set_m128(bounds.up.into(), bounds.lo.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prim::PrimExtents;
    use geom::Aabb;

    #[test]
    fn avx2_bins_match_scalar_bins() {
        let Some(add) = add() else { return };
        let mut random = fastrand::Rng::with_seed(9);
        let mut corner = |size: f32| [0; 3].map(|_| size * (random.f32() - 0.5));
        let prims: Vec<_> = (0..3000)
            .map(|i| {
                let (min, edge) = (corner(100.0), corner(4.0));
                let max = [0, 1, 2].map(|k| min[k] + edge[k].max(0.0));
                // Zeros of both signs, and points.
                let (min, max) = match i % 5 {
                    0 => ([0.0; 3], [-0.0; 3]),
                    1 => (min, min),
                    _ => (min, max),
                };
                Prim::new(&Aabb { min, max }, i)
            })
            .collect();
        let grid = Grid::new(&PrimExtents::of(&prims).centers, prims.len());
        let (mut wide, mut narrow) = (Bins::EMPTY, Bins::EMPTY);
        add(&mut wide, &prims, &grid);
        narrow.add_each(&prims, &grid);
        assert_eq!(wide.counts, narrow.counts);
        let bits = |bins: &Bins| {
            let boxes = bins.boxes.as_flattened().iter();
            let corners = boxes.flat_map(|b| [b.lo, b.up].map(|v| v.truncate().to_array()));
            corners.map(|c| c.map(f32::to_bits)).collect::<Vec<_>>()
        };
        assert!(bits(&wide) == bits(&narrow));
    }
}
