//! Bottom-up passes over the tree, parallel across disjoint subtrees.

use crate::tree::{Node8, TriangleBlock};
use crate::window::Window;
use bvh_layout::BlockTree;
use std::ops::Add;

/// Nodes that one task handles.
const RUN: usize = 32;

/// Neighbouring nodes of one level, with their blocks.
pub(crate) struct LevelPart<'a> {
    /// The nodes to process, ascending.
    pub(crate) selected: &'a [u32],
    pub(crate) nodes: Window<'a, Node8>,
    pub(crate) blocks: Window<'a, TriangleBlock>,
}

impl LevelPart<'_> {
    fn reborrow(&mut self) -> LevelPart<'_> {
        LevelPart {
            selected: self.selected,
            nodes: self.nodes.reborrow(),
            blocks: self.blocks.reborrow(),
        }
    }

    /// Splits off everything from a node on.
    fn split(self, node: usize, shape: &BlockTree) -> [Self; 2] {
        let place = self.selected.partition_point(|&n| (n as usize) < node);
        let (selected, more_selected) = self.selected.split_at(place);
        let [nodes, more_nodes] = self.nodes.split(node);
        let [blocks, more_blocks] = self.blocks.split(shape.first_blocks[node] as usize);
        let level = |selected, nodes, blocks| Self {
            selected,
            nodes,
            blocks,
        };
        [
            level(selected, nodes, blocks),
            level(more_selected, more_nodes, more_blocks),
        ]
    }
}

/// Neighbouring nodes of one level, and all nodes below these, level by level. Empty if no node is selected.
pub(crate) struct Subtrees<'a>(Vec<LevelPart<'a>>);

impl<'a> Subtrees<'a> {
    /// Returns the whole tree as one part. `selected` contains the nodes to process, level by level, root first. The
    /// ancestors of a selected node must be selected too.
    pub(crate) fn of(
        shape: &BlockTree,
        selected: impl Iterator<Item = &'a [u32]>,
        mut nodes: &'a mut [Node8],
        mut blocks: &'a mut [TriangleBlock],
    ) -> Self {
        let levels = shape.levels.iter().zip(selected);
        let parts = levels.map_while(|(level, selected)| {
            let [first, end] = [level.start, level.end].map(|n| shape.first_blocks[n] as usize);
            Some(LevelPart {
                selected,
                nodes: Window::new(level.start, nodes.split_off_mut(..level.len())?),
                blocks: Window::new(first, blocks.split_off_mut(..end - first)?),
            })
        });
        Self(parts.filter(|part| !part.selected.is_empty()).collect())
    }

    /// Runs `task` on every level, bottom-up. The second argument of `task` is the level below.
    ///
    /// Processes large subtrees in parallel. The order of the sum does not depend on the number of threads.
    pub(crate) fn fold<S: Add<Output = S> + Default + Send>(
        mut self,
        shape: &BlockTree,
        task: &(impl Fn(&mut LevelPart<'_>, Option<&LevelPart<'_>>) -> S + Sync),
    ) -> S {
        let counts = self.0.iter().map(|level| level.selected.len());
        if counts.sum::<usize>() <= RUN {
            let levels = (0..self.0.len()).rev();
            return levels.fold(S::default(), |sum, level| sum + self.run(level, task));
        }
        if self.0[0].selected.len() == 1 {
            let below = self.0[1..].iter_mut().map(LevelPart::reborrow);
            let below = Subtrees(below.collect()).fold(shape, task);
            return below + self.run(0, task);
        }
        let [left, right] = self.halves(shape);
        let (a, b) = rayon::join(|| left.fold(shape, task), || right.fold(shape, task));
        a + b
    }

    fn run<S>(
        &mut self,
        level: usize,
        task: &impl Fn(&mut LevelPart<'_>, Option<&LevelPart<'_>>) -> S,
    ) -> S {
        let (above, below) = self.0.split_at_mut(level + 1);
        task(&mut above[level], below.first())
    }

    /// Splits in two at the middle node of the top level.
    fn halves(self, shape: &BlockTree) -> [Self; 2] {
        let top = self.0[0].selected;
        let mut node = top[top.len() / 2] as usize;
        let [mut left, mut right] = [0; 2].map(|_| Vec::with_capacity(self.0.len()));
        for level in self.0 {
            let [before, after] = level.split(node, shape);
            node = shape.first_children[node] as usize;
            left.extend(Some(before).filter(|level| !level.selected.is_empty()));
            right.extend(Some(after).filter(|level| !level.selected.is_empty()));
        }
        [Self(left), Self(right)]
    }
}
