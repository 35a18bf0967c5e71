//! Costs of binary subtrees after collapsing, computed from the bottom up.

use super::{CollapseOptions, First, LANES, RUN};
use crate::{NodeRank, NodeRanks, Topology};
use geom::Aabb;
use rayon::prelude::*;

/// Summary of the subtree below a binary node.
#[derive(Clone, Copy)]
struct SubtreeSummary {
    /// Empty if there are no boxes.
    bounds: Aabb,
    leaves: u32,
}

/// Entry `i` is the least total area of the wide nodes and blocks of a subtree that may take `i + 1` lanes of its
/// parent.
pub(super) type Costs = [f32; LANES - 1];

/// A binary tree, and the costs of its subtrees after collapsing.
pub(super) struct CostedTree<'a> {
    ranks: NodeRanks<'a>,
    /// One entry per inner node.
    subtrees: Vec<SubtreeSummary>,
    /// Costs of each inner node that is too large for a block. The other entries are unused.
    large: Vec<Costs>,
    /// Reciprocal of the root's half area, if there are boxes.
    over_root: Option<f64>,
    first: First,
}

impl<'a> CostedTree<'a> {
    /// Computes all costs. Boxes are used only if there is one for each triangle.
    pub(super) fn of(tree: &'a Topology, options: CollapseOptions<'_>) -> Self {
        let boxes = Some(options.boxes).filter(|boxes| boxes.len() == tree.triangle_count());
        let subtrees = subtrees(tree, boxes);
        let root = subtrees.first().filter(|_| boxes.is_some());
        let mut costed = Self {
            ranks: tree.ranks(),
            over_root: root.map(|root| 1.0 / root.bounds.half_area().max(f64::MIN_POSITIVE)),
            subtrees,
            large: Vec::new(),
            first: options.first,
        };
        costed.large = costed.costs_of_large(tree);
        costed
    }

    /// Computes costs from the bottom up (Ylitie, Karras, Laine, *Efficient Incoherent Ray Traversal on GPUs Through
    /// Compressed Wide BVHs*, 2017).
    fn costs_of_large(&self, tree: &Topology) -> Vec<Costs> {
        let mut all = vec![[0.0; LANES - 1]; self.subtrees.len()];
        let levels: Vec<_> = tree.levels().collect();
        for level in levels.iter().rev() {
            let [start, end] = [level.start, level.end].map(|rank| rank as usize);
            let (upper, deeper) = all.split_at_mut(end);
            let costs = upper[start..].par_iter_mut().with_min_len(RUN / 4);
            costs.zip(start..end).for_each(|(to, rank)| {
                let node = NodeRank::inner(rank);
                if self.size(node) as usize > LANES {
                    let [a, b] = self.children(node).map(|c| self.costs_by(c, deeper, end));
                    *to = costs_above(self.area(node), &a, &b);
                }
            });
        }
        all
    }

    /// Returns the number of leaves of a node.
    #[inline]
    pub(super) fn size(&self, node: NodeRank) -> u32 {
        match node.leaf() {
            Some(_) => 1,
            None => self.subtrees[node.rank() as usize].leaves,
        }
    }

    /// Returns an inner node's area relative to the root's. Without boxes, returns its number of leaves.
    fn area(&self, inner: NodeRank) -> f32 {
        let subtree = &self.subtrees[inner.rank() as usize];
        match self.over_root {
            Some(over_root) => (subtree.bounds.half_area() * over_root) as f32,
            None => subtree.leaves as f32,
        }
    }

    pub(super) fn costs(&self, node: NodeRank) -> Costs {
        self.costs_by(node, &self.large, 0)
    }

    /// Returns the costs of a node. `large` begins with inner node `first`. A leaf here is always the
    /// child of a large node. Every wide tree has a block for this leaf alone, so its area does not affect the choice
    /// and its cost is 0.
    fn costs_by(&self, node: NodeRank, large: &[Costs], first: usize) -> Costs {
        if node.leaf().is_some() {
            [0.0; LANES - 1]
        } else if self.size(node) as usize <= LANES {
            [self.area(node); LANES - 1]
        } else {
            large[node.rank() as usize - first]
        }
    }

    pub(super) fn children(&self, inner: NodeRank) -> [NodeRank; 2] {
        self.ranks.children(inner)
    }

    /// Returns both children. The one to visit first comes last, since traversal visits later lanes first.
    pub(super) fn first_last(&self, inner: NodeRank) -> [NodeRank; 2] {
        let [left, right] = self.children(inner);
        // A leaf's area is not stored: its `None` is less than any area.
        let known = |child: NodeRank| child.leaf().is_none().then(|| self.area(child));
        let has_order = self.first == First::Larger && self.over_root.is_some();
        if has_order && known(left) < known(right) {
            [left, right]
        } else {
            [right, left]
        }
    }
}

/// Summarizes the subtree of every inner node.
fn subtrees(tree: &Topology, boxes: Option<&[Aabb]>) -> Vec<SubtreeSummary> {
    let triangles = tree.leaf_triangles();
    let leaf = |rank: u32| SubtreeSummary {
        bounds: boxes.map_or(Aabb::EMPTY, |boxes| {
            boxes[triangles[rank as usize] as usize]
        }),
        leaves: 1,
    };
    let none = SubtreeSummary {
        bounds: Aabb::EMPTY,
        leaves: 0,
    };
    tree.bottom_up(none, leaf, |a, b| SubtreeSummary {
        bounds: a.bounds.union(b.bounds),
        leaves: a.leaves + b.leaves,
    })
}

/// Computes the costs of a node from its area and its children's costs.
fn costs_above(area: f32, a: &Costs, b: &Costs) -> Costs {
    // Least cost of both children in `lanes` lanes.
    let opened = |lanes: usize| {
        let shares = a[..lanes - 1].iter().zip(b[..lanes - 1].iter().rev());
        shares.fold(f32::INFINITY, |least, (a, b)| least.min(a + b))
    };
    let mut costs = [area + opened(LANES); LANES - 1];
    for lanes in 2..LANES {
        costs[lanes - 1] = costs[lanes - 2].min(opened(lanes));
    }
    costs
}
