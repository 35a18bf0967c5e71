//! What of the wide tree moves: preprocess and refit pass over the rest once it was done.

use super::fit::{fit_block, fit_child};
use super::tree::{Block, LANES, Link, Node, Wide};
use crate::preprocess::{Geometry, Unhittable};
use crate::simd::{Isa, Level, Work};
use bvh_layout::{Block as Source, BlockTree};
use rayon::prelude::*;
use std::ops::Range;

/// Entries of a list that one task handles.
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
    still_blocks: Option<(u64, f64)>,
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
    pub(crate) fn preprocess(&mut self, geometry: Geometry<'_>) -> Unhittable {
        let Some(mut moving) = self.moving.take() else {
            let (unhittable, areas) = self.preprocess_whole(geometry);
            self.block_areas = areas;
            return unhittable;
        };
        let unhittable = match moving.still_blocks {
            Some((degenerate, still)) => {
                let (mut found, areas) = self.preprocess_moving(&moving, geometry);
                self.block_areas = still + areas;
                // A static triangle with a leaf is active.
                found.degenerate += degenerate;
                found
            }
            None => {
                let (found, areas) = self.preprocess_whole(geometry);
                self.block_areas = areas;
                let (again, moving_areas) = self.preprocess_moving(&moving, geometry);
                let degenerate = found.degenerate - again.degenerate;
                moving.still_blocks = Some((degenerate, areas - moving_areas));
                found
            }
        };
        self.moving = Some(moving);
        unhittable
    }

    /// Sets the boxes of inner nodes, after the first time of those that move alone. Returns the half areas of
    /// all boxes of the binary tree, as [`crate::refit::refit`] does.
    pub(crate) fn refit(&mut self, sums: &mut Vec<f64>) -> f64 {
        let Some(mut moving) = self.moving.take() else {
            let between = self.refit_whole(sums);
            return self.total_areas(between);
        };
        let between = match moving.still_nodes {
            Some(still) => still + self.refit_moving(&moving),
            None => {
                let between = self.refit_whole(sums);
                moving.still_nodes = Some(between - self.refit_moving(&moving));
                between
            }
        };
        self.moving = Some(moving);
        self.total_areas(between)
    }

    fn preprocess_moving(&mut self, moving: &Moving, geometry: Geometry<'_>) -> (Unhittable, f64) {
        let whole = Whole {
            geometry,
            sources: &self.shape.blocks,
            first_blocks: &self.shape.first_blocks,
            lanes: &moving.lanes,
            level: self.level,
        };
        let part = Part {
            list: &moving.block_nodes,
            nodes: &mut self.nodes,
            blocks: &mut self.blocks,
            first_node: 0,
            first_block: 0,
        };
        whole.preprocess(part)
    }

    fn refit_moving(&mut self, moving: &Moving) -> f64 {
        let mut total = 0.0;
        for (range, level) in moving.levels.iter().zip(&self.shape.levels).rev() {
            let (upper, below) = self.nodes.split_at_mut(level.end);
            let run = RefitList {
                list: &moving.inner_nodes[range.clone()],
                nodes: upper,
                first_node: 0,
                below: (below, level.end),
                lanes: &moving.lanes,
            };
            total += run.refit(self.level);
        }
        total
    }
}

/// What all parts of a list share.
#[derive(Clone, Copy)]
struct Whole<'a> {
    geometry: Geometry<'a>,
    sources: &'a [Source],
    first_blocks: &'a [u32],
    lanes: &'a [u8],
    level: Level,
}

/// Nodes of a list, and slices that hold them and their blocks.
struct Part<'a> {
    list: &'a [u32],
    nodes: &'a mut [Node],
    blocks: &'a mut [Block],
    first_node: usize,
    first_block: usize,
}

impl Whole<'_> {
    /// Halves the list until it is short.
    fn preprocess(self, part: Part<'_>) -> (Unhittable, f64) {
        if part.list.len() <= RUN {
            return self.level.run(PreprocessList { whole: self, part });
        }
        let (left_list, right_list) = part.list.split_at(part.list.len() / 2);
        let node = right_list[0] as usize;
        let block = self.first_blocks[node] as usize;
        let (left_nodes, right_nodes) = part.nodes.split_at_mut(node - part.first_node);
        let (left_blocks, right_blocks) = part.blocks.split_at_mut(block - part.first_block);
        let left = Part {
            list: left_list,
            nodes: left_nodes,
            blocks: left_blocks,
            ..part
        };
        let right = Part {
            list: right_list,
            nodes: right_nodes,
            blocks: right_blocks,
            first_node: node,
            first_block: block,
        };
        let (mut sum, right) = rayon::join(|| self.preprocess(left), || self.preprocess(right));
        sum.0 += right.0;
        (sum.0, sum.1 + right.1)
    }
}

struct PreprocessList<'a> {
    whole: Whole<'a>,
    part: Part<'a>,
}

impl Work for PreprocessList<'_> {
    type Out = (Unhittable, f64);

    #[inline(always)]
    fn run<I: Isa>(self) -> (Unhittable, f64) {
        let (whole, part) = (self.whole, self.part);
        let (mut unhittable, mut areas) = (Unhittable::default(), 0.0);
        for &n in part.list {
            let node = &mut part.nodes[n as usize - part.first_node];
            for lane in chosen(whole.lanes[n as usize]) {
                let link = node.links[lane];
                if link.is_block() {
                    let block = &mut part.blocks[link.index() - part.first_block];
                    let source = &whole.sources[link.index()];
                    let to = (&mut *node, lane, block);
                    areas += fit_block::<I>(&whole.geometry, source, to, &mut unhittable);
                }
            }
        }
        (unhittable, areas)
    }
}

/// Nodes of a list on one level, and a slice that holds them.
struct RefitList<'a> {
    list: &'a [u32],
    nodes: &'a mut [Node],
    first_node: usize,
    /// The nodes of later levels, and the first of them.
    below: (&'a [Node], usize),
    lanes: &'a [u8],
}

impl RefitList<'_> {
    /// Halves the list until it is short.
    fn refit(self, level: Level) -> f64 {
        if self.list.len() <= RUN {
            return level.run(self);
        }
        let (left_list, right_list) = self.list.split_at(self.list.len() / 2);
        let node = right_list[0] as usize;
        let (left_nodes, right_nodes) = self.nodes.split_at_mut(node - self.first_node);
        let left = RefitList {
            list: left_list,
            nodes: left_nodes,
            ..self
        };
        let right = RefitList {
            list: right_list,
            nodes: right_nodes,
            first_node: node,
            ..self
        };
        let (left, right) = rayon::join(|| left.refit(level), || right.refit(level));
        left + right
    }
}

impl Work for RefitList<'_> {
    type Out = f64;

    #[inline(always)]
    fn run<I: Isa>(self) -> f64 {
        let (below, end) = self.below;
        let mut sum = 0.0;
        for &n in self.list {
            let node = &mut self.nodes[n as usize - self.first_node];
            for lane in chosen(self.lanes[n as usize]) {
                let link = node.links[lane];
                if !link.is_block() {
                    sum += fit_child(node, lane, &below[link.index() - end]);
                }
            }
        }
        sum
    }
}
