//! The wide tree in memory.

use crate::boxes::{EightBoxes, Sums};
use crate::fit::triangle;
use crate::moving::Moving;
use crate::simd::{Level, Plain};
use crate::trace::WideTracer;
use backend::{BackendError, Intersector, Result, TreeFormat};
use bvh_layout::{BlockTree, First, Ranges, Topology};
use cpu_ref::bvh2::Bvh2;
use cpu_ref::intersect::{Exact, MollerTrumbore, Record, TriangleTest, Watertight, Woop};
use cpu_ref::tiles::{Counts, Output};
use cpu_ref::trace::{TraceTask, Tracer};
use cpu_ref::{Accelerator, Geometry, Unhittable, reserve};
use geom::{Aabb, Animation, Triangle, is_active};
use rayon::prelude::*;
use std::sync::Arc;

pub(crate) use bvh_layout::{LANES, Link};

/// Up to eight boxes with links to children, in four cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// For each axis: lower planes of all lanes, then upper planes. Lanes without a child have empty boxes.
    pub(crate) planes: Planes,
    /// Link of each lane to a node or block.
    pub(crate) links: [Link; LANES],
    /// The binary nodes that were collapsed into this node.
    pub(crate) ranges: Ranges,
}

/// For each axis: eight lower planes, then eight upper planes.
pub(crate) type Planes = [[f32; 2 * LANES]; 3];

/// Planes of eight empty boxes.
pub(crate) const EMPTY: Planes = {
    let (no, on) = (f32::INFINITY, f32::NEG_INFINITY);
    [[
        no, no, no, no, no, no, no, no, on, on, on, on, on, on, on, on,
    ]; 3]
};

/// Up to eight triangles in scaled units. Triangles that cannot be hit at this moment have NaN as corners.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Block {
    /// The coordinate in all lanes, for each axis and each corner.
    pub(crate) corners: [[[f32; LANES]; 3]; 3],
    /// Index in the scene, or `u32::MAX` in lanes without a triangle.
    pub(crate) triangles: [u32; LANES],
}

/// Records of a block's triangles: for each row, for each column, the number in all lanes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Records(pub(crate) [[[f32; LANES]; 4]; 3]);

impl Records {
    /// Computes the records of a block's active triangles. The others are zero, which is never met.
    fn of(block: &Block) -> Self {
        let mut records = Self([[[0.0; LANES]; 4]; 3]);
        for lane in 0..LANES {
            let corners = block.triangle(lane);
            if is_active(&corners) {
                records.set(lane, &Woop::record(&corners));
            }
        }
        records
    }

    fn set(&mut self, lane: usize, Record(rows): &Record) {
        for (to, row) in self.0.iter_mut().zip(rows) {
            for (to, &number) in to.iter_mut().zip(row) {
                to[lane] = number;
            }
        }
    }
}

/// Returns the place of the triangle in a lane of a block.
#[inline(always)]
pub(crate) fn place(block: usize, lane: usize) -> u32 {
    (block * LANES + lane) as u32
}

/// A place without a triangle.
pub(crate) const NOWHERE: u32 = u32::MAX;

/// Limit on the number of blocks, so that places fit in 32 bits. More blocks would take 170 GB.
const MOST_BLOCKS: usize = NOWHERE as usize / LANES;

impl Node {
    pub(crate) const UNUSED: Self = Self {
        planes: EMPTY,
        links: [Link::ROOT; LANES],
        ranges: Ranges::NONE,
    };
}

impl Block {
    pub(crate) const UNUSED: Self = Self {
        corners: [[[f32::NAN; LANES]; 3]; 3],
        triangles: [u32::MAX; LANES],
    };

    /// Returns the corners in one lane, in scaled units.
    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> Triangle {
        triangle(&self.corners, lane)
    }
}

/// A tree with the boxes and triangles of one moment.
#[derive(Debug)]
pub(crate) struct Wide {
    /// Triangles and links of the tree.
    pub(crate) shape: Arc<BlockTree>,
    /// The nodes of `shape` with boxes, valid from the first preprocess on.
    pub(crate) nodes: Vec<Node>,
    /// The blocks of `shape` with corners, valid from the first preprocess on.
    pub(crate) blocks: Vec<Block>,
    /// Set if nodes and blocks still have the contents of another tree.
    pub(crate) stale: bool,
    /// Records of each block if the test is Woop's. Else empty, because other tests read corners.
    pub(crate) records: Vec<Records>,
    /// The root box, in scaled units.
    pub(crate) root: Aabb,
    /// [`geom::Range::spread`] as of the last preprocess: set if coordinates differ much in size.
    pub(crate) spread: bool,
    /// Half areas of all boxes of the binary tree except those collapsed into the root node, as of the last preprocess.
    pub(crate) areas: f64,
    /// The instruction set to trace with.
    pub(crate) level: Level,
    /// The binary tree, for computing its boxes.
    pub(crate) binary: Topology,
    /// The moving parts, if the binary tree has lists of moving nodes.
    pub(crate) moving: Option<Moving>,
}

