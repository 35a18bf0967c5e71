//! Positions to corners and boxes: preprocess for blocks, refit for nodes.

use super::fold::{fold, lane_areas, set_bounds};
use super::tree::{Block, EMPTY, LANES, Link, Node, Planes, Wide};
use crate::preprocess::{Geometry, Unhittable};
use crate::scale::Scale;
use crate::simd::{Isa, Lanes, Level, Work, each};
use crate::triangle_test::{Record, TriangleTest};
use bvh_layout::{Block as Source, WideNode};
use geom::{Triangle, is_active, is_degenerate};
use rayon::prelude::*;

/// Nodes that one task handles, with their blocks.
const RUN: usize = 128;

impl Wide {
    /// Sets the corners of all blocks, and the boxes of nodes that stand for blocks. Returns the areas within blocks, too.
    pub(super) fn preprocess_whole(&mut self, geometry: Geometry<'_>) -> (Unhittable, f64) {
        let part = Part {
            nodes: &mut self.nodes,
            blocks: &mut self.blocks,
            shapes: &self.shape.nodes,
            sources: &self.shape.blocks,
            first_blocks: &self.shape.first_blocks,
            stale: std::mem::take(&mut self.stale),
        };
        part.preprocess(geometry, self.level)
    }

    /// Makes the record of each lane for tests that ask for one. Comes after [`Wide::preprocess`].
    pub(crate) fn make_records<T: TriangleTest>(&mut self) {
        self.records
            .resize(self.blocks.len() * LANES, Record::default());
        let records = self.records.par_chunks_mut(LANES).with_min_len(RUN);
        records.zip(&self.blocks).for_each(|(records, block)| {
            for (lane, record) in records.iter_mut().enumerate() {
                let corners = block.triangle(lane);
                *record = if is_active(&corners) {
                    T::record(&corners)
                } else {
                    Record::default()
                };
            }
        });
    }

    /// Sets the boxes of inner nodes, deepest first. Returns the half areas of boxes between those.
    pub(super) fn refit_whole(&mut self, sums: &mut Vec<f64>) -> f64 {
        let mut total = 0.0;
        for level in self.shape.levels.iter().rev() {
            let (upper, below) = self.nodes.split_at_mut(level.end);
            let (first, nodes) = (level.end, &mut upper[level.clone()]);
            sums.clear();
            sums.resize(nodes.len().div_ceil(RUN), 0.0);
            let runs = sums.par_iter_mut().zip(nodes.par_chunks_mut(RUN));
            runs.with_min_len(4).for_each(|(sum, nodes)| {
                *sum = self.level.run(RefitRun {
                    nodes,
                    below,
                    first,
                });
            });
            total += sums.iter().sum::<f64>();
        }
        total
    }

    /// Takes the tree's own box, after a refit that found `between`. Returns the areas of all boxes.
    pub(super) fn total_areas(&mut self, between: f64) -> f64 {
        let (root, areas) = fold(&self.nodes[0].planes, &self.nodes[0].ranges);
        self.root = root;
        self.block_areas + between + areas
    }
}

/// Neighbouring nodes and their blocks.
struct Part<'a> {
    nodes: &'a mut [Node],
    blocks: &'a mut [Block],
    shapes: &'a [WideNode],
    sources: &'a [Source],
    /// One more than nodes; as in the whole tree.
    first_blocks: &'a [u32],
    /// Whether nodes and blocks are still another tree's.
    stale: bool,
}

