//! What moves, as kernels are told of it.

use bvh_layout::{Topology, Treelets};
use geom::{Animation, StaticParts};
use std::ops::Range;

/// Rows of four floats of all positions, laid end to end, in which any vertex
/// moves: what `interpolate` may write in place of all. They rise. `None` where
/// so many move that lists do not pay ([`StaticParts::pays`]).
///
/// Whoever writes only these must have the first key frame in the positions before.
pub fn moving_rows(animation: &Animation) -> Option<Vec<u32>> {
    let is_static = &animation.static_parts().vertices;
    let all = (3 * is_static.len()).div_ceil(4);
    let mut rows: Vec<u32> = Vec::new();
    for (v, _) in is_static.iter().enumerate().filter(|(_, s)| !**s) {
        for row in [3 * v / 4, (3 * v + 2) / 4] {
            if rows.last().is_none_or(|&last| (last as usize) < row) {
                rows.push(row as u32);
            }
        }
    }
    StaticParts::pays(rows.len(), all).then_some(rows)
}

/// Where a tree's lists of what moves lie: words that are uploaded behind the tree's record. See [`bvh_layout::Moving`] and
/// [`bvh_layout::MovingTreelets`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MovingShape {
    /// With layout `bvh2`, leaves' ranks.
    pub leaves: Range<u32>,
    /// Likewise inner nodes by their number among inner nodes.
    pub inner: Range<u32>,
    /// Likewise those of each level that has any, root first. With layout `fast` the numbers of each level's treelets, that of
    /// the triangles first.
    pub levels: Vec<Range<u32>>,
    /// Triangles of zero area among leaves, or in treelets, that are not listed.
    pub degenerate_elsewhere: u32,
}

impl MovingShape {
    pub(crate) fn of(tree: &Topology) -> Option<Self> {
        let moving = tree.moving()?;
        let leaves_at = tree.words().len() as u32;
        let inner_at = leaves_at + moving.leaves().len() as u32;
        Some(Self {
            leaves: leaves_at..inner_at,
            inner: inner_at..inner_at + moving.inner().len() as u32,
            levels: behind(inner_at, &moving.levels),
            degenerate_elsewhere: moving.degenerate_elsewhere,
        })
    }

    pub(crate) fn of_treelets(tree: &Treelets) -> Option<Self> {
        let moving = tree.moving.as_ref()?;
        Some(Self {
            levels: behind(tree.words().len() as u32, &moving.levels),
            degenerate_elsewhere: moving.degenerate_elsewhere,
            ..Self::default()
        })
    }
}

fn behind(at: u32, levels: &[Range<usize>]) -> Vec<Range<u32>> {
    let levels = levels.iter();
    levels
        .map(|l| at + l.start as u32..at + l.end as u32)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(moves: &[usize], vertices: usize) -> Option<Vec<u32>> {
        let mut keys = vec![vec![[1.0; 3]; vertices]; 2];
        moves.iter().for_each(|&v| keys[1][v][2] = 2.0);
        moving_rows(&Animation::new(keys, vec![]).unwrap())
    }

    #[test]
    fn rows_hold_every_float_of_what_moves() {
        assert_eq!(rows(&[], 9), Some(vec![]));
        assert_eq!(rows(&[0], 9), Some(vec![0]));
        assert_eq!(rows(&[1], 9), Some(vec![0, 1]));
        assert_eq!(rows(&[1, 2], 9), Some(vec![0, 1, 2]));
        assert_eq!(rows(&[3, 8], 9), Some(vec![2, 6]));
        assert_eq!(rows(&[0, 3, 6, 8], 9), None);
        assert_eq!(rows(&[], 0), Some(vec![]));
    }
}
