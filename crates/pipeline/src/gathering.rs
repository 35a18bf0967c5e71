//! The boxes of all triangles at one moment, or on their way between two.

use bvh_build::Boxes;
use geom::{Aabb, Animation, Point, Pose};
use rayon::prelude::*;

/// Each triangle's boxes at two poses as one, which holds its way between them but for its turning.
pub(crate) struct Swept<'a> {
    pub(crate) animation: &'a Animation,
    pub(crate) halves: [Pose; 2],
}

impl Boxes for Swept<'_> {
    fn len(&self) -> usize {
        self.animation.triangle_count()
    }

    fn get(&self, triangle: u32) -> Aabb {
        let [a, b] = self
            .halves
            .map(|pose| self.animation.build_box_at(pose, triangle));
        a.union(b)
    }
}

/// One box a triangle, in its order.
pub(crate) fn fill<B: Boxes>(boxes: &mut Vec<Aabb>, from: &B) {
    (0..from.len() as u32)
        .into_par_iter()
        .with_min_len(1 << 12)
        .map(|triangle| from.get(triangle))
        .collect_into_vec(boxes);
}

/// All vertices at `pose`.
pub(crate) fn blend(animation: &Animation, pose: Pose, positions: &mut Vec<Point>) {
    (0..animation.vertex_count() as u32)
        .into_par_iter()
        .with_min_len(1 << 12)
        .map(|v| animation.vertex(pose, v))
        .collect_into_vec(positions);
}
