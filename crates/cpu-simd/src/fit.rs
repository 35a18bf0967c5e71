//! Preprocess and refit: computes corners and boxes from positions, block by block and node by node.

use crate::boxes::{EightBoxes, FoldedBoxes, Sums};
use crate::simd::{Eight, Isa, Lanes, PlaneVector, SetLanes, VectorWork, each, prefetch};
use crate::subtrees::{LevelPart, Subtrees};
use crate::tree::{Bvh8, EMPTY, LANES, Link, Node8, TriangleBlock, set_bounds, triangle};
use crate::units::scaled;
use crate::window::Window;
use bvh_layout::BlockTree;
use cpu_ref::{Geometry, Unhittable};
use geom::is_degenerate;
use std::ops::Add;

/// Number of blocks by which vertices are prefetched ahead, because vertices are scattered in memory.
const AHEAD: usize = 4;

/// Results of fitting.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Fitted {
    pub(crate) unhittable: Unhittable,
    /// Sum of half areas over the children in fitted lanes. A block adds the boxes of its triangles and of its binary
    /// nodes. A wide node adds the boxes of the binary nodes collapsed into it.
    pub(crate) areas: f64,
}

impl Add for Fitted {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            unhittable: self.unhittable + other.unhittable,
            areas: self.areas + other.areas,
        }
    }
}

/// A tree, and the positions that its corners and boxes are computed from.
pub(crate) struct FitTask<'a> {
    pub(crate) tree: &'a mut Bvh8,
    pub(crate) shape: &'a BlockTree,
    /// Set if nodes and blocks still have the contents of another tree. The next fit must then select all nodes.
    pub(crate) stale: bool,
    pub(crate) geometry: &'a Geometry<'a>,
    /// The numbers of all nodes.
    pub(crate) all_nodes: &'a [u32],
}

impl FitTask<'_> {
    /// Sets the corners of blocks and the boxes of nodes in the given lanes of every node: see [`Self::fit`].
    pub(crate) fn fit_all(&mut self, lanes: Option<&[u8]>) -> Fitted {
        let (levels, all) = (self.shape.levels.iter(), self.all_nodes);
        self.fit(levels.map(|level| &all[level.clone()]), lanes)
    }

    /// Sets the corners of blocks and the boxes of nodes, bottom-up.
    ///
    /// `selected` contains the nodes to fit, level by level, root first. For each node of the tree, `lanes` contains a
    /// bit mask of the lanes to fit. `None` fits all lanes.
    pub(crate) fn fit<'s>(
        &'s mut self,
        selected: impl Iterator<Item = &'s [u32]>,
        lanes: Option<&[u8]>,
    ) -> Fitted {
        let (shape, instruction_set) = (self.shape, self.tree.instruction_set);
        let (nodes, blocks) = (&mut self.tree.nodes, &mut self.tree.blocks);
        let (geometry, stale) = (self.geometry, std::mem::take(&mut self.stale));
        Subtrees::of(shape, selected, nodes, blocks).fold(shape, &|level, below| {
            instruction_set.run(FitLevel {
                level,
                below: below.map(|below| &below.nodes),
                shape,
                geometry,
                stale,
                lanes,
            })
        })
    }
}

struct FitLevel<'a, 'b> {
    level: &'a mut LevelPart<'b>,
    /// The level below, which is fitted already.
    below: Option<&'a Window<'a, Node8>>,
    shape: &'a BlockTree,
    geometry: &'a Geometry<'a>,
    stale: bool,
    lanes: Option<&'a [u8]>,
}

impl VectorWork for FitLevel<'_, '_> {
    type Out = Fitted;

    #[inline(always)]
    fn run<I: Isa>(self) -> Fitted {
        let (level, shape, geometry) = (self.level, self.shape, self.geometry);
        let (mut fitted, mut sums) = (Fitted::default(), Sums::default());
        for &n in level.selected {
            let n = n as usize;
            let lanes = self.lanes.map_or(u8::MAX, |lanes| lanes[n]);
            let node = &mut level.nodes[n];
            if self.stale {
                let source = &shape.nodes[n];
                *node = Node8 {
                    planes: EMPTY,
                    links: source.links,
                    ranges: source.ranges,
                };
                for block in source.links.iter().filter(|link| link.is_block()) {
                    let block = block.index();
                    level.blocks[block].triangles = shape.blocks[block].triangles;
                }
            }
            for lane in SetLanes::<LANES>(u32::from(lanes)) {
                let link = node.links[lane];
                if link == Link::NONE {
                    continue;
                }
                let folded = if link.is_block() {
                    let number = link.index();
                    let block = &mut level.blocks[number];
                    fit_block::<I>(geometry, shape, number, block, &mut fitted.unhittable)
                } else if let Some(below) = self.below {
                    let child = &below[link.index()];
                    EightBoxes::load(&child.planes).fold(&child.ranges)
                } else {
                    continue;
                };
                set_bounds(&mut node.planes, lane, &folded.whole);
                sums.add(folded.half_areas);
            }
        }
        fitted.areas = sums.total();
        fitted
    }
}

