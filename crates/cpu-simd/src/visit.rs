//! Implements [`TreeTraversal`] for the wide tree, so that searches of `cpu-ref` can visit its triangles one at a time.

use crate::leaf::{BlockTriangles, TriangleRay};
use crate::rays::{OneRay, PreparedRays};
use crate::simd::{Isa, Lanes, SetLanes, VectorWork};
use crate::tree::{Bvh8, LANES, Link, bounds};
use crate::walk::{NodeRay, TraversalStack, Visitor, walk};
use cpu_ref::scale::PreparedRay;
use cpu_ref::{Child, TreeTraversal, TriangleVisitor, VisitedTriangle, intersect};
use geom::{Aabb, Hit};

impl TreeTraversal for Bvh8 {
    fn root(&self) -> Aabb {
        self.root
    }

    fn traverse(&self, ray: &PreparedRay, visitor: &mut TriangleVisitor<'_>) -> bool {
        self.instruction_set.run(Traversal {
            tree: self,
            ray,
            visitor,
        })
    }

    fn children(&self, node: u32, each: &mut dyn FnMut(&Aabb, Child)) {
        let node = &self.nodes[node as usize];
        for (lane, link) in node.links.into_iter().enumerate() {
            let bounds = bounds(&node.planes, lane);
            if link.is_block() {
                let triangles = self.blocks[link.index()].triangles.into_iter();
                let triangles = triangles.filter(|&triangle| triangle != Hit::MISS.triangle);
                triangles.for_each(|triangle| each(&bounds, Child::Triangle(triangle)));
            } else if link != Link::NONE {
                each(&bounds, Child::Node(link.index() as u32));
            }
        }
    }
}

struct Traversal<'a, 'v> {
    tree: &'a Bvh8,
    ray: &'a PreparedRay,
    /// Called through a pointer, so that the traversal is compiled once for all searches.
    visitor: &'a mut TriangleVisitor<'v>,
}

impl VectorWork for Traversal<'_, '_> {
    type Out = bool;

    #[inline(always)]
    fn run<I: Isa>(self) -> bool {
        let group = &PreparedRays::alone(self.ray, &self.tree.root);
        let ray = OneRay { group, lane: 0 };
        let mut each = TriangleByTriangle {
            tree: self.tree,
            ray: TriangleRay::<I::Eight>::single(&ray),
            visitor: self.visitor,
        };
        let (tree, bound) = (self.tree, ray.t_max());
        let ray = NodeRay::<I::Eight>::new(&ray, tree.own_padding);
        walk::<I>(tree, &ray, bound, &mut TraversalStack::default(), &mut each)
    }
}

/// Calls the visitor for each triangle of a block whose own box the ray meets.
struct TriangleByTriangle<'a, 'v, L> {
    tree: &'a Bvh8,
    ray: TriangleRay<L>,
    visitor: &'a mut TriangleVisitor<'v>,
}

impl<I, L: Lanes<Array = [f32; LANES]>> Visitor<I> for TriangleByTriangle<'_, '_, L> {
    #[inline(always)]
    fn block(&mut self, block: usize, mut bound: f32) -> Option<f32> {
        let tree = self.tree;
        let corners = self.ray.relative(&BlockTriangles { tree, block });
        let spans = self.ray.spans_of(&corners, L::splat(bound));
        let (entries, exits) = (spans.entry.store(), spans.exit.store());
        let block = &tree.blocks[block];
        for lane in SetLanes::<LANES>(spans.lanes) {
            let (entry, exit) = (entries[lane], exits[lane]);
            if entry <= bound {
                let visited = VisitedTriangle {
                    triangle: block.triangles[lane],
                    data: &intersect::preprocess(tree.intersector, &block.triangle(lane)),
                    entry,
                    exit,
                };
                bound = (self.visitor)(&visited, bound)?;
            }
        }
        Some(bound)
    }
}
