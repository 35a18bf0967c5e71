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
    pub(super) parts: bool,
    /// Whether trees degrade so slowly that the next build may take longer.
    holds: bool,
}

impl DegradationMonitor {
    const PARTS: f64 = 1.5;
    /// Cost ratio above which `holds` becomes false.
    const FADED: f64 = 1.2;
    /// Cost ratio up to which `holds` becomes true. Cost grows with the square of time, so such trees remain good for
    /// more than twice as long. Trees that are built from scratch also cost less.
    const HOLDS: f64 = 1.01;

    /// Returns how to build a tree that is compared with the current one.
    pub(super) fn strategy(&self) -> BuildStrategy {
        match self.holds {
            true => BuildStrategy::Scratch,
            false => BuildStrategy::Subtrees,
        }
    }

    pub(super) fn note(&mut self, costs: TreeCosts) {
        let over = |times: f64| costs.last > times * costs.new;
        self.parts = over(Self::PARTS);
        self.holds = !over(Self::FADED) && (self.holds || !over(Self::HOLDS));
    }
}
