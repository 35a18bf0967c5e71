//! What of the wide tree moves: preprocess and refit pass over the rest once it was done.

use crate::fit::{Chosen, Fitted, Fold};
use crate::tree::{LANES, Link, Wide};
use bvh_layout::{Block as Source, BlockTree};
use cpu_ref::geometry::{Geometry, Unhittable};
use cpu_ref::pass::Which;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Nodes that one task handles.
const RUN: usize = 128;

/// Lists of what moves, and what was done since the tree was adopted.
#[derive(Debug, Default)]
pub(crate) struct Moving {
    /// For each node, a bit for each lane that moves.
    lanes: Vec<u8>,
    /// Nodes with a block that moves, rising.
    block_nodes: Vec<u32>,
    /// Nodes with an inner child that moves, rising; and where each level's lie, root first.
    inner_nodes: Vec<u32>,
    levels: Vec<Range<usize>>,
    /// Triangles of zero area in blocks that do not move, and areas within those, once all were preprocessed.
    still_blocks: Option<Fitted>,
    /// Areas between children of nodes that do not move, once all were refitted.
    still_nodes: Option<f64>,
}

impl Moving {
    /// Lists what moves of a tree just adopted.
    pub(crate) fn of(shape: &BlockTree, is_static: &[bool]) -> Self {
        let lanes = moving_lanes(shape, is_static);
        let having = |block: bool| -> Vec<u32> {
            let holds = |n: &u32| {
                let (links, lanes) = (&shape.nodes[*n as usize].links, lanes[*n as usize]);
                chosen(lanes).any(|lane| links[lane].is_block() == block)
            };
            (0..lanes.len() as u32).filter(holds).collect()
        };
        let inner_nodes = having(false);
        let place = |n: usize| inner_nodes.partition_point(|&i| (i as usize) < n);
        let levels = shape.levels.iter();
        Self {
            block_nodes: having(true),
            levels: levels.map(|l| place(l.start)..place(l.end)).collect(),
            inner_nodes,
            lanes,
            still_blocks: None,
            still_nodes: None,
        }
    }

    /// Nodes with blocks that move.
    fn blocks(&self) -> Chosen<'_> {
        (Which::Listed(&self.block_nodes), Some(&self.lanes))
    }

    /// Of each level the nodes with inner children that move.
    fn fit_nodes(&self, tree: &mut Wide) -> f64 {
        let levels = self.levels.iter();
        let listed = levels.map(|level| Which::Listed(&self.inner_nodes[level.clone()]));
        tree.fit_nodes(listed, Some(&self.lanes))
    }
}

/// For each node, a bit for each lane with a moving triangle below, deepest level first.
fn moving_lanes(shape: &BlockTree, is_static: &[bool]) -> Vec<u8> {
    let mut lanes = vec![0; shape.nodes.len()];
    let moves = |block: &Source| {
        let triangles = block.triangles.iter().filter(|&&t| t != u32::MAX);
        triangles.into_iter().any(|&t| !is_static[t as usize])
    };
    for level in shape.levels.iter().rev() {
        let (upper, below) = lanes.split_at_mut(level.end);
        let nodes = upper[level.clone()].par_iter_mut();
        let nodes = nodes.zip(&shape.nodes[level.clone()]).with_min_len(RUN);
        nodes.for_each(|(bits, node)| {
            for (lane, &link) in node.links.iter().enumerate() {
                let moves = match link {
                    Link::ROOT => false,
                    block if block.is_block() => moves(&shape.blocks[block.index()]),
                    child => below[child.index() - level.end] != 0,
                };
                *bits |= u8::from(moves) << lane;
            }
        });
    }
    lanes
}

/// The lanes whose bits are set.
fn chosen(lanes: u8) -> impl Iterator<Item = usize> {
    (0..LANES).filter(move |lane| lanes >> lane & 1 == 1)
}

impl Wide {
    /// Sets corners and boxes of blocks, after the first time of those that move alone.
    pub(crate) fn preprocess_blocks(&mut self, geometry: &Geometry<'_>) -> Unhittable {
        let whole = (Which::All(0..self.nodes.len()), None);
        let mut moving = self.moving.take();
        let still = moving.as_ref().and_then(|moving| moving.still_blocks);
        let fitted = match (&mut moving, still) {
            // A static triangle with a leaf is active.
            (Some(moving), Some(still)) => still + self.fit_blocks(moving.blocks(), geometry),
            (moving, _) => {
                let fitted = self.fit_blocks(whole, geometry);
                if let Some(moving) = moving {
                    let again = self.fit_blocks(moving.blocks(), geometry);
                    let mut still = Fitted::default();
                    still.unhittable.degenerate =
                        fitted.unhittable.degenerate - again.unhittable.degenerate;
                    still.areas = fitted.areas - again.areas;
                    moving.still_blocks = Some(still);
                }
                fitted
            }
        };
        self.moving = moving;
        self.block_areas = fitted.areas;
        fitted.unhittable
    }

    /// Sets the boxes of inner nodes, after the first time of those that move alone. Returns the half areas of
    /// all boxes of the binary tree.
    pub(crate) fn refit_nodes(&mut self) -> f64 {
        let mut moving = self.moving.take();
        let still = moving.as_ref().and_then(|moving| moving.still_nodes);
        let between = match (&mut moving, still) {
            (Some(moving), Some(still)) => still + moving.fit_nodes(self),
            (moving, _) => {
                let shape = Arc::clone(&self.shape);
                let between = self.fit_nodes(shape.levels.iter().cloned().map(Which::All), None);
                if let Some(moving) = moving {
                    moving.still_nodes = Some(between - moving.fit_nodes(self));
                }
                between
            }
        };
        self.moving = moving;
        let (root, areas) = self.level.run(Fold(&self.nodes[0]));
        self.root = root;
        self.block_areas + between + areas
    }
}
