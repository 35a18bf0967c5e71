//! How trees age, and how the next one is made for it.

use bvh_build::Costs;

/// How a tree is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum BuildStrategy {
    /// Of its triangles alone.
    #[default]
    Scratch,
    /// Of groups of the last tree, which is sooner done.
    Subtrees,
}

/// How trees age: what the one in use came to cost, over the next one's cost where that is used.
#[derive(Debug, Default)]
pub(super) struct DegradationMonitor {
    /// Whether so much that the next one is built for more than the middle of its use, though that takes longer.
    pub(super) parts: bool,
    /// Whether so little that the next one may take its time.
    holds: bool,
}

impl DegradationMonitor {
    const PARTS: f64 = 1.5;
    /// Trees that hold do so until one costs so many times what the next one does.
    const FADED: f64 = 1.2;
    /// Such trees would do for more than twice as long, since cost grows with the square of time, and made from scratch cost less.
    const HOLDS: f64 = 1.01;

    /// How a tree is made that has a rival.
    pub(super) fn strategy(&self) -> BuildStrategy {
        match self.holds {
            true => BuildStrategy::Scratch,
            false => BuildStrategy::Subtrees,
        }
    }

    pub(super) fn note(&mut self, costs: Costs) {
        let over = |times: f64| costs.last > times * costs.new;
        self.parts = over(Self::PARTS);
        self.holds = !over(Self::FADED) && (self.holds || !over(Self::HOLDS));
    }
}