/// Sets a block's corners. Returns the block's box and one sum per lane: the half area of the box of a triangle, plus
/// that of the box of a binary node that the block replaces (see `Ranges`). Unused lanes add 0.
#[inline(always)]
fn fit_block<I: Isa>(
    geometry: &Geometry<'_>,
    shape: &BlockTree,
    number: usize,
    block: &mut TriangleBlock,
    unhittable: &mut Unhittable,
) -> FoldedBoxes<I::Eight> {
    let source = &shape.blocks[number];
    let later = shape.blocks.get(number + AHEAD).unwrap_or(source);
    // Prefetches only first vertices. The other vertices of a triangle are mostly near the first in memory.
    for vertex in later.vertices[0] {
        prefetch(geometry.positions, vertex as usize);
    }
    let corners = each!(corner => {
        let vertices = &source.vertices[corner];
        let mut points = [&geometry.positions[0]; LANES];
        for (point, &vertex) in points.iter_mut().zip(vertices) {
            *point = &geometry.positions[vertex as usize];
        }
        I::Eight::coordinates(points)
    });
    let hittable = hittable(&corners, u32::from(source.count), unhittable);
    let mask = I::Eight::mask(hittable);
    let nan = I::Eight::splat(f32::NAN);
    let empty_low = I::Eight::splat(f32::INFINITY);
    let empty_high = I::Eight::splat(f32::NEG_INFINITY);
    let mut boxes = EightBoxes {
        low: [empty_low; 3],
        high: [empty_high; 3],
    };
    for (axis, to) in block.corners.iter_mut().enumerate() {
        let [a, b, c] = each!(i => scaled(geometry.scale, corners[i][axis]));
        boxes.low[axis] = empty_low.replace(mask, a.min(b).min(c));
        boxes.high[axis] = empty_high.replace(mask, a.max(b).max(c));
        *to = each!(i => nan.replace(mask, [a, b, c][i]).store());
    }
    let folded = boxes.fold(&source.ranges);
    FoldedBoxes {
        half_areas: folded.half_areas.add(boxes.half_areas()),
        ..folded
    }
}

/// Returns the lanes whose triangle can be hit, and counts the others.
#[inline(always)]
fn hittable<L: Eight>(corners: &[[L; 3]; 3], count: u32, unhittable: &mut Unhittable) -> u32 {
    let most = L::splat(f32::MAX);
    let mut finite = L::mask((1 << count) - 1);
    for x in corners.as_flattened() {
        finite = L::both(finite, x.abs().at_most(most));
    }
    let [a, b, c] = corners;
    let edges = each!(axis => [b[axis].sub(a[axis]), c[axis].sub(a[axis])]);
    let certain = L::bits(L::either(
        is_certainly_nonzero(&edges, 0, 1),
        L::either(
            is_certainly_nonzero(&edges, 1, 2),
            is_certainly_nonzero(&edges, 2, 0),
        ),
    ));
    let finite = L::bits(finite);
    unhittable.inactive += u64::from(count - finite.count_ones());
    let doubtful = finite & !certain;
    let mut hittable = finite & certain;
    if doubtful == 0 {
        return hittable;
    }
    let corners = each!(axis => each!(i => corners[i][axis].store()));
    for lane in SetLanes::<LANES>(doubtful) {
        if is_degenerate(&triangle(&corners, lane)) {
            unhittable.degenerate += 1;
        } else {
            hittable |= 1 << lane;
        }
    }
    hittable
}

/// Returns the lanes where a component of the cross product is certainly nonzero.
///
/// Each product has three roundings, and the difference of products adds one. Small values may be subnormal and large
/// values infinite, so these count as uncertain.
#[inline(always)]
fn is_certainly_nonzero<L: Lanes>(edges: &[[L; 2]; 3], i: usize, j: usize) -> L::Mask {
    let (p, q) = (edges[i][0].mul(edges[j][1]), edges[j][0].mul(edges[i][1]));
    let size = p.abs().add(q.abs());
    let doubt = size.mul(L::splat(8.0 * f32::EPSILON));
    doubt.add(L::splat(1e-30)).less(p.sub(q).abs())
}
