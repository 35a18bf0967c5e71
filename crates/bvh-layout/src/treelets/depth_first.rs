//! A breadth-first record back to a depth-first tree.

use crate::Topology;

/// The arrays of [`bvh_build::BinaryTree`]: leaves to the left of each inner node, triangles.
pub(super) fn arrays(topology: &Topology) -> (Vec<u32>, Vec<u32>) {
    let nodes = topology.node_count() as u32;
    let mut leaves = vec![1_u32; nodes as usize];
    for node in (0..nodes).rev().filter(|&node| !topology.is_leaf(node)) {
        let children = Topology::children_of_inner(node - topology.leaf_rank(node));
        leaves[node as usize] = children.iter().map(|&c| leaves[c as usize]).sum();
    }
    let mut order = vec![0; topology.leaf_count()];
    let mut left_leaves = vec![0; topology.leaf_count().saturating_sub(1)];
    // Each node's first leaf and, if it is an inner node, its place in preorder.
    let mut places = vec![(0_u32, 0_u32); nodes as usize];
    for node in 0..nodes {
        let (first_leaf, inner) = places[node as usize];
        let rank = topology.leaf_rank(node);
        if topology.is_leaf(node) {
            order[first_leaf as usize] = topology.leaf_triangles()[rank as usize];
            continue;
        }
        let [left, right] = Topology::children_of_inner(node - rank);
        let before = leaves[left as usize];
        left_leaves[inner as usize] = before;
        places[left as usize] = (first_leaf, inner + 1);
        places[right as usize] = (first_leaf + before, inner + before);
    }
    (left_leaves, order)
}
