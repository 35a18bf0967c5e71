//! Traversal of the wide tree for tests that take one triangle at a time.

use crate::boxes::bounds;
use crate::leaf::{OfBlock, TriangleRay};
use crate::rays::{Group, OneRay};
use crate::simd::{Isa, Lanes, Work};
use crate::tree::{LANES, Records, Wide};
use crate::walk::{NodeRay, Stack, Visitor, walk};
use cpu_ref::intersect::{Record, TriangleTest};
use cpu_ref::scale::PreparedRay;
use cpu_ref::traverse::{Below, Leaf, Tree};
use geom::{Aabb, Hit};

impl Tree for &Wide {
    type Waiting = Stack;

    fn root(&self) -> Aabb {
        self.root
    }

    #[inline]
    fn triangle(&self, place: usize) -> Option<u32> {
        let triangle = self.blocks[place / LANES].triangles[place % LANES];
        (triangle != Hit::MISS.triangle).then_some(triangle)
    }

    #[inline]
    fn record<T: TriangleTest>(&self, place: usize) -> Record {
        match self.records.get(place / LANES) {
            Some(Records(rows)) => Record(rows.map(|row| row.map(|column| column[place % LANES]))),
            None => T::record(&self.blocks[place / LANES].triangle(place % LANES)),
        }
    }

    fn children(&self, node: u32, mut each: impl FnMut(&Aabb, Below)) {
        let node = &self.nodes[node as usize];
        for (lane, link) in node.links.into_iter().enumerate() {
            let below = match link.is_block() {
                true => Below::Places {
                    first: link.index() * LANES,
                    count: LANES,
                },
                false => Below::Node(link.index() as u32),
            };
            each(&bounds(&node.planes, lane), below);
        }
    }

    #[inline]
    fn visit(
        &self,
        ray: &PreparedRay,
        stack: &mut Stack,
        mut see: impl FnMut(&Leaf, f32) -> Option<f32>,
    ) -> bool {
        self.level.run(Visit {
            tree: self,
            ray,
            stack,
            see: &mut see,
        })
    }
}

/// Callback that tests a leaf and returns the next bound, or `None` to end the visit.
type See<'a> = dyn FnMut(&Leaf, f32) -> Option<f32> + 'a;

struct Visit<'a> {
    tree: &'a Wide,
    ray: &'a PreparedRay,
    stack: &'a mut Stack,
    /// Called through a pointer, so that the traversal is compiled once for all tests.
    see: &'a mut See<'a>,
}

impl Work for Visit<'_> {
    type Out = bool;

    #[inline(always)]
    fn run<I: Isa>(self) -> bool {
        let group = &Group::alone(self.ray, &self.tree.root);
        let ray = OneRay { group, lane: 0 };
        let mut each = EachTriangle {
            tree: self.tree,
            ray: TriangleRay::<I::Eight>::single(&ray),
            see: self.see,
        };
        let ray = NodeRay::<I::Eight>::new(&ray, self.tree.spread);
        let rays = (&ray, self.ray.t_max);
        walk::<I>(self.tree, rays, self.stack, &mut each)
    }
}

/// Calls `see` for each triangle of a block whose own box the ray meets.
struct EachTriangle<'a, L> {
    tree: &'a Wide,
    ray: TriangleRay<L>,
    see: &'a mut See<'a>,
}

impl<I, L: Lanes<Array = [f32; LANES]>> Visitor<I> for EachTriangle<'_, L> {
    #[inline(always)]
    fn block(&mut self, block: usize, mut bound: f32) -> Option<f32> {
        let tree = self.tree;
        let spans = self.ray.spans(OfBlock { tree, block }, bound);
        let (entry, exit) = (spans.entry.store(), spans.exit.store());
        let mut lanes = spans.lanes;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % LANES;
            lanes &= lanes - 1;
            let leaf = Leaf {
                place: block * LANES + lane,
                entry: entry[lane],
                exit: exit[lane],
            };
            if leaf.entry <= bound {
                bound = (self.see)(&leaf, bound)?;
            }
        }
        Some(bound)
    }
}
