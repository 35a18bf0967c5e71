//! Preprocess and refit: positions to corners and boxes, block by block and node by node.

use crate::boxes::{EightBoxes, Sums, set_bounds};
use crate::leaf::scaled;
use crate::simd::{Eight, Isa, Lanes, Work, each, prefetch};
use crate::tree::{Block, EMPTY, LANES, Link, Node, Wide};
use bvh_layout::{Block as Source, BlockTree};
use cpu_ref::geometry::{Geometry, Unhittable};
use cpu_ref::pass::{SplitAt, Which, Window, pass};
use geom::{Aabb, Point, Triangle, is_degenerate};
use std::ops::Add;

/// Nodes that one task handles.
const RUN: usize = 32;
/// Blocks from one to that whose vertices are fetched meanwhile: they lie scattered.
const AHEAD: usize = 4;

/// Nodes to go over, and for each node of the tree a bit for each lane that counts; all do where there are no bits.
pub(crate) type Chosen<'a> = (Which<'a>, Option<&'a [u8]>);

#[inline(always)]
fn lanes_of(bits: Option<&[u8]>, node: usize) -> u8 {
    match bits {
        Some(bits) => bits[node],
        None => u8::MAX,
    }
}

/// What fitting blocks came to.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Fitted {
    pub(crate) unhittable: Unhittable,
    /// Half areas of the boxes within blocks.
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

impl Wide {
    /// Sets corners of blocks, and their boxes in nodes.
    pub(crate) fn fit_blocks(
        &mut self,
        (which, chosen): Chosen<'_>,
        geometry: &Geometry<'_>,
    ) -> Fitted {
        let (stale, level, shape) = (std::mem::take(&mut self.stale), self.level, &*self.shape);
        let part = Blocks {
            shape,
            nodes: Window::new(0, &mut self.nodes),
            blocks: Window::new(0, &mut self.blocks),
        };
        pass(which, part, RUN, &|which, part| {
            level.run(FitBlocks {
                geometry,
                stale,
                chosen,
                which,
                part,
            })
        })
    }

    /// Sets the boxes of inner nodes, deepest first; `which` says of each level, root first, where. Returns the half areas
    /// of boxes between those.
    pub(crate) fn fit_nodes<'a>(
        &mut self,
        which: impl DoubleEndedIterator<Item = Which<'a>> + ExactSizeIterator,
        chosen: Option<&[u8]>,
    ) -> f64 {
        let (mut total, level) = (0.0, self.level);
        for (which, nodes) in which.zip(&self.shape.levels).rev() {
            let (upper, below) = self.nodes.split_at_mut(nodes.end);
            total += pass(which, Window::new(0, upper), RUN, &|which, part| {
                level.run(FitNodes {
                    which,
                    chosen,
                    nodes: part,
                    below: (below, nodes.end),
                })
            });
        }
        total
    }
}

/// Nodes, with the blocks below them.
struct Blocks<'a> {
    shape: &'a BlockTree,
    nodes: Window<'a, Node>,
    blocks: Window<'a, Block>,
}

impl SplitAt for Blocks<'_> {
    fn split(self, node: usize) -> [Self; 2] {
        let (shape, block) = (self.shape, self.shape.first_blocks[node] as usize);
        let (nodes, blocks) = (self.nodes.split(node), self.blocks.split(block));
        let ([nodes, more_nodes], [blocks, more_blocks]) = (nodes, blocks);
        let half = |nodes, blocks| Blocks {
            shape,
            nodes,
            blocks,
        };
        [half(nodes, blocks), half(more_nodes, more_blocks)]
    }
}

struct FitBlocks<'a> {
    geometry: &'a Geometry<'a>,
    /// Whether nodes and blocks are still another tree's. They are all gone over then.
    stale: bool,
    chosen: Option<&'a [u8]>,
    which: Which<'a>,
    part: Blocks<'a>,
}

impl Work for FitBlocks<'_> {
    type Out = Fitted;

    #[inline(always)]
    fn run<I: Isa>(self) -> Fitted {
        let (mut part, mut fitted) = (self.part, Fitted::default());
        let mut sums = Sums::default();
        for place in 0..self.which.count() {
            let n = self.which.at(place);
            let (node, lanes) = (&mut part.nodes[n], lanes_of(self.chosen, n));
            if self.stale {
                let shape = &part.shape.nodes[n];
                *node = Node {
                    planes: EMPTY,
                    links: shape.links,
                    ranges: shape.ranges,
                };
            }
            for lane in 0..LANES {
                let link = node.links[lane];
                if lanes >> lane & 1 == 0 || !link.is_block() {
                    continue;
                }
                let block = &mut part.blocks[link.index()];
                let source = &part.shape.blocks[link.index()];
                let later = part.shape.blocks.get(link.index() + AHEAD);
                fetch(self.geometry.positions, later.unwrap_or(source));
                if self.stale {
                    block.triangles = source.triangles;
                }
                let boxes = fill::<I>(self.geometry, source, block, &mut fitted.unhittable);
                let (whole, areas) = boxes.fold(&source.ranges);
                set_bounds(&mut node.planes, lane, &whole);
                sums.add(areas.add(boxes.half_areas()));
            }
        }
        fitted.areas = sums.total();
        fitted
    }
}

