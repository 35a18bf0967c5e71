//! Sets vertices with several threads.

use crate::Point;
use geom::in_parallel;
use rayon::prelude::*;

/// Number of vertices up to which the calling thread works alone, because a busy pool would start later than it
/// finishes.
const FEW: usize = 1 << 16;

/// Sets each vertex to the value that `of` returns for its index. Uses all threads if there are many vertices.
pub(crate) fn set(to: &mut [Point], of: impl Fn(usize) -> Point + Sync) {
    let one = |(v, to): (usize, &mut Point)| *to = of(v);
    if to.len() <= FEW {
        to.iter_mut().enumerate().for_each(one)
    } else {
        in_parallel(|| {
            let all = to.par_iter_mut().enumerate();
            all.with_min_len(FEW / 4).for_each(one);
        })
    }
}
