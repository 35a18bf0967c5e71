//! The moving parts of the wide tree. Preprocess and refit skip static parts once they are fitted.

use crate::fit::Fitted;
use crate::tree::{Link, Wide};
use bvh_layout::{Block as Source, BlockTree};
use cpu_ref::Geometry;
use cpu_ref::pass::Which;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Nodes that one task handles.
const RUN: usize = 128;

/// The moving nodes, and the results of the static ones since the tree was adopted.
#[derive(Debug, Default)]
pub(crate) struct Moving {
    /// For each node, a bit for each moving lane.
    lanes: Vec<u8>,
    /// Nodes with a moving lane, ascending.
    nodes: Vec<u32>,
    /// Range in `nodes` of each level, root first.
    levels: Vec<Range<usize>>,
    /// Degenerate static triangles and areas of static parts, once all were fitted.
    still: Option<Fitted>,
}

impl Moving {
    /// Lists the moving nodes of a tree that was just adopted.
    pub(crate) fn of(shape: &BlockTree, is_static: &[bool]) -> Self {
        let lanes = moving_lanes(shape, is_static);
        let numbers = 0..lanes.len() as u32;
        let nodes: Vec<u32> = numbers.filter(|&n| lanes[n as usize] != 0).collect();
        let place = |n: usize| nodes.partition_point(|&i| (i as usize) < n);
        let levels = shape.levels.iter();
        Self {
            levels: levels.map(|l| place(l.start)..place(l.end)).collect(),
            nodes,
            lanes,
            still: None,
        }
    }

    fn fit(&self, tree: &mut Wide, geometry: &Geometry<'_>) -> Fitted {
        let levels = self.levels.iter();
        let listed = levels.map(|level| Which::Listed(&self.nodes[level.clone()]));
        tree.fit(listed, Some(&self.lanes), geometry)
    }
}

/// Computes, for each node, a bit for each lane above a moving triangle, deepest level first.
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

impl Wide {
    /// Sets all corners and boxes. After the first call for a tree, sets only the moving ones.
    pub(crate) fn fit_moving(&mut self, geometry: &Geometry<'_>) -> Fitted {
        let mut moving = self.moving.take();
        let still = moving.as_ref().and_then(|moving| moving.still);
        let fitted = match (&mut moving, still) {
            // `still` has no inactive triangles, because static triangles with a leaf are active.
            (Some(moving), Some(still)) => still + moving.fit(self, geometry),
            (moving, _) => {
                let shape = Arc::clone(&self.shape);
                let all = shape.levels.iter().cloned().map(Which::All);
                let fitted = self.fit(all, None, geometry);
                if let Some(moving) = moving {
                    let again = moving.fit(self, geometry);
                    let mut still = Fitted::default();
                    still.unhittable.degenerate =
                        fitted.unhittable.degenerate - again.unhittable.degenerate;
                    still.areas = fitted.areas - again.areas;
                    moving.still = Some(still);
                }
                fitted
            }
        };
        self.moving = moving;
        fitted
    }
}
