//! Test trees.

mod blocks;
pub(crate) mod treelets;

use bvh_build::{BinaryTree, MAX_DEPTH};
use geom::StaticParts;
use proptest::prelude::*;

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
pub(crate) fn scene_triangle_count(tree: &BinaryTree) -> usize {
    tree.order().iter().max().map_or(0, |&t| t as usize + 2)
}

/// Classifies `all` triangles as moving or static.
pub(crate) fn parts(all: usize, moves: impl Fn(u32) -> bool) -> StaticParts {
    StaticParts {
        triangles: (0..all as u32).map(|t| !moves(t)).collect(),
        ..StaticParts::default()
    }
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

/// Returns small trees of every shape: empty, single, full, chains, ragged, and with numbers of leaves around the limits:
/// 8 and 32 for blocks of a `BlockTree` and of a `WideTree`, 64 for depth, 256 for treelets.
pub(crate) fn shapes() -> Vec<BinaryTree> {
    let random = (0..70).chain([255, 256, 257, 1_000]);
    let mut all: Vec<BinaryTree> = random.map(|n| random_tree(n, n as u64)).collect();
    all.extend([2, 16, 17, 64, 1_024].map(|n| grow(n, |k, _| k / 2)));
    all.extend([3, 64, 65, 66, 100, 3_000].map(chain));
    all.extend([3, 64, 65, 66, 100, 3_000].map(|n| deep(n, |k| k - 1)));
    all
}

#[test]
fn all_forms_represent_every_shape() {
    for tree in shapes().iter().chain(&[random_tree(20_000, 5)]) {
        treelets::check(tree);
        blocks::check(tree);
    }
}

proptest! {
    #[test]
    fn all_forms_represent_random_trees(leaves in 0..1_500_usize, seed: u64, is_deep: bool) {
        let tree = if is_deep { chain(leaves) } else { random_tree(leaves, seed) };
        treelets::check(&tree);
        blocks::check(&tree);
    }
}