impl Wide {
    /// Creates an empty tree, to be traced with `level`.
    pub(crate) fn new(level: Level) -> Self {
        Self {
            nodes: vec![Node::UNUSED],
            blocks: Vec::new(),
            shape: Arc::default(),
            stale: true,
            records: Vec::new(),
            root: Aabb::EMPTY,
            spread: false,
            areas: 0.0,
            level,
            binary: Topology::default(),
            moving: None,
        }
    }

    /// Computes the records of all blocks from their corners.
    fn make_records(&mut self) {
        let blocks = self.blocks.par_iter().with_min_len(128);
        let records = blocks.map(Records::of);
        records.collect_into_vec(&mut self.records);
    }

    /// Returns the triangle in a place.
    #[inline(always)]
    pub(crate) fn triangle_at(&self, place: u32) -> u32 {
        self.blocks[place as usize / LANES].triangles[place as usize % LANES]
    }

    /// Returns the corners of the triangle in a place, in scaled units.
    #[inline(always)]
    pub(crate) fn corners_at(&self, place: u32) -> Triangle {
        self.blocks[place as usize / LANES].triangle(place as usize % LANES)
    }
}

impl Accelerator for Wide {
    /// Costs little if the topology includes its [`BlockTree`].
    fn adopt(&mut self, tree: &Topology, animation: &Animation) -> Result<()> {
        let shape = match tree.blocks() {
            Some(shape) => Arc::clone(shape),
            None => Arc::new(BlockTree::of(
                tree,
                animation.triangles(),
                (&[], First::Left),
            )),
        };
        if shape.blocks.len() > MOST_BLOCKS {
            return Err(BackendError::OutOfMemory {
                what: "blocks of triangles".to_owned(),
                bytes: size_of_val(&shape.blocks[..]) as u64,
            });
        }
        let nodes = larger(&self.nodes, shape.nodes.len(), "nodes")?;
        let blocks = larger(&self.blocks, shape.blocks.len(), "blocks of triangles")?;
        let outgrown = (
            fill(&mut self.nodes, nodes, shape.nodes.len(), Node::UNUSED),
            fill(&mut self.blocks, blocks, shape.blocks.len(), Block::UNUSED),
        );
        self.stale = true;
        let is_static = &animation.static_parts().triangles;
        self.moving = tree.moving().map(|_| Moving::of(&shape, is_static));
        self.binary.copy_record(tree);
        let old = std::mem::replace(&mut self.shape, shape);
        // Freeing much memory takes a while.
        rayon::spawn(move || drop((old, outgrown)));
        Ok(())
    }

    fn format(&self) -> TreeFormat {
        TreeFormat::WideBlocks
    }

    fn preprocess(&mut self, geometry: &Geometry<'_>, intersector: Intersector) -> Unhittable {
        let fitted = self.fit_moving(geometry);
        self.spread = geometry.range.spread;
        self.areas = fitted.areas;
        match intersector {
            Intersector::Woop => self.make_records(),
            Intersector::MollerTrumbore | Intersector::Watertight | Intersector::Exact => {}
        }
        fitted.unhittable
    }

    fn refit(&mut self) -> (f64, Aabb) {
        let (node, mut sums) = (&self.nodes[0], Sums::default());
        let (root, areas) = EightBoxes::<Plain<_>>::load(&node.planes).fold(&node.ranges);
        sums.add(areas);
        self.root = root;
        (self.areas + sums.total(), root)
    }

    fn trace(&self, task: TraceTask<'_>, out: Output<'_>) -> Counts {
        let tracer = Tracer::new(task, self);
        match task.intersector {
            _ if task.is_extreme() => tracer.trace(out),
            Intersector::MollerTrumbore => WideTracer::<MollerTrumbore>::new(tracer).trace(out),
            Intersector::Woop => WideTracer::<Woop>::new(tracer).trace(out),
            Intersector::Watertight => WideTracer::<Watertight>::new(tracer).trace(out),
            Intersector::Exact => WideTracer::<Exact>::new(tracer).trace(out),
        }
    }

    fn boxes(&self, geometry: &Geometry<'_>) -> Result<Vec<Aabb>> {
        Bvh2::boxes_of(&self.binary, geometry)
    }
}

/// Allocates memory if the capacity of `old` is below `count`. Adds a quarter, because the next tree may be larger.
fn larger<T>(old: &Vec<T>, count: usize, what: &str) -> Result<Option<Vec<T>>> {
    if old.capacity() >= count {
        return Ok(None);
    }
    let mut new = Vec::new();
    reserve(&mut new, count + count / 4, what)?;
    Ok(Some(new))
}

/// Resizes `memory` to `count`. Moves to `larger` if that is `Some`, and returns the memory that was replaced.
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
