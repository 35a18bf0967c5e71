//! Binary record in, shape of the wide tree out: in parallel, level by level.

use super::{Block, BlockTree, First, LANES, Link, Ranges, WideNode};
use crate::{NodeRank, NodeRanks, Topology};
use geom::Aabb;
use rayon::prelude::*;

/// Wide nodes or blocks that one task handles.
const RUN: usize = 2048;

impl BlockTree {
    /// Of a record, in the rayon pool that the caller installed; `triangles` are the scene's, three vertices each.
    ///
    /// With a box for each triangle in `boxes`, the subtree of the largest area is opened first, else (if there are
    /// none) the one of most triangles. `first` says which of two is asked first where any hit will do.
    ///
    /// # Panics
    /// If the record is not one of these triangles.
    #[must_use]
    pub fn of(tree: &Topology, triangles: &[[u32; 3]], (boxes, first): (&[Aabb], First)) -> Self {
        let sizes = tree.bottom_up(0_u32, |_| 1, |a, b| a + b);
        let areas = areas(tree, boxes);
        let shape = SizedTree {
            sizes: &sizes,
            areas: areas.as_deref(),
            ranks: tree.ranks(),
            first,
        };
        let (mut all, roots) = Self::nodes_of(shape, tree.leaf_count() == 0);
        let leaves = tree.leaf_triangles();
        roots
            .into_par_iter()
            .with_min_len(RUN / 8)
            .map(|root| of_leaves(&shape.open_block(root), leaves, triangles))
            .collect_into_vec(&mut all.blocks);
        all
    }

    /// All nodes, and the binary nodes that the blocks are to stand for.
    fn nodes_of(shape: SizedTree<'_>, is_empty: bool) -> (Self, Vec<NodeRank>) {
        let mut all = Self::default();
        let mut roots = Vec::new();
        let mut level = Vec::new();
        if !is_empty {
            level.push(shape.ranks.of(0));
        }
        while !level.is_empty() {
            level = all.add_level(shape, &level, &mut roots);
        }
        if all.nodes.is_empty() {
            all.nodes.push(WideNode::EMPTY);
            all.first_blocks.push(0);
            all.first_children.push(1);
            all.levels.push(0..1);
        }
        all.first_blocks.push(roots.len() as u32);
        all.first_children.push(all.nodes.len() as u32);
        (all, roots)
    }

    /// Makes the nodes of one level, and tells the binary nodes of the next.
    fn add_level(
        &mut self,
        shape: SizedTree<'_>,
        level: &[NodeRank],
        roots: &mut Vec<NodeRank>,
    ) -> Vec<NodeRank> {
        let opened = level.par_iter().with_min_len(RUN / 8);
        let opened: Vec<Opened> = opened.map(|&root| shape.open_node(root)).collect();
        let (start, end) = (self.nodes.len(), self.nodes.len() + opened.len());
        let mut next = Vec::new();
        for opened in &opened {
            self.first_blocks.push(roots.len() as u32);
            self.first_children.push((end + next.len()) as u32);
            let mut links = [Link::ROOT; LANES];
            for (link, &lane) in links.iter_mut().zip(opened.lanes()) {
                if shape.size(lane) as usize <= LANES {
                    *link = Link::block(roots.len());
                    roots.push(lane);
                } else {
                    *link = Link::node(end + next.len());
                    next.push(lane);
                }
            }
            let ranges = opened.ranges();
            self.nodes.push(WideNode { links, ranges });
        }
        self.levels.push(start..end);
        next
    }
}

/// Half areas of all inner nodes, if there is a box for each triangle.
fn areas(tree: &Topology, boxes: &[Aabb]) -> Option<Vec<f32>> {
    if boxes.len() != tree.triangle_count() {
        return None;
    }
    let triangles = tree.leaf_triangles();
    let leaf = |rank: u32| boxes[triangles[rank as usize] as usize];
    let inner = tree.bottom_up(Aabb::EMPTY, leaf, Aabb::union);
    let areas = inner.par_iter().with_min_len(RUN);
    Some(areas.map(|b| b.half_area() as f32).collect())
}

