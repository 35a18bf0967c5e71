//! The eight-wide tree in memory.

use crate::simd::{InstructionSet, each, prefetch};
use backend::Intersector;
use bvh_layout::Ranges;
use cpu_ref::intersect::{TriangleData, Woop};
use geom::{Aabb, Triangle, is_active};
use rayon::prelude::*;

pub(crate) use bvh_layout::{LANES, Link};

/// Up to eight boxes with links to children, in four cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node8 {
    /// Lanes without a child have empty boxes.
    pub(crate) planes: BoxPlanes,
    /// Link of each lane to a node or block.
    pub(crate) links: [Link; LANES],
    /// The binary nodes that were collapsed into this node.
    pub(crate) ranges: Ranges,
}

/// For each axis: the lower planes of eight boxes, then the upper planes.
pub(crate) type BoxPlanes = [[f32; 2 * LANES]; 3];

/// Planes of eight empty boxes.
pub(crate) const EMPTY: BoxPlanes = {
    let (lo, hi) = (f32::INFINITY, f32::NEG_INFINITY);
    [[
        lo, lo, lo, lo, lo, lo, lo, lo, hi, hi, hi, hi, hi, hi, hi, hi,
    ]; 3]
};

/// Returns the box of one lane.
#[inline(always)]
pub(crate) fn bounds(planes: &BoxPlanes, lane: usize) -> Aabb {
    Aabb {
        min: each!(axis => planes[axis][lane]),
        max: each!(axis => planes[axis][lane + LANES]),
    }
}

/// Sets the box of one lane.
#[inline(always)]
pub(crate) fn set_bounds(planes: &mut BoxPlanes, lane: usize, bounds: &Aabb) {
    for (axis, planes) in planes.iter_mut().enumerate() {
        planes[lane] = bounds.min[axis];
        planes[lane + LANES] = bounds.max[axis];
    }
}

/// Corners of eight triangles, one triangle per lane: `[axis][corner][lane]`.
pub(crate) type CornerLanes = [[[f32; LANES]; 3]; 3];

/// Up to eight triangles in scaled units. Triangles that cannot be hit at this moment have NaN as corners.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct TriangleBlock {
    pub(crate) corners: CornerLanes,
    /// Index in the scene, or `u32::MAX` in lanes without a triangle.
    pub(crate) triangles: [u32; LANES],
}

/// Data of a block's triangles for Woop's test: `[row][column][lane]`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct BlockTriangleData(pub(crate) [[[f32; LANES]; 4]; 3]);

impl BlockTriangleData {
    /// Computes the data of a block's active triangles. The others are zero, which is never hit.
    fn of(block: &TriangleBlock) -> Self {
        let mut data = Self([[[0.0; LANES]; 4]; 3]);
        for lane in 0..LANES {
            let corners = block.triangle(lane);
            if is_active(&corners) {
                data.set(lane, &Woop::preprocess(&corners));
            }
        }
        data
    }

    fn set(&mut self, lane: usize, TriangleData(rows): &TriangleData) {
        for (to, row) in self.0.iter_mut().zip(rows) {
            for (to, &number) in to.iter_mut().zip(row) {
                to[lane] = number;
            }
        }
    }
}

/// Returns the *place* of a triangle: its position in the tree, as the block's index times [`LANES`] plus the lane.
#[inline(always)]
pub(crate) fn place(block: usize, lane: usize) -> u32 {
    (block * LANES + lane) as u32
}

/// The place of no triangle, for rays that miss.
pub(crate) const NOWHERE: u32 = u32::MAX;

impl Node8 {
    pub(crate) const UNUSED: Self = Self {
        planes: EMPTY,
        links: [Link::NONE; LANES],
        ranges: Ranges::NONE,
    };
}

impl TriangleBlock {
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

/// Returns the triangle in one lane.
#[inline(always)]
pub(crate) fn triangle(corners: &CornerLanes, lane: usize) -> Triangle {
    each!(c => each!(axis => corners[axis][c][lane]))
}

/// The boxes and triangles of a tree at one moment.
#[derive(Debug)]
pub(crate) struct Bvh8 {
    /// Nodes level by level, root first.
    pub(crate) nodes: Vec<Node8>,
    /// Blocks in the order of their nodes and lanes.
    pub(crate) blocks: Vec<TriangleBlock>,
    /// Triangle data of each block if the intersector is `woop`. Stale or empty for other intersectors, which read
    /// corners.
    pub(crate) triangle_data: Vec<BlockTriangleData>,
    /// The root box, in scaled units.
    pub(crate) root: Aabb,
    /// Set if inner boxes are padded by their own distance instead of the root box's (see [`cpu_ref::PAD`]), as of the
    /// last preprocess.
    pub(crate) own_padding: bool,
    /// The triangle test.
    pub(crate) intersector: Intersector,
    /// The instruction set to trace with.
    pub(crate) instruction_set: InstructionSet,
}

impl Bvh8 {
    /// Creates an empty tree for tracing with this instruction set.
    pub(crate) fn new(instruction_set: InstructionSet) -> Self {
        Self {
            nodes: vec![Node8::UNUSED],
            blocks: Vec::new(),
            triangle_data: Vec::new(),
            root: Aabb::EMPTY,
            own_padding: false,
            intersector: Intersector::Watertight,
            instruction_set,
        }
    }

    /// Sets the triangle test. Computes the triangle data of all blocks from their corners if the test needs any.
    pub(crate) fn prepare(&mut self, intersector: Intersector) {
        self.intersector = intersector;
        if intersector == Intersector::Woop {
            let blocks = self.blocks.par_iter().with_min_len(128);
            let data = blocks.map(BlockTriangleData::of);
            data.collect_into_vec(&mut self.triangle_data);
        }
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

    /// Prefetches a node or block.
    #[inline(always)]
    pub(crate) fn prefetch(&self, link: Link) {
        if link.is_block() {
            prefetch(&self.blocks, link.index());
        } else {
            prefetch(&self.nodes, link.index());
        }
    }
}