impl Part<'_> {
    /// Halves the nodes until there are few: a plain recursion, since blocks are cut where nodes are.
    fn preprocess(self, geometry: Geometry<'_>, level: Level) -> (Unhittable, f64) {
        let count = self.nodes.len();
        if count <= RUN {
            return level.run(PreprocessRun {
                part: self,
                geometry,
            });
        }
        let half = (count / 2).next_multiple_of(RUN);
        let cut = (self.first_blocks[half] - self.first_blocks[0]) as usize;
        let (left_nodes, right_nodes) = self.nodes.split_at_mut(half);
        let (left_blocks, right_blocks) = self.blocks.split_at_mut(cut);
        let (left_sources, right_sources) = self.sources.split_at(cut);
        let (left_shapes, right_shapes) = self.shapes.split_at(half);
        let left = Part {
            nodes: left_nodes,
            blocks: left_blocks,
            shapes: left_shapes,
            sources: left_sources,
            first_blocks: &self.first_blocks[..=half],
            stale: self.stale,
        };
        let right = Part {
            nodes: right_nodes,
            blocks: right_blocks,
            shapes: right_shapes,
            sources: right_sources,
            first_blocks: &self.first_blocks[half..],
            stale: self.stale,
        };
        let (mut sum, right) = rayon::join(
            || left.preprocess(geometry, level),
            || right.preprocess(geometry, level),
        );
        sum.0 += right.0;
        (sum.0, sum.1 + right.1)
    }
}

struct PreprocessRun<'a> {
    part: Part<'a>,
    geometry: Geometry<'a>,
}

impl Work for PreprocessRun<'_> {
    type Out = (Unhittable, f64);

    #[inline(always)]
    fn run<I: Isa>(self) -> (Unhittable, f64) {
        let part = self.part;
        let base = part.first_blocks[0] as usize;
        let (mut unhittable, mut areas) = (Unhittable::default(), 0.0);
        for (node, shape) in part.nodes.iter_mut().zip(part.shapes) {
            if part.stale {
                *node = Node {
                    planes: EMPTY,
                    links: shape.links,
                    ranges: shape.ranges,
                };
            }
            for lane in 0..LANES {
                let link = node.links[lane];
                if !link.is_block() {
                    continue;
                }
                let at = link.index() - base;
                let (block, source) = (&mut part.blocks[at], &part.sources[at]);
                if part.stale {
                    block.triangles = source.triangles;
                }
                let to = (&mut *node, lane, block);
                areas += fit_block::<I>(&self.geometry, source, to, &mut unhittable);
            }
        }
        (unhittable, areas)
    }
}

/// Sets a block's corners and its box in its node's lane. Returns the areas within.
#[inline(always)]
pub(super) fn fit_block<I: Isa>(
    geometry: &Geometry<'_>,
    source: &Source,
    (node, lane, block): (&mut Node, usize, &mut Block),
    unhittable: &mut Unhittable,
) -> f64 {
    let planes = fill::<I>(geometry, source, block, unhittable);
    let (whole, between) = fold(&planes, &source.ranges);
    set_bounds(&mut node.planes, lane, &whole);
    between + lane_areas(&planes)
}

/// Sets an inner child's box in its node's lane. Returns the areas between its own children.
#[inline(always)]
pub(super) fn fit_child(node: &mut Node, lane: usize, child: &Node) -> f64 {
    let (whole, between) = fold(&child.planes, &child.ranges);
    set_bounds(&mut node.planes, lane, &whole);
    between
}

/// Sets a block's corners and returns its triangles' boxes.
#[inline(always)]
fn fill<I: Isa>(
    geometry: &Geometry<'_>,
    source: &Source,
    block: &mut Block,
    unhittable: &mut Unhittable,
) -> Planes {
    let mut corners = [[[0.0; LANES]; 3]; 3];
    for (corner, vertices) in source.vertices.iter().enumerate() {
        for (lane, &vertex) in vertices.iter().enumerate() {
            let p = geometry.positions[vertex as usize];
            corners[0][corner][lane] = p[0];
            corners[1][corner][lane] = p[1];
            corners[2][corner][lane] = p[2];
        }
    }
    let hittable = hittable::<I::Eight>(&corners, u32::from(source.count), unhittable);
    let mut planes = EMPTY;
    for axis in 0..3 {
        let [a, b, c] = each!(i => scaled::<I::Eight>(geometry.scale, &corners[axis][i]));
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let mask = I::Eight::mask(hittable);
        let (none, on) = (
            I::Eight::splat(f32::INFINITY),
            I::Eight::splat(f32::NEG_INFINITY),
        );
        planes[axis][..LANES].copy_from_slice(&none.replace(mask, low).store());
        planes[axis][LANES..].copy_from_slice(&on.replace(mask, high).store());
        let unhittable = I::Eight::splat(f32::NAN);
        block.corners[axis] = each!(i => unhittable.replace(mask, [a, b, c][i]).store());
    }
    planes
}

