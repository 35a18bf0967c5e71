//! Where to cut: subtrees that fit a treelet, and neighbours that fit one together.

use super::Treelets;
use crate::{NodeRank, Topology};
use bvh_build::{BinaryTree, Subtree};
use std::ops::Range;

/// One level of treelets.
#[derive(Debug)]
pub(super) struct Cut {
    /// The subtrees that are kept whole, left to right.
    pub(super) roots: Vec<Subtree>,
    /// Each treelet's share of them.
    pub(super) treelets: Vec<Range<usize>>,
    /// What lies above, whose leaves the roots are: for each inner node in preorder, the roots to its left.
    pub(super) above: Vec<u32>,
    /// Which of the tree's inner nodes those are.
    pub(super) names: Vec<u32>,
}

/// Triangles of a tree that is cut into the largest subtrees that fit. A device has enough workgroups to make all of its
/// treelets at once, and fewer roots save levels.
const SMALL: usize = 1 << 17;
/// Triangles of a larger tree's subtrees at most: four or more fill a treelet, on average to nine tenths, where the largest
/// that fit leave three tenths empty (an H200: 17 us fewer at 1.6M triangles, of 146; with 128: 12, 48: 14 to 16).
const QUARTER: usize = Treelets::LEAVES / 4;

impl Cut {
    /// All levels, that of the triangles first.
    ///
    /// Each has at most a quarter of the roots of the one below, and one to spare: an inner node
    /// that is cut through has more than 256 leaves; of such nodes without such children
    /// there are fewer than a 256th of the leaves, and each has at most 64 nodes above. Where subtrees of the lowest
    /// level are smaller, it has at most half as many roots as leaves: above each such node that has 65 leaves or more
    /// there are at most 57 others (it is 7 levels high), and each has a leaf that is not below those.
    pub(super) fn all(tree: &BinaryTree) -> Vec<Self> {
        let most = match tree.leaf_count() {
            0..=SMALL => Treelets::LEAVES,
            _ => QUARTER,
        };
        let mut levels = vec![Self::new(tree.left_leaves(), most, None)];
        while let Some(last) = levels.last()
            && !last.above.is_empty()
        {
            let next = Self::new(&last.above, Treelets::LEAVES, Some(&last.names));
            levels.push(next);
        }
        // From the top down: roots go into one treelet only if they stand below one treelet.
        let mut starts = Vec::new();
        for level in levels.iter_mut().rev() {
            level.treelets = pack(&level.roots, &starts);
            let treelets = level.treelets.iter();
            starts = treelets.map(|t| level.leaves(t).start).collect();
        }
        levels
    }

    fn new(left_leaves: &[u32], most: usize, below: Option<&[u32]>) -> Self {
        let (mut roots, mut above, mut names) = (Vec::new(), Vec::new(), Vec::new());
        let root = Subtree {
            inner: 0,
            first_leaf: 0,
            leaves: left_leaves.len() as u32 + 1,
        };
        let mut waiting = vec![(root, None)];
        while let Some((node, right_of)) = waiting.pop() {
            if let Some(parent) = right_of {
                // Until its left side was done, the parent's entry held the roots before it.
                let before: &mut u32 = &mut above[parent];
                *before = roots.len() as u32 - *before;
            }
            if node.leaves as usize <= most {
                roots.push(node);
                continue;
            }
            let [left, right] = node.children(left_leaves);
            waiting.extend([(right, Some(above.len())), (left, None)]);
            above.push(roots.len() as u32);
            names.push(below.map_or(node.inner, |names| names[node.inner as usize]));
        }
        Self {
            treelets: Vec::new(),
            roots,
            above,
            names,
        }
    }

    pub(super) fn leaves(&self, treelet: &Range<usize>) -> Range<usize> {
        let (first, last) = (self.roots[treelet.start], self.roots[treelet.end - 1]);
        first.first_leaf as usize..(last.first_leaf + last.leaves) as usize
    }
}

/// As many neighbours as fit into each treelet; another begins at each of `starts`, which rise.
fn pack(roots: &[Subtree], starts: &[usize]) -> Vec<Range<usize>> {
    let (mut treelets, mut start, mut leaves) = (Vec::new(), 0, 0);
    let mut starts = starts.iter().copied().filter(|&at| at > 0).peekable();
    for (i, root) in roots.iter().enumerate() {
        let starts_here = starts.next_if_eq(&i).is_some();
        if starts_here || leaves + root.leaves as usize > Treelets::LEAVES {
            treelets.push(start..i);
            (start, leaves) = (i, 0);
        }
        leaves += root.leaves as usize;
    }
    treelets.push(start..roots.len());
    treelets
}

/// A breadth-first record back to a depth-first tree.
pub(crate) fn depth_first(topology: &Topology) -> BinaryTree {
    let (nodes, ranks) = (topology.node_count() as u32, topology.ranks());
    let sizes = topology.bottom_up(0_u32, |_| 1, |a, b| a + b);
    let leaves = |node: NodeRank| match node.leaf() {
        Some(_) => 1,
        None => sizes[node.rank() as usize],
    };
    let mut order = vec![0; topology.leaf_count()];
    let mut left_leaves = vec![0; topology.leaf_count().saturating_sub(1)];
    // Each node's first leaf and, if it is an inner node, its place in preorder.
    let mut places = vec![(0_u32, 0_u32); nodes as usize];
    for node in 0..nodes {
        let (first_leaf, inner) = places[node as usize];
        let node = ranks.of(node);
        if let Some(rank) = node.leaf() {
            order[first_leaf as usize] = topology.leaf_triangles()[rank as usize];
            continue;
        }
        let [left, right] = Topology::children_of_inner(node.rank());
        let before = leaves(ranks.of(left));
        left_leaves[inner as usize] = before;
        places[left as usize] = (first_leaf, inner + 1);
        places[right as usize] = (first_leaf + before, inner + before);
    }
    BinaryTree::new(order, left_leaves)
}
