//! Binary record in, shape of the wide tree out: in parallel, level by level.

use super::opened::{Binary, Opened, SizedTree};
use super::{Block, BlockTree, First, LANES, Link, WideNode};
use crate::Topology;
use geom::Aabb;
use rayon::prelude::*;

/// Binary nodes, wide nodes or blocks that one task handles.
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
        let sizes = sizes(tree);
        let areas = areas(tree, boxes);
        let shape = SizedTree {
            sizes: &sizes,
            areas: areas.as_deref(),
            first,
            ..SizedTree::of(tree)
        };
        let (mut all, roots) = Self::nodes_of(shape);
        let leaves = tree.leaf_triangles();
        roots
            .into_par_iter()
            .with_min_len(RUN / 8)
            .map(|root| of_leaves(&shape.open_block(root), leaves, triangles))
            .collect_into_vec(&mut all.blocks);
        all
    }

    /// All nodes, and the binary nodes that the blocks are to stand for.
    fn nodes_of(shape: SizedTree<'_>) -> (Self, Vec<Binary>) {
        let mut all = Self::default();
        let mut roots = Vec::new();
        let mut level = match shape.bits {
            [] => Vec::new(),
            _ => vec![shape.node(0)],
        };
        while !level.is_empty() {
            level = all.add_level(shape, &level, &mut roots);
        }
        if all.nodes.is_empty() {
            all.nodes.push(WideNode::EMPTY);
            all.first_blocks.push(0);
        }
        all.first_blocks.push(roots.len() as u32);
        (all, roots)
    }

    /// Makes the nodes of one level, and tells the binary nodes of the next.
    fn add_level(
        &mut self,
        shape: SizedTree<'_>,
        level: &[Binary],
        roots: &mut Vec<Binary>,
    ) -> Vec<Binary> {
        let opened = level.par_iter().with_min_len(RUN / 8);
        let opened: Vec<Opened> = opened.map(|&root| shape.open_node(root)).collect();
        let (start, end) = (self.nodes.len(), self.nodes.len() + opened.len());
        let mut next = Vec::new();
        for opened in &opened {
            self.first_blocks.push(roots.len() as u32);
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

/// Leaves below every inner node, counted from the deepest level up.
fn sizes(tree: &Topology) -> Vec<u32> {
    let mut sizes = vec![0; tree.leaf_count().saturating_sub(1)];
    let shape = SizedTree::of(tree);
    let levels: Vec<_> = tree.levels().collect();
    for level in levels.iter().rev() {
        let [start, end] = [level.inner.start, level.inner.end].map(|i| i as usize);
        let (upper, deeper) = sizes.split_at_mut(end);
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
    sizes
}

/// Half areas of all inner nodes, if there is a box for each triangle.
fn areas(tree: &Topology, boxes: &[Aabb]) -> Option<Vec<f32>> {
    if boxes.len() != tree.triangle_count() {
        return None;
    }
    let shape = SizedTree::of(tree);
    let triangles = tree.leaf_triangles();
    let mut inner = vec![Aabb::EMPTY; tree.leaf_count().saturating_sub(1)];
    let levels: Vec<_> = tree.levels().collect();
    for level in levels.iter().rev() {
        let [start, end] = [level.inner.start, level.inner.end].map(|i| i as usize);
        let (upper, deeper) = inner.split_at_mut(end);
        let unite = |(i, bounds): (usize, &mut Aabb)| {
            let [a, b] =
                shape
                    .children(Binary((start + i) as u32))
                    .map(|child| match child.leaf() {
                        Some(rank) => boxes[triangles[rank as usize] as usize],
                        None => deeper[child.0 as usize - end],
                    });
            *bounds = a.union(b);
        };
        let nodes = upper[start..].par_iter_mut().enumerate();
        nodes.with_min_len(RUN).for_each(unite);
    }
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
