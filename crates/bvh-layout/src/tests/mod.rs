//! Test trees, and a reference check of records.

mod blocks;
mod fuzz;
pub(crate) mod treelets;

use crate::{Converter, Spare, Topology};
use bvh_build::{BinaryTree, MAX_DEPTH};
use geom::StaticParts;
use std::collections::VecDeque;

/// Creates a tree. `split` maps a subtree's number of leaves and depth to the number of leaves on the left.
fn grow(leaves: usize, mut split: impl FnMut(u32, u32) -> u32) -> BinaryTree {
    let mut left_leaves = Vec::new();
    let mut waiting = vec![(leaves as u32, 0)];
    while let Some((leaves, depth)) = waiting.pop() {
        if leaves > 1 {
            let left = split(leaves, depth);
            left_leaves.push(left);
            waiting.extend([(leaves - left, depth + 1), (left, depth + 1)]);
        }
    }
    let n = leaves as u32;
    // A permutation with gaps: the scene has triangles that are not in the tree.
    let order = (0..n).map(|i| (i * 7 + 3) % n.next_multiple_of(7).next_power_of_two() + 2);
    BinaryTree::new(order.collect(), left_leaves)
}

/// Returns a number of scene triangles that fits the tree.
pub(crate) fn scene(tree: &BinaryTree) -> usize {
    tree.order().iter().max().map_or(0, |&t| t as usize + 2)
}

/// Classifies `all` triangles as moving or static.
pub(crate) fn parts(all: usize, moves: impl Fn(u32) -> bool) -> StaticParts {
    StaticParts {
        triangles: (0..all as u32).map(|t| !moves(t)).collect(),
        ..StaticParts::default()
    }
}

pub(crate) fn record(tree: &BinaryTree) -> Topology {
    Converter::default().convert(tree, scene(tree), Spare::default())
}

/// Creates a tree that is neither balanced nor too deep.
pub(crate) fn random_tree(leaves: usize, seed: u64) -> BinaryTree {
    let mut state = seed;
    grow(leaves, |k, _| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let random = (state >> 33) as u32;
        let margin = if k > 32 { k / 5 } else { 1 };
        margin + random % (k - 2 * margin + 1)
    })
}

/// Creates a deep tree. `left` maps a number of leaves to that of the left child, as far as the depth limit permits.
fn deep(leaves: usize, left: impl Fn(u32) -> u32) -> BinaryTree {
    grow(leaves, |k, depth| {
        let limit = 1_u64 << (MAX_DEPTH - depth - 1);
        if u64::from(k - 1) <= limit {
            left(k)
        } else {
            k / 2
        }
    })
}

/// Creates a deep tree in which every left child is a leaf, as far as the depth limit permits.
pub(crate) fn chain(leaves: usize) -> BinaryTree {
    deep(leaves, |_| 1)
}

/// Returns small trees of every shape: empty, single, full, chains, ragged, and with sizes around word boundaries.
pub(crate) fn shapes() -> Vec<BinaryTree> {
    let random = (0..70).chain([255, 256, 257, 1_000]);
    let mut all: Vec<BinaryTree> = random.map(|n| random_tree(n, n as u64)).collect();
    all.extend([2, 16, 17, 64, 1_024].map(|n| grow(n, |k, _| k / 2)));
    all.extend([3, 64, 65, 66, 100, 3_000].map(chain));
    all.extend([3, 64, 65, 66, 100, 3_000].map(|n| deep(n, |k| k - 1)));
    all
}

/// Checks a record against its tree by a breadth-first walk over both, with a queue.
pub(crate) fn check_against(record: &Topology, tree: &BinaryTree) {
    assert_eq!(record.leaf_count(), tree.leaf_count());
    assert_eq!(record.triangle_count(), scene(tree));
    assert_eq!(
        Topology::from_words(record.words().to_vec()).as_ref(),
        Ok(record)
    );
    let mut queue = VecDeque::new();
    if tree.leaf_count() > 0 {
        queue.push_back((0, 0, tree.leaf_count() as u32, 0));
    }
    let (mut node, mut leaf, mut inner) = (0, 0, 0);
    let mut per_level = Vec::new();
    while let Some((preorder, first_leaf, leaves, depth)) = queue.pop_front() {
        per_level.resize(depth + 1, 0);
        let rank = record.ranks().of(node);
        assert_eq!(rank.rank(), if leaves == 1 { leaf } else { inner });
        assert_eq!(rank.leaf().is_some(), leaves == 1, "node {node}");
        if leaves == 1 {
            let triangle = record.leaf_triangles()[leaf as usize];
            assert_eq!(triangle, tree.order()[first_leaf as usize]);
            leaf += 1;
        } else {
            // The children are appended to the queue, so their numbers follow those of its nodes.
            let next = node + queue.len() as u32 + 1;
            assert_eq!(Topology::children_of_inner(inner), [next, next + 1]);
            let left = tree.left_leaves()[preorder];
            queue.push_back((preorder + 1, first_leaf, left, depth + 1));
            let right = preorder + left as usize;
            queue.push_back((right, first_leaf + left, leaves - left, depth + 1));
            per_level[depth] += 1;
            inner += 1;
        }
        node += 1;
    }
    assert_eq!(node as usize, record.node_count());
    assert!(record.levels().map(|inner| inner.len()).eq(per_level));
}
