//! Preprocess and refit: computes corners and boxes from positions, block by block and node by node.

use crate::boxes::{EightBoxes, Sums, set_bounds};
use crate::leaf::scaled;
use crate::simd::{Eight, Isa, Lanes, Vector, Work, each, prefetch};
use crate::subtrees::{LevelPart, Subtrees};
use crate::tree::{Block, EMPTY, LANES, Link, Node, Wide};
use bvh_layout::{Block as Source, BlockTree};
use cpu_ref::pass::{Which, Window};
use cpu_ref::{Geometry, Unhittable};
use geom::{Aabb, Triangle, is_degenerate};
use std::ops::Add;

/// Distance, in blocks, at which vertices are prefetched, because they are scattered in memory.
const AHEAD: usize = 4;

/// Results of fitting.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Fitted {
    pub(crate) unhittable: Unhittable,
    /// Half areas of the boxes within blocks and of the collapsed nodes below lanes.
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
    /// Sets the corners of blocks, and all boxes from there up to the root's lanes. `which` has the nodes to fit of
    /// each level, root first. `lanes` has a bit for each lane to fit of each node; `None` fits all lanes.
    pub(crate) fn fit<'a>(
        &'a mut self,
        which: impl Iterator<Item = Which<'a>>,
        lanes: Option<&[u8]>,
        geometry: &Geometry<'_>,
    ) -> Fitted {
        let (shape, instructions) = (&*self.shape, self.level);
        let stale = std::mem::take(&mut self.stale);
        let tree = Subtrees::of(shape, which, (&mut self.nodes, &mut self.blocks));
        tree.fold(shape, &|level, below| {
            instructions.run(FitLevel {
                level,
                inputs: Inputs {
                    shape,
                    geometry,
                    stale,
                    lanes,
                    below: below.map(|below| &below.nodes),
                },
            })
        })
    }
}

struct FitLevel<'a, 'b> {
    level: &'a mut LevelPart<'b>,
    inputs: Inputs<'a>,
}

/// Input of fitting a level.
#[derive(Clone, Copy)]
struct Inputs<'a> {
    shape: &'a BlockTree,
    geometry: &'a Geometry<'a>,
    /// Set if nodes and blocks still have the contents of another tree. Then every node and block is fitted.
    stale: bool,
    lanes: Option<&'a [u8]>,
    /// The level below, which is fitted already.
    below: Option<&'a Window<'a, Node>>,
}

impl Work for FitLevel<'_, '_> {
    type Out = Fitted;

    #[inline(always)]
    fn run<I: Isa>(self) -> Fitted {
        let (level, inputs) = (self.level, self.inputs);
        let (mut fitted, mut sums) = (Fitted::default(), Sums::default());
        for place in 0..level.which.count() {
            let n = level.which.at(place);
            let lanes = inputs.lanes.map_or(u8::MAX, |lanes| lanes[n]);
            let node = &mut level.nodes[n];
            if inputs.stale {
                let shape = &inputs.shape.nodes[n];
                *node = Node {
                    planes: EMPTY,
                    links: shape.links,
                    ranges: shape.ranges,
                };
            }
            for lane in 0..LANES {
                let link = node.links[lane];
                if lanes >> lane & 1 == 0 || link == Link::ROOT {
                    continue;
                }
                let (whole, areas) = if link.is_block() {
                    let block = &mut level.blocks[link.index()];
                    inputs.fit_block::<I>((link.index(), block), &mut fitted.unhittable)
                } else if let Some(below) = inputs.below {
                    let child = &below[link.index()];
                    EightBoxes::load(&child.planes).fold(&child.ranges)
                } else {
                    continue;
                };
                set_bounds(&mut node.planes, lane, &whole);
                sums.add(areas);
            }
        }
        fitted.areas = sums.total();
        fitted
    }
}

impl Inputs<'_> {
    /// Sets a block's corners. Returns its box, and the half areas of the boxes within.
    #[inline(always)]
    fn fit_block<I: Isa>(
        &self,
        (number, block): (usize, &mut Block),
        unhittable: &mut Unhittable,
    ) -> (Aabb, I::Eight) {
        let source = &self.shape.blocks[number];
        let later = self.shape.blocks.get(number + AHEAD).unwrap_or(source);
        // The other vertices of a triangle are mostly near its first one in memory.
        for vertex in later.vertices[0] {
            prefetch(self.geometry.positions, vertex as usize);
        }
        if self.stale {
            block.triangles = source.triangles;
        }
        let boxes = fill::<I>(self.geometry, source, block, unhittable);
        let (whole, areas) = boxes.fold(&source.ranges);
        (whole, areas.add(boxes.half_areas()))
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

/// Returns whether a component of the cross product is certainly nonzero. Each product has three roundings and the
/// difference one more. Small values may have lost digits and large ones may be infinite, so neither is certain.
#[inline(always)]
fn stands_clear<L: Lanes>(edges: &[[L; 2]; 3], i: usize, j: usize) -> L::Mask {
    let (p, q) = (edges[i][0].mul(edges[j][1]), edges[j][0].mul(edges[i][1]));
    let size = p.abs().add(q.abs());
    let doubt = size.mul(L::splat(8.0 * f32::EPSILON));
    doubt.add(L::splat(1e-30)).less(p.sub(q).abs())
}

#[inline(always)]
pub(crate) fn triangle(corners: &[[[f32; LANES]; 3]; 3], lane: usize) -> Triangle {
    each!(c => each!(axis => corners[axis][c][lane]))
}
