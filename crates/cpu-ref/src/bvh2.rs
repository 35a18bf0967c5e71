//! The tree of Kim and others (2014): binary, breadth first, one triangle per leaf.

use crate::accelerator::{Accelerator, reserve};
use crate::box_test::{BoxRay, BoxSpan};
use crate::geometry::{Geometry, Unhittable};
use crate::intersect::{TriangleData, preprocess};
use crate::output::{HitCounts, TraceOutput};
use crate::scale::PreparedRay;
use crate::trace::QueryTracer;
use crate::tree::{Child, TreeTraversal, TriangleVisitor, VisitedTriangle};
use backend::{Intersector, Result, TreeFormat};
use bvh_build::MAX_DEPTH;
use bvh_layout::{NodeRank, Topology};
use geom::{Aabb, Animation, is_active, is_degenerate};
use rayon::prelude::*;
use std::ops::{Add, Range};

/// A leaf or an inner node, with its box.
#[derive(Clone, Copy, Debug)]
struct BinaryNode {
    bounds: Aabb,
    /// Number in the list of leaves or in the list of inner nodes.
    rank: NodeRank,
}

/// A leaf, with its triangle's data of one moment.
#[derive(Clone, Copy, Debug)]
struct BinaryLeaf {
    triangle: u32,
    bounds: Aabb,
    data: TriangleData,
}

/// The tree, with the boxes and triangle data of one moment.
#[derive(Debug, Default)]
pub struct Bvh2 {
    /// Breadth first, root first. The children of the `k`-th inner node are nodes `2k + 1` and `2k + 2`.
    nodes: Vec<BinaryNode>,
    /// The leaves, in node order.
    leaves: Vec<BinaryLeaf>,
    /// Nodes of each level, root first.
    levels: Vec<Range<usize>>,
}

/// Number of nodes per task, and minimum number of leaves per task.
const RUN: usize = 1024;

impl Bvh2 {
    /// Returns the boxes of a tree's nodes at one moment, in node order and scaled units.
    ///
    /// # Errors
    /// If memory does not suffice.
    pub fn boxes_of(tree: &Topology, geometry: &Geometry<'_>) -> Result<Vec<Aabb>> {
        let mut all = Self::default();
        all.copy(tree)?;
        all.preprocess(geometry, Intersector::Watertight);
        all.refit();
        all.boxes(geometry)
    }

    /// Copies a tree's structure into existing memory.
    fn copy(&mut self, tree: &Topology) -> Result<()> {
        reserve(&mut self.nodes, tree.node_count(), "nodes")?;
        reserve(&mut self.leaves, tree.leaf_count(), "triangle data")?;
        let ranks = tree.ranks();
        let nodes = (0..tree.node_count() as u32).into_par_iter();
        let nodes = nodes.with_min_len(RUN).map(|node| BinaryNode {
            bounds: Aabb::EMPTY,
            rank: ranks.of(node),
        });
        nodes.collect_into_vec(&mut self.nodes);
        let leaves = tree.leaf_triangles().par_iter().with_min_len(RUN);
        let leaves = leaves.map(|&triangle| BinaryLeaf {
            triangle,
            bounds: Aabb::EMPTY,
            data: TriangleData::default(),
        });
        leaves.collect_into_vec(&mut self.leaves);
        let children = |inner: Range<u32>| {
            let [first, _] = Topology::children_of_inner(inner.start);
            let [end, _] = Topology::children_of_inner(inner.end);
            first as usize..end as usize
        };
        let below_root = tree.levels().map(children);
        let levels = std::iter::once(0..1).chain(below_root);
        self.levels.clear();
        self.levels.extend(levels.take(tree.level_count()));
        Ok(())
    }

    /// Returns the node numbers of an inner node's children.
    #[inline]
    fn children(inner: NodeRank) -> [usize; 2] {
        Topology::children_of_inner(inner.rank()).map(|node| node as usize)
    }
}

impl BinaryLeaf {
    /// Computes the triangle data and the box.
    fn preprocess(&mut self, geometry: &Geometry<'_>, intersector: Intersector) -> Unhittable {
        let mut unhittable = Unhittable::default();
        let corners = geometry.corners(self.triangle);
        self.bounds = Aabb::EMPTY;
        if !is_active(&corners) {
            unhittable.inactive = 1;
        } else if is_degenerate(&corners) {
            unhittable.degenerate = 1;
        } else {
            let corners = corners.map(|p| geometry.scale.apply(p));
            self.data = preprocess(intersector, &corners);
            self.bounds = Aabb::of_triangle(&corners);
        }
        unhittable
    }
}

