//! Preprocess and refit: positions to corners and boxes, block by block and node by node.

use crate::leaf::scaled;
use crate::simd::{Isa, Lanes, Work, each};
use crate::tree::{Block, EMPTY, LANES, Link, Node, Planes, Wide};
use bvh_layout::{Block as Source, BlockTree, Ranges};
use cpu_ref::geometry::{Geometry, Unhittable};
use cpu_ref::pass::{SplitAt, Which, Window, pass};
use geom::{Aabb, Triangle, is_degenerate};
use std::ops::Add;

/// Nodes that one task handles.
const RUN: usize = 128;

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
                if self.stale {
                    block.triangles = source.triangles;
                }
                let planes = fill::<I>(self.geometry, source, block, &mut fitted.unhittable);
                let (whole, between) = fold(&planes, &source.ranges);
                set_bounds(&mut node.planes, lane, &whole);
                fitted.areas += between + lane_areas(&planes);
            }
        }
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
        let mut sum = 0.0;
        for place in 0..self.which.count() {
            let n = self.which.at(place);
            let (node, lanes) = (&mut self.nodes[n], lanes_of(self.chosen, n));
            for lane in 0..LANES {
                let link = node.links[lane];
                let is_inner = !link.is_block() && link != Link::ROOT;
                if is_inner && lanes >> lane & 1 == 1 {
                    let child = &below[link.index() - end];
                    let (whole, between) = fold(&child.planes, &child.ranges);
                    set_bounds(&mut node.planes, lane, &whole);
                    sum += between;
                }
            }
        }
        sum
    }
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
        let [a, b, c] = each!(i => scaled(geometry.scale, I::Eight::load(&corners[axis][i])));
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

/// The lesser of two numbers, by one instruction: no plane is not a number.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// One plane of every range of two, then of four lanes, and of all lanes.
#[inline(always)]
fn table(planes: &[f32], least: impl Fn(f32, f32) -> f32) -> ([f32; 2 * LANES], f32) {
    let mut table = [planes[0]; 2 * LANES];
    for i in 0..LANES - 1 {
        table[i] = least(planes[i], planes[i + 1]);
    }
    for i in 0..LANES - 3 {
        table[LANES + i] = least(table[i], table[i + 2]);
    }
    (table, least(table[LANES], table[LANES + 4]))
}

/// The box of all lanes, and the sum of half areas of the boxes of `ranges`.
#[inline(always)]
pub(crate) fn fold(planes: &Planes, ranges: &Ranges) -> (Aabb, f64) {
    let mut whole = Aabb::EMPTY;
    let mut lower = [[0.0; 2 * LANES]; 3];
    let mut upper = lower;
    for axis in 0..3 {
        let (low, high) = planes[axis].split_at(LANES);
        (lower[axis], whole.min[axis]) = table(low, lesser);
        (upper[axis], whole.max[axis]) = table(high, greater);
    }
    let mut sum = 0.0;
    for &[a, b] in ranges.places() {
        let (a, b) = (usize::from(a) % (2 * LANES), usize::from(b) % (2 * LANES));
        let mut range = Aabb::EMPTY;
        for axis in 0..3 {
            range.min[axis] = lesser(lower[axis][a], lower[axis][b]);
            range.max[axis] = greater(upper[axis][a], upper[axis][b]);
        }
        sum += range.half_area();
    }
    (whole, sum)
}

/// The sum of half areas of all lanes.
#[inline(always)]
fn lane_areas(planes: &Planes) -> f64 {
    let mut sum = 0.0;
    for lane in 0..LANES {
        sum += bounds(planes, lane).half_area();
    }
    sum
}

/// The box of one lane.
#[inline(always)]
pub(crate) fn bounds(planes: &Planes, lane: usize) -> Aabb {
    Aabb {
        min: [planes[0][lane], planes[1][lane], planes[2][lane]],
        max: [
            planes[0][lane + LANES],
            planes[1][lane + LANES],
            planes[2][lane + LANES],
        ],
    }
}

/// Sets the box of one lane.
#[inline(always)]
fn set_bounds(planes: &mut Planes, lane: usize, bounds: &Aabb) {
    for (axis, planes) in planes.iter_mut().enumerate() {
        planes[lane] = bounds.min[axis];
        planes[lane + LANES] = bounds.max[axis];
    }
}
