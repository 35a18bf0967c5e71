//! Moves a node's triangles to both sides of a plane, keeping their order.

use crate::bins::{CHUNK, Counts, Plane};
use crate::prim::{Bounds, Prim};
use rayon::join;

/// Copies `from` into `left` and `right`, which it fills exactly, and returns the bounds of their centres.
#[inline(never)]
pub(crate) fn partition(
    from: &[Prim],
    plane: &Plane,
    left: &mut [Prim],
    right: &mut [Prim],
) -> [Bounds; 2] {
    let mut centers = [Bounds::EMPTY; 2];
    let mut next = [0; 2];
    for prim in from {
        let side = usize::from(!plane.is_left(prim));
        let to = if side == 0 { &mut *left } else { &mut *right };
        to[next[side]] = *prim;
        next[side] += 1;
    }
    for (centers, side) in centers.iter_mut().zip([left, right]) {
        for prim in side {
            centers.grow(&Bounds::of_point(prim.center()));
        }
    }
    centers
}

/// The same by chunks in parallel; `counts` are those of each chunk's bins.
pub(crate) fn partition_parallel(
    from: &[Prim],
    plane: &Plane,
    counts: &[Counts],
    left: &mut [Prim],
    right: &mut [Prim],
) -> [Bounds; 2] {
    if counts.len() == 1 {
        return partition(from, plane, left, right);
    }
    let (here, there) = counts.split_at(counts.len() / 2);
    let (first, second) = from.split_at(here.len() * CHUNK);
    let lefts: usize = here.iter().map(|c| plane.left_of(c)).sum();
    let (left_a, left_b) = left.split_at_mut(lefts);
    let (right_a, right_b) = right.split_at_mut(first.len() - lefts);
    let (a, b) = join(
        || partition_parallel(first, plane, here, left_a, right_a),
        || partition_parallel(second, plane, there, left_b, right_b),
    );
    [a[0].union(b[0]), a[1].union(b[1])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bins::{Bins, Grid};
    use crate::prim::Extents;
    use geom::Aabb;

    #[test]
    fn chunks_in_parallel_move_like_one_loop_and_keep_the_order() {
        let n = 3 * CHUNK + 17;
        let at = |i: usize| std::array::from_fn(|k| (i * (7919 + 31 * k) % 1009) as f32);
        let prim = |i: usize| {
            let (min, max) = (at(i), at(i));
            Prim::new(&Aabb { min, max }, i as u32)
        };
        let prims: Vec<_> = (0..n).map(prim).collect();
        let extents = Extents::of(&prims);
        let grid = Grid::new(&extents.centers, n);
        let mut counts = vec![Bins::NO_COUNTS; n.div_ceil(CHUNK)];
        let mut bins = Bins::EMPTY;
        bins.add_parallel(&prims, &grid, &mut counts);
        let plane = bins.best_plane(&extents.boxes, &grid).unwrap();
        let left = plane.left_of(&bins.counts);
        assert!(left > 0 && left < n);
        let mut moved = vec![Prim::default(); n];
        let (l, r) = moved.split_at_mut(left);
        let centers = partition_parallel(&prims, &plane, &counts, l, r);
        let (expected_l, expected_r): (Vec<_>, _) = prims.iter().partition(|p| plane.is_left(p));
        let ids = |prims: &[Prim]| prims.iter().map(Prim::triangle).collect::<Vec<_>>();
        assert_eq!([ids(l), ids(r)], [ids(&expected_l), ids(&expected_r)]);
        for (found, side) in centers.iter().zip([l, r]) {
            assert_eq!(found.aabb(), Extents::of(side).centers.aabb());
        }
    }
}