impl Accelerator for Bvh2 {
    fn tree(&self) -> &dyn TreeTraversal {
        self
    }

    fn format(&self) -> TreeFormat {
        TreeFormat::Binary
    }

    fn adopt(&mut self, tree: &Topology, _: &Animation) -> Result<()> {
        self.copy(tree)
    }

    fn preprocess(&mut self, geometry: &Geometry<'_>, intersector: Intersector) -> Unhittable {
        let leaves = self.leaves.par_iter_mut().with_min_len(RUN);
        leaves
            .map(|leaf| leaf.preprocess(geometry, intersector))
            .reduce(Unhittable::default, Add::add)
    }

    fn refit(&mut self) -> f64 {
        let mut areas = 0.0;
        for level in self.levels.iter().rev() {
            let (upper, below) = self.nodes.split_at_mut(level.end);
            let tasks = upper[level.start..].par_chunks_mut(RUN);
            let refit = |node: &mut BinaryNode| {
                node.bounds = match node.rank.leaf() {
                    Some(leaf) => self.leaves[leaf as usize].bounds,
                    None => {
                        let [a, b] = Self::children(node.rank);
                        below[a - level.end]
                            .bounds
                            .union(below[b - level.end].bounds)
                    }
                };
                node.bounds.half_area()
            };
            // Sums per task are added in order, so that the total does not depend on the number of threads.
            let sums: Vec<f64> = tasks
                .map(|nodes| nodes.iter_mut().map(refit).sum())
                .collect();
            areas += sums.into_iter().sum::<f64>();
        }
        areas
    }

    fn trace(&self, tracer: &QueryTracer<'_>, out: TraceOutput<'_>) -> HitCounts {
        tracer.trace(out)
    }

    fn boxes(&self, _: &Geometry<'_>) -> Result<Vec<Aabb>> {
        Ok(self.nodes.iter().map(|node| node.bounds).collect())
    }
}

/// A node still to visit, and the span of the ray within its box.
struct PendingChild {
    node: usize,
    span: BoxSpan,
}

/// Capacity of the stack. Each level leaves at most one node on it while the other child is visited.
const STACK: usize = MAX_DEPTH as usize + 1;

impl TreeTraversal for Bvh2 {
    fn root(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, |root| root.bounds)
    }

    fn traverse(&self, ray: &PreparedRay, visitor: &mut TriangleVisitor<'_>) -> bool {
        let (box_ray, mut bound) = (BoxRay::new(ray), ray.t_max);
        let meet = |node: usize, bound: f32| {
            let span = box_ray.meet(&self.nodes[node].bounds, bound)?;
            Some(PendingChild { node, span })
        };
        let mut stack = Vec::with_capacity(STACK);
        if !self.nodes.is_empty() {
            stack.extend(meet(0, bound));
        }
        while let Some(PendingChild { node, span }) = stack.pop() {
            // Equal distances are visited too: such a hit may have a lower index.
            if span.entry > bound {
                continue;
            }
            let rank = self.nodes[node].rank;
            if let Some(leaf) = rank.leaf() {
                let leaf = &self.leaves[leaf as usize];
                let visited = VisitedTriangle {
                    triangle: leaf.triangle,
                    data: &leaf.data,
                    entry: span.entry,
                    exit: span.exit,
                };
                match visitor(&visited, bound) {
                    Some(tighter) => bound = tighter,
                    None => return true,
                }
                continue;
            }
            let [left, right] = Self::children(rank).map(|child| meet(child, bound));
            let right_is_nearer = match (&left, &right) {
                (Some(left), Some(right)) => right.span.entry < left.span.entry,
                _ => false,
            };
            let [far, near] = if right_is_nearer {
                [left, right]
            } else {
                [right, left]
            };
            stack.extend(far);
            stack.extend(near);
        }
        false
    }

    fn children(&self, node: u32, each: &mut dyn FnMut(&Aabb, Child)) {
        let Some(parent) = self.nodes.get(node as usize) else {
            return;
        };
        if let Some(leaf) = parent.rank.leaf() {
            let leaf = &self.leaves[leaf as usize];
            return each(&leaf.bounds, Child::Triangle(leaf.triangle));
        }
        for child in Self::children(parent.rank) {
            each(&self.nodes[child].bounds, Child::Node(child as u32));
        }
    }
}