/// [`Scale::apply`], lane by lane.
#[inline(always)]
fn scaled<L: Lanes<Array = [f32; LANES]>>(scale: Scale, x: &[f32; LANES]) -> L {
    let x = L::load(x).mul(L::splat(scale.factor()));
    let small = x.abs().less(L::splat(Scale::LEAST));
    x.replace(small, L::splat(0.0))
}

/// Which lanes hold a triangle that can be hit; the others are counted.
#[inline(always)]
fn hittable<L: Lanes<Array = [f32; LANES]>>(
    corners: &[[[f32; LANES]; 3]; 3],
    count: u32,
    unhittable: &mut Unhittable,
) -> u32 {
    let most = L::splat(f32::MAX);
    let mut finite = L::mask((1 << count) - 1);
    let mut edges = [[L::splat(0.0); 2]; 3];
    for axis in 0..3 {
        let [a, b, c] = &corners[axis];
        let [a, b, c] = [L::load(a), L::load(b), L::load(c)];
        for x in [a, b, c] {
            finite = L::both(finite, x.abs().at_most(most));
        }
        edges[axis] = [b.sub(a), c.sub(a)];
    }
    let clear = L::bits(L::either(
        stands_clear(&edges, 0, 1),
        L::either(stands_clear(&edges, 1, 2), stands_clear(&edges, 2, 0)),
    ));
    let finite = L::bits(finite);
    unhittable.inactive += u64::from(count - finite.count_ones());
    let mut doubtful = finite & !clear;
    let mut hittable = finite & clear;
    while doubtful != 0 {
        let lane = doubtful.trailing_zeros();
        doubtful &= doubtful - 1;
        if is_degenerate(&triangle(corners, lane as usize)) {
            unhittable.degenerate += 1;
        } else {
            hittable |= 1 << lane;
        }
    }
    hittable
}

/// Whether a component of the cross product is surely not zero: each product carries three roundings and
/// the difference one more. What is small may have lost digits, and what is large is infinite: not sure.
#[inline(always)]
fn stands_clear<L: Lanes>(edges: &[[L; 2]; 3], i: usize, j: usize) -> L::Mask {
    let (p, q) = (edges[i][0].mul(edges[j][1]), edges[j][0].mul(edges[i][1]));
    let size = p.abs().add(q.abs());
    let doubt = size.mul(L::splat(8.0 * f32::EPSILON));
    doubt.add(L::splat(1e-30)).less(p.sub(q).abs())
}

#[inline(always)]
fn triangle(corners: &[[[f32; LANES]; 3]; 3], lane: usize) -> Triangle {
    let corner = |c: usize| {
        [
            corners[0][c][lane],
            corners[1][c][lane],
            corners[2][c][lane],
        ]
    };
    [corner(0), corner(1), corner(2)]
}

impl Block {
    /// The corners in one lane, in scaled units.
    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> Triangle {
        triangle(&self.corners, lane)
    }
}

/// Neighbouring nodes of one level; `below` begins with node `first`.
struct RefitRun<'a> {
    nodes: &'a mut [Node],
    below: &'a [Node],
    first: usize,
}

impl Work for RefitRun<'_> {
    type Out = f64;

    #[inline(always)]
    fn run<I: Isa>(self) -> f64 {
        let mut sum = 0.0;
        for node in self.nodes {
            for lane in 0..LANES {
                let link = node.links[lane];
                if link.is_block() || link == Link::ROOT {
                    continue;
                }
                sum += fit_child(node, lane, &self.below[link.index() - self.first]);
            }
        }
        sum
    }
}
