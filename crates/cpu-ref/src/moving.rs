//! What of the tree in use moves, as lists that `preprocess` and `refit` walk in place of all of it.

use bvh_layout::Moving;
use std::ops::Range;

/// Leaves whose triangle moves, and the pairs in which anything does.
#[derive(Debug, Default)]
pub(crate) struct MovingNodes {
    /// By rank, rising.
    pub(crate) leaves: Vec<u32>,
    /// Pairs with a moving node, rising. All other boxes stay.
    pub(crate) pairs: Vec<u32>,
    /// Where each level's lie in `pairs`, root first.
    pub(crate) levels: Vec<Range<usize>>,
}

impl MovingNodes {
    /// Takes over a tree's lists, reusing memory. A pair moves if its parent
    /// does: pair `k + 1` is that of inner node `k`'s children, pair 0 the root's.
    pub(crate) fn fill(&mut self, moving: &Moving) {
        self.leaves.clear();
        self.leaves.extend_from_slice(moving.leaves());
        self.pairs.clear();
        self.levels.clear();
        if moving.leaves().is_empty() {
            return;
        }
        self.pairs.push(0);
        self.pairs.extend(moving.inner().iter().map(|k| k + 1));
        self.levels.push(0..1);
        let levels = moving.levels().iter().map(|l| l.start + 1..l.end + 1);
        self.levels.extend(levels);
    }
}
