//! Binary record in, shape of the wide tree out: in parallel, level by level.

use super::fold::Ranges;
use super::tree::{Block, LANES, Link, Node, Source, Wide};
use crate::reserve;
use backend::Result;
use bvh_layout::Topology;
use rayon::prelude::*;
use std::ops::Range;

/// Binary nodes, wide nodes or blocks that one task handles.
const RUN: usize = 2048;

/// What is used again from tree to tree.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    /// Leaves below each inner node of the binary tree.
    sizes: Vec<u32>,
    /// The nodes of one level.
    opened: Vec<Opened>,
    /// The binary nodes that a level's nodes stand for.
    level: Vec<Binary>,
    /// The binary nodes that blocks stand for.
    block_roots: Vec<Binary>,
    /// The tree before gave its memory for the next one.
    nodes: Vec<Node>,
    levels: Vec<Range<usize>>,
    first_blocks: Vec<u32>,
}

/// A binary node: the rank of a leaf (flagged) or of an inner node, among their kind.
#[derive(Clone, Copy, Debug, Default)]
struct Binary(u32);

impl Binary {
    const LEAF: u32 = 1 << 31;

    #[inline]
    fn leaf(self) -> Option<u32> {
        (self.0 & Self::LEAF != 0).then_some(self.0 & !Self::LEAF)
    }
}

/// Neighbouring subtrees that together make one node or block.
#[derive(Clone, Copy, Debug, Default)]
struct Opened {
    lanes: [Binary; LANES],
    count: usize,
    /// First lane and end of each binary node opened; one less than lanes.
    ranges: [[u8; 2]; LANES - 1],
}

impl Opened {
    fn of(root: Binary) -> Self {
        let mut opened = Self::default();
        opened.lanes[0] = root;
        opened.count = 1;
        opened
    }

    /// Puts the children of the inner node in `lane` in its place.
    fn open(&mut self, lane: usize, [left, right]: [Binary; 2]) {
        self.lanes.copy_within(lane + 1..self.count, lane + 2);
        self.lanes[lane] = left;
        self.lanes[lane + 1] = right;
        let lane = lane as u8;
        for [first, end] in &mut self.ranges[..self.count - 1] {
            *first += u8::from(*first > lane);
            *end += u8::from(*end > lane);
        }
        self.ranges[self.count - 1] = [lane, lane + 2];
        self.count += 1;
    }

    fn ranges(&self) -> Ranges {
        let mut ranges = Ranges::NONE;
        for &[first, end] in &self.ranges[..self.count - 1] {
            ranges.push(first, end);
        }
        ranges
    }

    fn lanes(&self) -> &[Binary] {
        &self.lanes[..self.count]
    }
}

/// A binary record with the size of each subtree.
#[derive(Clone, Copy)]
struct Shape<'a> {
    bits: &'a [u32],
    ranks: &'a [u32],
    sizes: &'a [u32],
}

impl Shape<'_> {
    #[inline]
    fn node(&self, node: u32) -> Binary {
        let (word, bit) = (node as usize / 32, node % 32);
        let before = self.ranks[word] + (self.bits[word] & ((1 << bit) - 1)).count_ones();
        if self.bits[word] >> bit & 1 == 1 {
            Binary(before | Binary::LEAF)
        } else {
            Binary(node - before)
        }
    }

    #[inline]
    fn children(&self, inner: Binary) -> [Binary; 2] {
        Topology::children_of_inner(inner.0).map(|node| self.node(node))
    }

    /// Leaves below; `deeper` begins with inner node `first`.
    #[inline]
    fn size_among(&self, node: Binary, deeper: &[u32], first: usize) -> u32 {
        match node.leaf() {
            Some(_) => 1,
            None => deeper[node.0 as usize - first],
        }
    }

    #[inline]
    fn size(&self, node: Binary) -> u32 {
        self.size_among(node, self.sizes, 0)
    }

    /// The subtrees of one node: the largest is opened until there are enough.
    fn open_node(&self, root: Binary) -> Opened {
        let mut opened = Opened::of(root);
        while opened.count < LANES {
            let size = |lane: &usize| self.size(opened.lanes[*lane]);
            let Some(largest) = (0..opened.count).max_by_key(size) else {
                break;
            };
            if size(&largest) as usize <= LANES {
                break;
            }
            opened.open(largest, self.children(opened.lanes[largest]));
        }
        opened
    }

    /// The leaves of one block.
    fn open_block(&self, root: Binary) -> Opened {
        let mut opened = Opened::of(root);
        let mut lane = 0;
        while lane < opened.count {
            if opened.lanes[lane].leaf().is_some() {
                lane += 1;
            } else {
                opened.open(lane, self.children(opened.lanes[lane]));
            }
        }
        opened
    }
}

