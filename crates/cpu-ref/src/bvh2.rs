//! The tree of Kim and others (2014): binary, breadth first, one triangle per leaf.

use crate::accelerator::{Accelerator, reserve};
use crate::box_test::{BoxRay, BoxSpan};
use crate::geometry::{Geometry, Unhittable};
use crate::intersect::{TriangleData, preprocess};
use crate::output::{HitCounts, TraceOutput};
use crate::scale::PreparedRay;
use crate::trace::QueryTracer;
use crate::traversal::{Child, TreeTraversal, TriangleVisitor, VisitedTriangle};
use backend::{Intersector, Result};
use bvh_build::{BinaryTree, MAX_DEPTH};
use bvh_layout::Topology;
use geom::{Aabb, Animation, is_active, is_degenerate};
use rayon::prelude::*;
use std::mem::swap;
use std::ops::{Add, Range};

/// A leaf or an inner node, with its box.
#[derive(Clone, Copy, Debug)]
struct BinaryNode {
    bounds: Aabb,
    below: NodeContent,
}

#[derive(Clone, Copy, Debug)]
enum NodeContent {
    /// Number of the leaf.
    Leaf(u32),
    /// Number of the left child. The right child is the next node.
    Inner(u32),
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
    /// Breadth first, root first.
    nodes: Vec<BinaryNode>,
    /// The leaves, in node order.
    leaves: Vec<BinaryLeaf>,
    /// Nodes of each level, root first.
    levels: Vec<Range<usize>>,
}

/// Number of nodes per task, and minimum number of leaves per task.
const RUN: usize = 1024;

impl Bvh2 {
    /// Returns the boxes of a tree's nodes at one moment, in breadth-first order and scaled units.
    ///
    /// # Errors
    /// If memory does not suffice.
    pub fn boxes_of(tree: &BinaryTree, geometry: &Geometry<'_>) -> Result<Vec<Aabb>> {
        let mut all = Self::default();
        all.convert(tree)?;
        all.preprocess(geometry, Intersector::Watertight);
        all.refit();
        all.boxes(geometry)
    }

    /// Converts a tree to breadth-first order, level by level, in existing memory.
    fn convert(&mut self, tree: &BinaryTree) -> Result<()> {
        let leaves = tree.leaf_count();
        reserve(&mut self.nodes, (2 * leaves).saturating_sub(1), "nodes")?;
        reserve(&mut self.leaves, leaves, "triangle data")?;
        self.nodes.clear();
        self.leaves.clear();
        self.levels.clear();
        let (mut level, mut next) = (Vec::from_iter(tree.root()), Vec::new());
        while !level.is_empty() {
            let (start, end) = (self.nodes.len(), self.nodes.len() + level.len());
            self.levels.push(start..end);
            for node in level.drain(..) {
                let below = if node.leaves == 1 {
                    self.leaves.push(BinaryLeaf {
                        triangle: tree.order()[node.first_leaf as usize],
                        bounds: Aabb::EMPTY,
                        data: TriangleData::default(),
                    });
                    NodeContent::Leaf(self.leaves.len() as u32 - 1)
                } else {
                    next.extend(tree.children(node));
                    NodeContent::Inner((end + next.len()) as u32 - 2)
                };
                let bounds = Aabb::EMPTY;
                self.nodes.push(BinaryNode { bounds, below });
            }
            swap(&mut level, &mut next);
        }
        Ok(())
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

    fn adopt(&mut self, tree: &Topology, _: &Animation) -> Result<()> {
        self.convert(tree.binary())
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
                node.bounds = match node.below {
                    NodeContent::Leaf(leaf) => self.leaves[leaf as usize].bounds,
                    NodeContent::Inner(left) => {
                        let left = left as usize - level.end;
                        below[left].bounds.union(below[left + 1].bounds)
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
            let left = match self.nodes[node].below {
                NodeContent::Inner(left) => left as usize,
                NodeContent::Leaf(leaf) => {
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
            };
            let [left, right] = [left, left + 1].map(|child| meet(child, bound));
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
        match parent.below {
            NodeContent::Leaf(leaf) => {
                let leaf = &self.leaves[leaf as usize];
                each(&leaf.bounds, Child::Triangle(leaf.triangle));
            }
            NodeContent::Inner(left) => {
                for child in [left, left + 1] {
                    each(&self.nodes[child as usize].bounds, Child::Node(child));
                }
            }
        }
    }
}
