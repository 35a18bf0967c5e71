//! Costs of binary subtrees after collapsing, computed from the bottom up.

use super::{FirstVisited, LANES, TASK_SIZE};
use bvh_build::{BinaryTree, Subtree};
use geom::Aabb;
use rayon::prelude::*;

/// Entry `i` is the least total area of the wide nodes and blocks of a subtree that may take `i + 1` lanes of its
/// parent.
pub(super) type Costs = [f32; LANES - 1];

/// A binary tree, and the costs of its subtrees after collapsing.
pub(super) struct CostedTree<'a> {
    pub(super) tree: &'a BinaryTree,
    /// Box of each inner node. Empty if areas are unknown.
    bounds: Vec<Aabb>,
    /// Reciprocal of the root's half area, if areas are known.
    over_root: Option<f64>,
    /// Costs of each inner node that is too large for a block. The other entries are unused.
    large: Vec<Costs>,
    first_visited: FirstVisited,
}

impl<'a> CostedTree<'a> {
    /// Computes all costs. `boxes` has a box for each triangle, if areas are known.
    pub(super) fn of(
        tree: &'a BinaryTree,
        boxes: Option<&[Aabb]>,
        first_visited: FirstVisited,
    ) -> Self {
        let bounds = boxes.map_or_else(Vec::new, |boxes| bounds(tree, boxes));
        let root = bounds.first();
        let mut costed = Self {
            tree,
            over_root: root.map(|root| 1.0 / root.half_area().max(f64::MIN_POSITIVE)),
            bounds,
            large: Vec::new(),
            first_visited,
        };
        costed.large = costed.costs_of_large();
        costed
    }

    /// Computes costs from the bottom up (Ylitie, Karras, Laine, *Efficient Incoherent Ray Traversal on GPUs Through
    /// Compressed Wide BVHs*, 2017).
    fn costs_of_large(&self) -> Vec<Costs> {
        let mut all = vec![[0.0; LANES - 1]; self.tree.left_leaves().len()];
        let small = |node| self.costs_of_small(node);
        let join = |node, a, b| costs_above(self.area(node), &a, &b);
        if let Some(root) = self.tree.root() {
            bottom_up(self.tree, root, &mut all, &small, &join);
        }
        all
    }

    /// Returns an inner node's area relative to the root's. Returns its number of leaves if areas are unknown.
    fn area(&self, inner: Subtree) -> f32 {
        match self.over_root {
            Some(over_root) => (self.bounds[inner.inner as usize].half_area() * over_root) as f32,
            None => inner.leaves as f32,
        }
    }

    /// Returns the costs of a node.
    pub(super) fn costs(&self, node: Subtree) -> Costs {
        let small = self.costs_of_small(node);
        small.unwrap_or_else(|| self.large[node.inner as usize])
    }

    /// Returns the costs of a node that fits a block, otherwise `None`. A leaf here is the child of a large node, or the
    /// whole tree. However the tree is collapsed, this leaf is a block of its own. So its area does not affect the
    /// choice, and its cost is 0.
    fn costs_of_small(&self, node: Subtree) -> Option<Costs> {
        match node.leaves as usize {
            1 => Some([0.0; LANES - 1]),
            2..=LANES => Some([self.area(node); LANES - 1]),
            _ => None,
        }
    }

    /// Returns both children. The one to visit first comes last: the any-hit traversal of a single ray visits later
    /// lanes first.
    pub(super) fn children_in_lane_order(&self, inner: Subtree) -> [Subtree; 2] {
        let [left, right] = self.tree.children(inner);
        // A leaf's area is not stored: its `None` is less than any area.
        let known = |child: Subtree| (child.leaves > 1).then(|| self.area(child));
        let has_order = self.first_visited == FirstVisited::Larger && self.over_root.is_some();
        if has_order && known(left) < known(right) {
            [left, right]
        } else {
            [right, left]
        }
    }
}

/// Returns the box of every inner node, in preorder.
fn bounds(tree: &BinaryTree, boxes: &[Aabb]) -> Vec<Aabb> {
    let inner = tree.left_leaves().len();
    let mut all = Vec::new();
    // Allocates pages in parallel. Every element is overwritten.
    let unset = rayon::iter::repeat_n(Aabb::EMPTY, inner).with_min_len(32 * TASK_SIZE);
    unset.collect_into_vec(&mut all);
    let leaf = |node: Subtree| {
        let triangle = || tree.order()[node.first_leaf as usize];
        (node.leaves == 1).then(|| boxes[triangle() as usize])
    };
    if let Some(root) = tree.root() {
        bottom_up(tree, root, &mut all, &leaf, &|_, a: Aabb, b| a.union(b));
    }
    all
}

/// Computes the value of `node` from its children's values, in parallel. Stores the values of inner nodes in `all`, in
/// preorder. `known` returns the value of a node whose children are not needed.
fn bottom_up<T: Copy + Send>(
    tree: &BinaryTree,
    node: Subtree,
    all: &mut [T],
    known: &(impl Fn(Subtree) -> Option<T> + Sync),
    join: &(impl Fn(Subtree, T, T) -> T + Sync),
) -> T {
    if let Some(value) = known(node) {
        return value;
    }
    let [left, right] = tree.children(node);
    let (own, below) = all
        .split_first_mut()
        .expect("one value for each inner node");
    let (below_left, below_right) = below.split_at_mut(left.leaves as usize - 1);
    let mut left = || bottom_up(tree, left, below_left, known, join);
    let mut right = || bottom_up(tree, right, below_right, known, join);
    let (a, b) = if node.leaves as usize > TASK_SIZE {
        rayon::join(left, right)
    } else {
        (left(), right())
    };
    *own = join(node, a, b);
    *own
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