/// Some nodes of one level.
struct FitNodes<'a> {
    which: Which<'a>,
    chosen: Option<&'a [u8]>,
    nodes: Window<'a, Node>,
    /// The nodes of later levels, and the first of them.
    below: (&'a [Node], usize),
}

impl Work for FitNodes<'_> {
    type Out = f64;

    #[inline(always)]
    fn run<I: Isa>(mut self) -> f64 {
        let (below, end) = self.below;
        let mut sums = Sums::default();
        for place in 0..self.which.count() {
            let n = self.which.at(place);
            let (node, lanes) = (&mut self.nodes[n], lanes_of(self.chosen, n));
            for lane in 0..LANES {
                let link = node.links[lane];
                let is_inner = !link.is_block() && link != Link::ROOT;
                if is_inner && lanes >> lane & 1 == 1 {
                    let child = &below[link.index() - end];
                    let boxes = EightBoxes::<I::Eight>::load(&child.planes);
                    let (whole, areas) = boxes.fold(&child.ranges);
                    set_bounds(&mut node.planes, lane, &whole);
                    sums.add(areas);
                }
            }
        }
        sums.total()
    }
}

/// Asks for the first vertices of a block's triangles; the others mostly lie beside them.
#[inline(always)]
fn fetch(positions: &[Point], of: &Source) {
    for vertex in of.vertices[0] {
        prefetch(positions, vertex as usize);
    }
}

/// Sets a block's corners and returns its triangles' boxes.
#[inline(always)]
fn fill<I: Isa>(
    geometry: &Geometry<'_>,
    source: &Source,
    block: &mut Block,
    unhittable: &mut Unhittable,
) -> EightBoxes<I::Eight> {
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
    let nothing = I::Eight::splat(f32::NAN);
    let from = I::Eight::splat(f32::INFINITY);
    let until = I::Eight::splat(f32::NEG_INFINITY);
    let mut boxes = EightBoxes {
        low: [from; 3],
        high: [until; 3],
    };
    for (axis, to) in block.corners.iter_mut().enumerate() {
        let [a, b, c] = each!(i => scaled(geometry.scale, corners[i][axis]));
        boxes.low[axis] = from.replace(mask, a.min(b).min(c));
        boxes.high[axis] = until.replace(mask, a.max(b).max(c));
        *to = each!(i => nothing.replace(mask, [a, b, c][i]).store());
    }
    boxes
}

/// Which lanes hold a triangle that can be hit; the others are counted.
#[inline(always)]
fn hittable<L: Eight>(corners: &[[L; 3]; 3], count: u32, unhittable: &mut Unhittable) -> u32 {
    let most = L::splat(f32::MAX);
    let mut finite = L::mask((1 << count) - 1);
    for x in corners.as_flattened() {
        finite = L::both(finite, x.abs().at_most(most));
    }
    let [a, b, c] = corners;
    let edges = each!(axis => [b[axis].sub(a[axis]), c[axis].sub(a[axis])]);
    let clear = L::bits(L::either(
        stands_clear(&edges, 0, 1),
        L::either(stands_clear(&edges, 1, 2), stands_clear(&edges, 2, 0)),
    ));
    let finite = L::bits(finite);
    unhittable.inactive += u64::from(count - finite.count_ones());
    let mut doubtful = finite & !clear;
    let mut hittable = finite & clear;
    if doubtful == 0 {
        return hittable;
    }
    let corners = each!(axis => each!(i => corners[i][axis].store()));
    while doubtful != 0 {
        let lane = doubtful.trailing_zeros();
        doubtful &= doubtful - 1;
        if is_degenerate(&triangle(&corners, lane as usize)) {
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
pub(crate) fn triangle(corners: &[[[f32; LANES]; 3]; 3], lane: usize) -> Triangle {
    let corner = |c: usize| {
        [
            corners[0][c][lane],
            corners[1][c][lane],
            corners[2][c][lane],
        ]
    };
    [corner(0), corner(1), corner(2)]
}

/// The box of a node, and the sum of half areas of the binary nodes that it stands for.
pub(crate) struct Fold<'a>(pub(crate) &'a Node);

impl Work for Fold<'_> {
    type Out = (Aabb, f64);

    #[inline(always)]
    fn run<I: Isa>(self) -> (Aabb, f64) {
        let (whole, areas) = EightBoxes::<I::Eight>::load(&self.0.planes).fold(&self.0.ranges);
        let mut sums = Sums::default();
        sums.add(areas);
        (whole, sums.total())
    }
}