impl Memory {
    /// Counts the leaves below every inner node, deepest level first.
    fn measure(&mut self, tree: &Topology) {
        self.sizes.clear();
        self.sizes.resize(tree.leaf_count().saturating_sub(1), 0);
        let shape = Shape {
            bits: tree.leaf_bits(),
            ranks: tree.leaf_ranks(),
            sizes: &[],
        };
        let levels: Vec<_> = tree.levels().collect();
        for level in levels.iter().rev() {
            let [start, end] = [level.inner.start, level.inner.end].map(|i| i as usize);
            let (upper, deeper) = self.sizes.split_at_mut(end);
            let count = |(i, size): (usize, &mut u32)| {
                let children = shape.children(Binary((start + i) as u32));
                *size = children
                    .map(|c| shape.size_among(c, deeper, end))
                    .iter()
                    .sum();
            };
            let sizes = upper[start..].par_iter_mut().enumerate();
            sizes.with_min_len(RUN).for_each(count);
        }
    }
}

impl Memory {
    /// Makes all nodes, and notes what the blocks are to be.
    fn add_nodes(&mut self, shape: Shape<'_>) {
        self.nodes.clear();
        self.levels.clear();
        self.first_blocks.clear();
        self.block_roots.clear();
        self.level.clear();
        if !shape.bits.is_empty() {
            self.level.push(shape.node(0));
        }
        while !self.level.is_empty() {
            self.add_level(shape);
        }
        if self.nodes.is_empty() {
            self.nodes.push(Node::UNUSED);
            self.first_blocks.push(0);
        }
        self.first_blocks.push(self.block_roots.len() as u32);
    }

    /// Makes the nodes of one level, and notes what the next level is to be.
    fn add_level(&mut self, shape: Shape<'_>) {
        let roots = self.level.par_iter().with_min_len(RUN / 8);
        roots
            .map(|&root| shape.open_node(root))
            .collect_into_vec(&mut self.opened);
        let start = self.nodes.len();
        let end = start + self.opened.len();
        self.level.clear();
        for opened in &self.opened {
            self.first_blocks.push(self.block_roots.len() as u32);
            let mut node = Node {
                ranges: opened.ranges(),
                ..Node::UNUSED
            };
            for (link, &lane) in node.links.iter_mut().zip(opened.lanes()) {
                if shape.size(lane) as usize <= LANES {
                    *link = Link::block(self.block_roots.len());
                    self.block_roots.push(lane);
                } else {
                    *link = Link::node(end + self.level.len());
                    self.level.push(lane);
                }
            }
            self.nodes.push(node);
        }
        self.levels.push(start..end);
    }
}

impl Wide {
    /// Takes over a record's shape, reusing memory. Boxes and corners are left stale.
    ///
    /// `triangles` are the scene's, three vertices each.
    ///
    /// # Errors
    /// Memory does not suffice; the old tree is then still current.
    pub(crate) fn collapse(&mut self, tree: &Topology, triangles: &[[u32; 3]]) -> Result<()> {
        let memory = &mut self.memory;
        memory.measure(tree);
        let sizes = std::mem::take(&mut memory.sizes);
        let shape = Shape {
            bits: tree.leaf_bits(),
            ranks: tree.leaf_ranks(),
            sizes: &sizes,
        };
        memory.add_nodes(shape);
        let blocks = memory.block_roots.len();
        reserve(&mut self.blocks, blocks, "blocks of triangles")?;
        reserve(&mut self.sources, blocks, "blocks of vertices")?;
        std::mem::swap(&mut self.nodes, &mut memory.nodes);
        std::mem::swap(&mut self.levels, &mut memory.levels);
        std::mem::swap(&mut self.first_blocks, &mut memory.first_blocks);
        self.blocks.resize(blocks, Block::UNUSED);
        self.sources.resize(blocks, Source::UNUSED);
        let blocks = self.blocks.par_iter_mut().zip(&mut self.sources);
        blocks
            .zip(&memory.block_roots)
            .with_min_len(RUN / 8)
            .for_each(|((block, source), &root)| {
                let leaves = shape.open_block(root);
                (*block, *source) = of_leaves(&leaves, tree.leaf_triangles(), triangles);
            });
        self.binary.clone_from(tree);
        memory.sizes = sizes;
        Ok(())
    }
}

/// A block without corners, and where they come from.
fn of_leaves(leaves: &Opened, leaf_triangles: &[u32], triangles: &[[u32; 3]]) -> (Block, Source) {
    let mut block = Block::UNUSED;
    let mut source = Source {
        ranges: leaves.ranges(),
        count: leaves.count as u32,
        ..Source::UNUSED
    };
    for (lane, leaf) in leaves.lanes().iter().enumerate() {
        let rank = leaf.leaf().unwrap_or_default();
        let triangle = leaf_triangles[rank as usize];
        block.triangles[lane] = triangle;
        let vertices = triangles[triangle as usize];
        for (corner, vertex) in source.vertices.iter_mut().zip(vertices) {
            corner[lane] = vertex;
        }
    }
    (block, source)
}
