//! The moving parts of the wide tree. Preprocess and refit skip static parts once they are fitted.

use crate::fit::{FitTask, Fitted};
use crate::tree::Link;
use bvh_layout::{Block, BlockTree};
use geom::StaticParts;
use rayon::prelude::*;
use std::ops::Range;

/// Minimum number of nodes per task.
const RUN: usize = 128;

/// The moving nodes of a tree, and the result of fitting the static nodes once.
#[derive(Debug)]
pub(crate) struct MovingLanes {
    /// For each node, a bit mask of the moving lanes.
    lanes: Vec<u8>,
    /// Nodes with a moving lane, ascending.
    nodes: Vec<u32>,
    /// Range in `nodes` of each level, root first.
    levels: Vec<Range<usize>>,
    /// Result of fitting the static parts. `None` until the first fit.
    still: Option<Fitted>,
}

impl MovingLanes {
    /// Lists the moving nodes of a tree that was just adopted. Returns `None` if more than half of all lanes move: see
    /// [`StaticParts::pays`].
    pub(crate) fn of(shape: &BlockTree, is_static: &[bool]) -> Option<Self> {
        let lanes = moving_lanes(shape, is_static);
        let numbers = 0..lanes.len() as u32;
        let nodes: Vec<u32> = numbers.filter(|&n| lanes[n as usize] != 0).collect();
        let index_of = |n: usize| nodes.partition_point(|&i| (i as usize) < n);
        let levels = shape.levels.iter();
        let levels = levels.map(|l| index_of(l.start)..index_of(l.end)).collect();
        let moving: u32 = lanes.iter().map(|lanes| lanes.count_ones()).sum();
        // Every block and every node but the root is in a lane.
        let all = shape.blocks.len() + shape.nodes.len() - 1;
        StaticParts::pays(moving as usize, all).then_some(Self {
            lanes,
            nodes,
            levels,
            still: None,
        })
    }

    /// Sets all corners and boxes. After the first call for a tree, sets only the moving ones.
    pub(crate) fn fit(&mut self, task: &mut FitTask<'_>) -> Fitted {
        // Static areas have their own sum: a total minus moving areas could have no correct digit, because moving parts
        // can be far larger. Static parts are fitted first, because boxes of moving parts may contain them.
        let still = self.still.unwrap_or_else(|| {
            let still_lanes: Vec<u8> = self.lanes.iter().map(|lanes| !lanes).collect();
            task.fit_all(Some(&still_lanes))
        });
        self.still = Some(still);
        let moving = self.levels.iter().map(|level| &self.nodes[level.clone()]);
        still + task.fit(moving, Some(&self.lanes))
    }
}

/// Computes a bit mask for each node: the lanes that contain a moving triangle. Proceeds bottom-up.
fn moving_lanes(shape: &BlockTree, is_static: &[bool]) -> Vec<u8> {
    let mut lanes = vec![0; shape.nodes.len()];
    let moves = |block: &Block| {
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
                    Link::NONE => false,
                    block if block.is_block() => moves(&shape.blocks[block.index()]),
                    child => below[child.index() - level.end] != 0,
                };
                *bits |= u8::from(moves) << lane;
            }
        });
    }
    lanes
}
