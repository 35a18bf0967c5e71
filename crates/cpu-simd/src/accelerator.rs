//! The wide tree as an accelerator of the host backend.

use crate::boxes::{EightBoxes, FoldedBoxes, Sums};
use crate::fit::FitTask;
use crate::moving::MovingLanes;
use crate::simd::{InstructionSet, Plain};
use crate::trace::trace;
use crate::tree::{Bvh8, LANES, NOWHERE, Node8, TriangleBlock};
use backend::{BackendError, Intersector, Result};
use bvh_build::BinaryTree;
use bvh_layout::{BlockTree, CollapseOptions, Topology};
use cpu_ref::{
    Accelerator, Bvh2, Geometry, HitCounts, QueryTracer, TraceOutput, TreeTraversal, Unhittable,
    reserve,
};
use geom::{Aabb, Animation, StaticParts};
use rayon::prelude::*;
use std::sync::Arc;

/// Limit on the number of blocks, so that the place of every triangle fits in 32 bits (see [`crate::tree::place`]).
/// More blocks would need 170 GB.
const MOST_BLOCKS: usize = NOWHERE as usize / LANES;

/// A tree in its eight-wide form, with the boxes and triangles of one moment.
pub(crate) struct WideAccelerator {
    /// Boxes and triangles of `shape`, valid from the first preprocess on.
    tree: Bvh8,
    /// Triangles and links of the tree.
    shape: Arc<BlockTree>,
    /// Set if `tree` does not yet have the contents of `shape`.
    stale: bool,
    /// The numbers of all nodes.
    all_nodes: Vec<u32>,
    /// The moving parts. `None` if so few parts are static that skipping them does not pay.
    moving: Option<MovingLanes>,
    /// Sum of the half areas of the binary tree's boxes, as of the last preprocess. Excludes the binary nodes that were
    /// collapsed into the root of the wide tree.
    areas: f64,
    /// The binary tree, for computing its boxes.
    binary: Arc<BinaryTree>,
}

impl WideAccelerator {
    /// Creates an empty tree for tracing with this instruction set.
    pub(crate) fn new(instruction_set: InstructionSet) -> Self {
        Self {
            tree: Bvh8::new(instruction_set),
            shape: Arc::default(),
            stale: true,
            all_nodes: Vec::new(),
            moving: None,
            areas: 0.0,
            binary: Arc::default(),
        }
    }
}

impl Accelerator for WideAccelerator {
    fn tree(&self) -> &dyn TreeTraversal {
        &self.tree
    }

    /// Fast if the topology includes its [`BlockTree`]. Otherwise computes it.
    fn adopt(&mut self, tree: &Topology, animation: &Animation) -> Result<()> {
        let shape = match tree.blocks() {
            Some(shape) => Arc::clone(shape),
            None => {
                let options = CollapseOptions::default();
                Arc::new(BlockTree::of(tree.binary(), animation.triangles(), options))
            }
        };
        if shape.blocks.len() > MOST_BLOCKS {
            return Err(BackendError::OutOfMemory {
                what: "blocks of triangles".to_owned(),
                bytes: size_of_val(&shape.blocks[..]) as u64,
            });
        }
        let (own, count) = (&mut self.tree, shape.nodes.len());
        let nodes = larger(&own.nodes, count, "nodes")?;
        let blocks = larger(&own.blocks, shape.blocks.len(), "blocks of triangles")?;
        let outgrown = (
            fill(&mut own.nodes, nodes, count, Node8::UNUSED),
            fill(
                &mut own.blocks,
                blocks,
                shape.blocks.len(),
                TriangleBlock::UNUSED,
            ),
        );
        self.stale = true;
        self.all_nodes.clear();
        self.all_nodes.extend(0..count as u32);
        let is_static = &animation.static_parts().triangles;
        let pays = StaticParts::pays(animation.moving_count(), animation.live_count());
        self.moving = pays.then(|| MovingLanes::of(&shape, is_static)).flatten();
        let old_binary = std::mem::replace(&mut self.binary, Arc::clone(tree.binary()));
        let old_shape = std::mem::replace(&mut self.shape, shape);
        // Freeing large buffers is slow, so another thread does it.
        rayon::spawn(move || drop((old_binary, old_shape, outgrown)));
        Ok(())
    }

    fn preprocess(&mut self, geometry: &Geometry<'_>, intersector: Intersector) -> Unhittable {
        let mut task = FitTask {
            tree: &mut self.tree,
            shape: &self.shape,
            stale: std::mem::take(&mut self.stale),
            geometry,
            all_nodes: &self.all_nodes,
        };
        let fitted = match &mut self.moving {
            Some(moving) => moving.fit(&mut task),
            None => task.fit_all(None),
        };
        self.areas = fitted.areas;
        // At extreme moments, the faster test of inner boxes may overflow: see the comment on `starts` in
        // `PreparedRays::prepared`.
        self.tree.own_padding = geometry.range.spread || geometry.range.extreme;
        self.tree.prepare(intersector);
        fitted.unhittable
    }

    fn refit(&mut self) -> f64 {
        let (node, mut sums) = (&self.tree.nodes[0], Sums::default());
        let boxes = EightBoxes::<Plain<_>>::load(&node.planes);
        let FoldedBoxes { whole, half_areas } = boxes.fold(&node.ranges);
        sums.add(half_areas);
        self.tree.root = whole;
        self.areas + sums.total()
    }

    fn trace(&self, tracer: &QueryTracer<'_>, out: TraceOutput<'_>) -> HitCounts {
        trace(tracer, &self.tree, out)
    }

    fn boxes(&self, geometry: &Geometry<'_>) -> Result<Vec<Aabb>> {
        Bvh2::boxes_of(&self.binary, geometry)
    }
}

/// Allocates a new vector if the capacity of `old` is below `count`. The new capacity exceeds `count` by a quarter,
/// because the next tree may be larger.
fn larger<T>(old: &Vec<T>, count: usize, what: &str) -> Result<Option<Vec<T>>> {
    if old.capacity() >= count {
        return Ok(None);
    }
    let mut new = Vec::new();
    reserve(&mut new, count + count / 4, what)?;
    Ok(Some(new))
}

/// Resizes `memory` to `count` entries. If `larger` is `Some`, replaces `memory` by it and returns the old vector.
fn fill<T: Copy + Send + Sync>(
    memory: &mut Vec<T>,
    larger: Option<Vec<T>>,
    count: usize,
    with: T,
) -> Option<Vec<T>> {
    let Some(mut larger) = larger else {
        memory.resize(count, with);
        return None;
    };
    rayon::iter::repeat_n(with, count).collect_into_vec(&mut larger);
    Some(std::mem::replace(memory, larger))
}
