//! What subtrees of a record cost as wide ones, from the bottom up.

use super::{First, LANES, RUN};
use crate::{NodeRank, NodeRanks, Topology};
use geom::Aabb;
use rayon::prelude::*;

/// What lies below a node of the binary tree.
#[derive(Clone, Copy)]
struct Subtree {
    /// Empty if boxes are not known.
    bounds: Aabb,
    leaves: u32,
}

/// The least areas of all nodes and blocks below a subtree and of itself, if so many lanes are left for it: one, two, up
/// to all but one.
pub(super) type Costs = [f32; LANES - 1];

/// A binary record, and what its subtrees cost as wide ones.
pub(super) struct CostedTree<'a> {
    ranks: NodeRanks<'a>,
    /// All inner nodes.
    subtrees: Vec<Subtree>,
    /// Of each inner node that is too large for a block. The other entries mean nothing.
    large: Vec<Costs>,
    /// One over the root's half area, if boxes are known.
    over_root: Option<f64>,
    first: First,
}

impl<'a> CostedTree<'a> {
    /// Areas are known if there is a box for each triangle.
    pub(super) fn of(tree: &'a Topology, (boxes, first): (&[Aabb], First)) -> Self {
        let boxes = Some(boxes).filter(|boxes| boxes.len() == tree.triangle_count());
        let subtrees = subtrees(tree, boxes);
        let root = subtrees.first().filter(|_| boxes.is_some());
        let mut costed = Self {
            ranks: tree.ranks(),
            over_root: root.map(|root| 1.0 / root.bounds.half_area().max(f64::MIN_POSITIVE)),
            subtrees,
            large: Vec::new(),
            first,
        };
        costed.large = costed.costs_of_large(tree);
        costed
    }

    /// From the bottom up (Ylitie, Karras, Laine, *Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
    /// BVHs*, 2017).
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

    /// Leaves of a node.
    #[inline]
    pub(super) fn size(&self, node: NodeRank) -> u32 {
        match node.leaf() {
            Some(_) => 1,
            None => self.subtrees[node.rank() as usize].leaves,
        }
    }

    /// An inner node's share of the root's area. Where that is not known, its leaves stand for it.
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

    /// `large` begins with the inner node `first`. A leaf is a block wherever it is.
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

    /// Likewise, that which is asked first in the later lane.
    pub(super) fn first_last(&self, inner: NodeRank) -> [NodeRank; 2] {
        let [left, right] = self.children(inner);
        // A leaf's area is not at hand: none is less than any.
        let known = |child: NodeRank| child.leaf().is_none().then(|| self.area(child));
        let has_order = self.first == First::Larger && self.over_root.is_some();
        match has_order && known(left) < known(right) {
            true => [left, right],
            false => [right, left],
        }
    }
}

/// All inner nodes.
fn subtrees(tree: &Topology, boxes: Option<&[Aabb]>) -> Vec<Subtree> {
    let triangles = tree.leaf_triangles();
    let leaf = |rank: u32| Subtree {
        bounds: boxes.map_or(Aabb::EMPTY, |boxes| {
            boxes[triangles[rank as usize] as usize]
        }),
        leaves: 1,
    };
    let none = Subtree {
        bounds: Aabb::EMPTY,
        leaves: 0,
    };
    tree.bottom_up(none, leaf, |a, b| Subtree {
        bounds: a.bounds.union(b.bounds),
        leaves: a.leaves + b.leaves,
    })
}

/// Of a node of that area, by its children's.
fn costs_above(area: f32, a: &Costs, b: &Costs) -> Costs {
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
