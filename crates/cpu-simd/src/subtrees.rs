//! Bottom-up passes over the tree, parallel across disjoint subtrees.

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

    /// Splits off everything from a node on.
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

/// Neighbouring nodes of one level and, level by level, all nodes below them. Empty if no node is selected.
pub(crate) struct Subtrees<'a>(Vec<LevelPart<'a>>);

impl<'a> Subtrees<'a> {
    /// Creates the whole tree. `which` selects nodes of each level, root first. The ancestors of a selected node must
    /// be selected too.
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

    /// Runs `task` on each level, after the level below, with that level as its second argument. Large subtrees run in
    /// parallel. Sums the results in the same order for every number of threads.
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

    /// Splits in the middle of the uppermost nodes.
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
