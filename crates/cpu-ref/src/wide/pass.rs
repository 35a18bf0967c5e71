//! Preprocess and refit from node to node: over all of them, or over those of a list.

use super::fit::{fit_block, fit_child};
use super::tree::{Block, EMPTY, LANES, Link, Node, Wide};
use crate::preprocess::{Geometry, Unhittable};
use crate::simd::{Isa, Level, Work};
use bvh_layout::BlockTree;
use std::ops::Range;

/// Nodes that one task handles.
const RUN: usize = 128;

/// Nodes that a pass goes over.
#[derive(Clone)]
pub(super) enum Which<'a> {
    /// All of a range.
    All(Range<usize>),
    /// Those of a rising list; and for each node of the tree, a bit for each lane that counts.
    Listed(&'a [u32], &'a [u8]),
}

impl Which<'_> {
    fn count(&self) -> usize {
        match self {
            Self::All(range) => range.len(),
            Self::Listed(list, _) => list.len(),
        }
    }

    /// The node in some place among them, and the lanes of it that count.
    #[inline(always)]
    fn at(&self, place: usize) -> (usize, u8) {
        match self {
            Self::All(range) => (range.start + place, u8::MAX),
            Self::Listed(list, lanes) => (list[place] as usize, lanes[list[place] as usize]),
        }
    }

    /// Two halves, and the first node of the second.
    fn halves(self) -> (Self, Self, usize) {
        match self {
            Self::All(Range { start, end }) => {
                let middle = start + ((end - start) / 2).next_multiple_of(RUN);
                (Self::All(start..middle), Self::All(middle..end), middle)
            }
            Self::Listed(list, lanes) => {
                let (left, right) = list.split_at(list.len() / 2);
                let middle = right[0] as usize;
                (
                    Self::Listed(left, lanes),
                    Self::Listed(right, lanes),
                    middle,
                )
            }
        }
    }
}

impl Wide {
    /// Sets corners of blocks, and their boxes in nodes. Returns the areas within those blocks, too.
    pub(super) fn fit_blocks(
        &mut self,
        which: Which<'_>,
        geometry: Geometry<'_>,
    ) -> (Unhittable, f64) {
        let sources = Sources {
            geometry,
            shape: &self.shape,
            stale: std::mem::take(&mut self.stale),
            level: self.level,
        };
        sources.fit(Blocks {
            which,
            nodes: &mut self.nodes,
            blocks: &mut self.blocks,
            first_node: 0,
            first_block: 0,
        })
    }

    /// Sets the boxes of inner nodes, deepest first; `which` says of each level, root first, where. Returns the half areas
    /// of boxes between those.
    pub(super) fn fit_nodes<'a>(
        &mut self,
        which: impl DoubleEndedIterator<Item = Which<'a>> + ExactSizeIterator,
    ) -> f64 {
        let mut total = 0.0;
        for (which, level) in which.zip(&self.shape.levels).rev() {
            let (nodes, below) = self.nodes.split_at_mut(level.end);
            let inner = Inner {
                which,
                nodes,
                first_node: 0,
                below: (below, level.end),
            };
            total += inner.fit(self.level);
        }
        total
    }
}

/// What all blocks are made from.
#[derive(Clone, Copy)]
struct Sources<'a> {
    geometry: Geometry<'a>,
    shape: &'a BlockTree,
    /// Whether nodes and blocks are still another tree's. They are all gone over then.
    stale: bool,
    level: Level,
}

/// Some nodes, and slices that hold them and their blocks.
struct Blocks<'a> {
    which: Which<'a>,
    nodes: &'a mut [Node],
    blocks: &'a mut [Block],
    first_node: usize,
    first_block: usize,
}

impl Sources<'_> {
    /// Halves the nodes until there are few: a plain recursion, since blocks are cut where nodes are.
    fn fit(self, part: Blocks<'_>) -> (Unhittable, f64) {
        if part.which.count() <= RUN {
            let sources = self;
            return self.level.run(FitBlocks { sources, part });
        }
        let (left, right, node) = part.which.halves();
        let block = self.shape.first_blocks[node] as usize;
        let (left_nodes, right_nodes) = part.nodes.split_at_mut(node - part.first_node);
        let (left_blocks, right_blocks) = part.blocks.split_at_mut(block - part.first_block);
        let left = Blocks {
            which: left,
            nodes: left_nodes,
            blocks: left_blocks,
            ..part
        };
        let right = Blocks {
            which: right,
            nodes: right_nodes,
            blocks: right_blocks,
            first_node: node,
            first_block: block,
        };
        let (mut sum, right) = rayon::join(|| self.fit(left), || self.fit(right));
        sum.0 += right.0;
        (sum.0, sum.1 + right.1)
    }
}

struct FitBlocks<'a> {
    sources: Sources<'a>,
    part: Blocks<'a>,
}

impl Work for FitBlocks<'_> {
    type Out = (Unhittable, f64);

    #[inline(always)]
    fn run<I: Isa>(self) -> (Unhittable, f64) {
        let (sources, part) = (self.sources, self.part);
        let (mut unhittable, mut areas) = (Unhittable::default(), 0.0);
        for place in 0..part.which.count() {
            let (n, lanes) = part.which.at(place);
            let node = &mut part.nodes[n - part.first_node];
            if sources.stale {
                let shape = &sources.shape.nodes[n];
                *node = Node {
                    planes: EMPTY,
                    links: shape.links,
                    ranges: shape.ranges,
                };
            }
            for lane in 0..LANES {
                let link = node.links[lane];
                if lanes >> lane & 1 == 0 || !link.is_block() {
                    continue;
                }
                let block = &mut part.blocks[link.index() - part.first_block];
                let source = &sources.shape.blocks[link.index()];
                if sources.stale {
                    block.triangles = source.triangles;
                }
                let to = (&mut *node, lane, block);
                areas += fit_block::<I>(&sources.geometry, source, to, &mut unhittable);
            }
        }
        (unhittable, areas)
    }
}

/// Some nodes of one level, and a slice that holds them.
struct Inner<'a> {
    which: Which<'a>,
    nodes: &'a mut [Node],
    first_node: usize,
    /// The nodes of later levels, and the first of them.
    below: (&'a [Node], usize),
}

impl Inner<'_> {
    /// Halves the nodes until there are few.
    fn fit(self, level: Level) -> f64 {
        if self.which.count() <= RUN {
            return level.run(self);
        }
        let (left, right, node) = self.which.halves();
        let (left_nodes, right_nodes) = self.nodes.split_at_mut(node - self.first_node);
        let left = Inner {
            which: left,
            nodes: left_nodes,
            ..self
        };
        let right = Inner {
            which: right,
            nodes: right_nodes,
            first_node: node,
            ..self
        };
        let (left, right) = rayon::join(|| left.fit(level), || right.fit(level));
        left + right
    }
}

impl Work for Inner<'_> {
    type Out = f64;

    #[inline(always)]
    fn run<I: Isa>(self) -> f64 {
        let (below, end) = self.below;
        let mut sum = 0.0;
        for place in 0..self.which.count() {
            let (n, lanes) = self.which.at(place);
            let node = &mut self.nodes[n - self.first_node];
            for lane in 0..LANES {
                let link = node.links[lane];
                let is_inner = !link.is_block() && link != Link::ROOT;
                if is_inner && lanes >> lane & 1 == 1 {
                    sum += fit_child(node, lane, &below[link.index() - end]);
                }
            }
        }
        sum
    }
}