fn of_leaves(leaves: &Opened, leaf_triangles: &[u32], triangles: &[[u32; 3]]) -> Block {
    let mut block = Block {
        ranges: leaves.ranges(),
        count: leaves.count as u8,
        ..Block::EMPTY
    };
    for (lane, leaf) in leaves.lanes().iter().enumerate() {
        let rank = leaf.leaf().unwrap_or_default();
        let triangle = leaf_triangles[rank as usize];
        block.triangles[lane] = triangle;
        let vertices = triangles[triangle as usize];
        for (corner, vertex) in block.vertices.iter_mut().zip(vertices) {
            corner[lane] = vertex;
        }
    }
    block
}

/// Neighbouring subtrees that together make one node or block.
#[derive(Clone, Copy, Debug, Default)]
struct Opened {
    lanes: [NodeRank; LANES],
    count: usize,
    /// First lane and end of each binary node opened; one less than lanes.
    ranges: [[u8; 2]; LANES - 1],
}

impl Opened {
    fn of(root: NodeRank) -> Self {
        let mut opened = Self::default();
        opened.lanes[0] = root;
        opened.count = 1;
        opened
    }

    /// Puts the children of the inner node in `lane` in its place.
    fn open(&mut self, lane: usize, [left, right]: [NodeRank; 2]) {
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

    fn lanes(&self) -> &[NodeRank] {
        &self.lanes[..self.count]
    }
}

/// A binary record with the size of each subtree.
#[derive(Clone, Copy)]
struct SizedTree<'a> {
    ranks: NodeRanks<'a>,
    sizes: &'a [u32],
    /// Half areas of inner nodes, if boxes are known.
    areas: Option<&'a [f32]>,
    first: First,
}

impl SizedTree<'_> {
    #[inline]
    fn size(&self, node: NodeRank) -> u32 {
        match node.leaf() {
            Some(_) => 1,
            None => self.sizes[node.rank() as usize],
        }
    }

    /// The subtrees of one node: the largest is opened until there are enough.
    fn open_node(&self, root: NodeRank) -> Opened {
        let mut opened = Opened::of(root);
        while opened.count < LANES {
            let lanes = opened.lanes().iter().enumerate();
            let large = lanes.filter(|(_, node)| self.size(**node) as usize > LANES);
            let Some((largest, _)) =
                large.max_by(|a, b| self.extent(*a.1).total_cmp(&self.extent(*b.1)))
            else {
                break;
            };
            opened.open(largest, self.first_last(opened.lanes[largest]));
        }
        opened
    }

    /// The children of an inner node, that which is asked first in the later lane.
    fn first_last(&self, inner: NodeRank) -> [NodeRank; 2] {
        let [left, right] = self.ranks.children(inner);
        // A leaf's area is not at hand: none is less than any.
        match self.first == First::Larger && self.area(left) < self.area(right) {
            true => [left, right],
            false => [right, left],
        }
    }

    fn area(&self, node: NodeRank) -> Option<f32> {
        let areas = self.areas?;
        node.leaf().is_none().then(|| areas[node.rank() as usize])
    }

    /// What subtrees are compared by: their area, else their leaves.
    fn extent(&self, node: NodeRank) -> f32 {
        self.area(node).unwrap_or_else(|| self.size(node) as f32)
    }

    /// The leaves of one block.
    fn open_block(&self, root: NodeRank) -> Opened {
        let mut opened = Opened::of(root);
        let mut lane = 0;
        while lane < opened.count {
            if opened.lanes[lane].leaf().is_some() {
                lane += 1;
            } else {
                opened.open(lane, self.ranks.children(opened.lanes[lane]));
            }
        }
        opened
    }
}
