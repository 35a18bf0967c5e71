//! Measures how fast trees degrade, and selects how the next one is built.

use bvh_build::TreeCosts;

/// How a tree is built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum BuildStrategy {
    /// From its triangles alone.
    #[default]
    Scratch,
    /// From subtrees of the last tree, which takes less time.
    Subtrees,
}

/// Compares the current tree's cost with the new tree's, with the same boxes.
#[derive(Debug, Default)]
pub(super) struct DegradationMonitor {
    /// Whether trees degrade so fast that the next one is built over two poses, although that takes longer.
    pub(super) is_fast: bool,
    /// Whether trees degrade so slowly that the next build may take longer.
    is_slow: bool,
}

impl DegradationMonitor {
    /// Cost ratio above which `is_fast` is set.
    const FAST: f64 = 1.5;
    /// Cost ratio above which `is_slow` becomes false.
    const NOT_SLOW: f64 = 1.2;
    /// Cost ratio up to which `is_slow` becomes true. The excess cost grows with the square of time, so it remains
    /// small if the next build takes twice as long. A tree that is built from scratch also costs less.
    const SLOW: f64 = 1.01;

    /// Returns how to build a tree that is compared with the current one.
    pub(super) fn strategy(&self) -> BuildStrategy {
        if self.is_slow {
            BuildStrategy::Scratch
        } else {
            BuildStrategy::Subtrees
        }
    }

    pub(super) fn observe(&mut self, costs: TreeCosts) {
        let over = |times: f64| costs.previous > times * costs.new;
        self.is_fast = over(Self::FAST);
        self.is_slow = !over(Self::NOT_SLOW) && (self.is_slow || !over(Self::SLOW));
    }
}
