//! A pass over the tree from its blocks to its root, side by side where subtrees do not meet.

use crate::tree::{Block, Node};
use bvh_layout::BlockTree;
use cpu_ref::pass::{SplitAt, Which, Window};
use std::ops::Add;

/// Nodes that one task handles.
const RUN: usize = 32;

/// Neighbouring nodes of one level, with their blocks.
pub(crate) struct LevelPart<'a> {
    pub(crate) which: Which<'a>,
    pub(crate) nodes: Window<'a, Node>,
    pub(crate) blocks: Window<'a, Block>,
}

impl LevelPart<'_> {
    fn reborrow(&mut self) -> LevelPart<'_> {
        LevelPart {
            which: self.which.clone(),
            nodes: self.nodes.reborrow(),
            blocks: self.blocks.reborrow(),
        }
    }

    /// Cuts off all from a node on.
    fn split(self, node: usize, shape: &BlockTree) -> [Self; 2] {
        let [which, more_which] = self.which.split_before(node);
        let [nodes, more_nodes] = self.nodes.split(node);
        let [blocks, more_blocks] = self.blocks.split(shape.first_blocks[node] as usize);
        let level = |which, nodes, blocks| Self {
            which,
            nodes,
            blocks,
        };
        [
            level(which, nodes, blocks),
            level(more_which, more_nodes, more_blocks),
        ]
    }
}

/// Neighbouring nodes of one level, and level by level all below them. None without a node to go over.
pub(crate) struct Subtrees<'a>(Vec<LevelPart<'a>>);

impl<'a> Subtrees<'a> {
    /// The whole tree; `which` says of each level, root first, what to go over: with a node those above it.
    pub(crate) fn of(
        shape: &BlockTree,
        which: impl Iterator<Item = Which<'a>>,
        (mut nodes, mut blocks): (&'a mut [Node], &'a mut [Block]),
    ) -> Self {
        let levels = shape.levels.iter().zip(which);
        let parts = levels.map_while(|(level, which)| {
            let [first, end] = [level.start, level.end].map(|n| shape.first_blocks[n] as usize);
            Some(LevelPart {
                which,
                nodes: Window::new(level.start, nodes.split_off_mut(..level.len())?),
                blocks: Window::new(first, blocks.split_off_mut(..end - first)?),
            })
        });
        Self(parts.filter(|part| part.which.count() > 0).collect())
    }

    /// Gives each level of some subtrees to `task` after the one below, with that; many subtrees in parallel. Adds up what it
    /// returns, in the same order for every number of threads.
    pub(crate) fn fold<S: Add<Output = S> + Default + Send>(
        mut self,
        shape: &BlockTree,
        task: &(impl Fn(&mut LevelPart<'_>, Option<&LevelPart<'_>>) -> S + Sync),
    ) -> S {
        let counts = self.0.iter().map(|level| level.which.count());
        if counts.sum::<usize>() <= RUN {
            let levels = (0..self.0.len()).rev();
            return levels.fold(S::default(), |sum, level| sum + self.give(level, task));
        }
        if self.0[0].which.count() == 1 {
            let below = self.0[1..].iter_mut().map(LevelPart::reborrow);
            let below = Subtrees(below.collect()).fold(shape, task);
            return below + self.give(0, task);
        }
        let [left, right] = self.halves(shape);
        let (a, b) = rayon::join(|| left.fold(shape, task), || right.fold(shape, task));
        a + b
    }

    fn give<S>(
        &mut self,
        level: usize,
        task: &impl Fn(&mut LevelPart<'_>, Option<&LevelPart<'_>>) -> S,
    ) -> S {
        let (above, below) = self.0.split_at_mut(level + 1);
        task(&mut above[level], below.first())
    }

    /// Cuts in the middle of the uppermost nodes.
    fn halves(self, shape: &BlockTree) -> [Self; 2] {
        let top = &self.0[0].which;
        let mut node = top.at(top.count() / 2);
        let [mut left, mut right] = [0; 2].map(|_| Vec::with_capacity(self.0.len()));
        for level in self.0 {
            let [before, after] = level.split(node, shape);
            node = shape.first_children[node] as usize;
            left.extend(Some(before).filter(|level| level.which.count() > 0));
            right.extend(Some(after).filter(|level| level.which.count() > 0));
        }
        [Self(left), Self(right)]
    }
}
