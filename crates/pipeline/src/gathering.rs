//! The boxes of all triangles, at one moment or at several.

use bvh_build::Boxes;
use geom::{Aabb, Moment, Point};
use rayon::prelude::*;

/// Grows the box of each triangle to hold that from `from`, too.
pub(crate) fn grow<B: Boxes>(boxes: &mut [Aabb], from: &B) {
    boxes
        .par_iter_mut()
        .with_min_len(1 << 12)
        .zip(0..from.len() as u32)
        .for_each(|(to, triangle)| *to = to.union(from.get(triangle)));
}

/// One box a triangle, in its order.
pub(crate) fn fill<B: Boxes>(boxes: &mut Vec<Aabb>, from: &B) {
    (0..from.len() as u32)
        .into_par_iter()
        .with_min_len(1 << 12)
        .map(|triangle| from.get(triangle))
        .collect_into_vec(boxes);
}

/// All vertices at a moment.
pub(crate) fn blend(moment: &Moment<'_>, positions: &mut Vec<Point>) {
    (0..moment.animation().vertex_count() as u32)
        .into_par_iter()
        .with_min_len(1 << 12)
        .map(|v| moment.vertex(v))
        .collect_into_vec(positions);
}
