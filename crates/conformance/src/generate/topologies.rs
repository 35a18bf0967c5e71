//! Valid but unusual trees, and trees of other scenes.

use super::strategies::shrinking_list;
use bvh_build::{BinaryTree, MAX_DEPTH};
use bvh_layout::Topology;
use geom::Animation;
use proptest::prelude::*;
use std::sync::Arc;

/// Distribution of a node's leaves among its children.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LeafSplit {
    /// All leaves except one to the left: a chain of maximum depth.
    LeftChain,
    /// All leaves except one to the right.
    RightChain,
    /// A random distribution.
    Random,
}

impl LeafSplit {
    pub(crate) const ALL: [Self; 3] = [Self::LeftChain, Self::RightChain, Self::Random];

    fn left(self, leaves: usize, depth: u32, rng: &mut fastrand::Rng) -> usize {
        // Each child has at most `limit` leaves, because the depth of trees is limited.
        let limit = 1_usize << (MAX_DEPTH - depth - 1).min(40);
        let wanted = match self {
            Self::LeftChain => leaves - 1,
            Self::RightChain => 1,
            Self::Random => rng.usize(1..leaves),
        };
        wanted.clamp(leaves.saturating_sub(limit).max(1), limit.min(leaves - 1))
    }
}

/// Description of a valid tree that no builder makes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TreeDescription {
    pub(crate) split: LeafSplit,
    /// Seed of the order of leaves, and of the shape if `split` is random.
    pub(crate) seed: u64,
}

impl TreeDescription {
    /// Lists with a tree of each [`LeafSplit`]. Shrinking removes trees.
    pub(crate) fn all() -> impl Strategy<Value = Vec<Self>> {
        let numbers = || any::<u64>().no_shrink();
        shrinking_list(
            LeafSplit::ALL.map(|split| numbers().prop_map(move |seed| Self { split, seed })),
        )
    }

    /// Returns the tree over the triangles of a scene.
    pub(crate) fn tree(self, animation: &Animation) -> Topology {
        let leaves = live(animation, self.seed);
        split_tree(animation.triangle_count(), &leaves, self.split, self.seed)
    }
}

/// Returns the triangles that a tree of the scene must contain, shuffled.
pub(crate) fn live(animation: &Animation, seed: u64) -> Vec<u32> {
    let all = 0..animation.triangle_count() as u32;
    let mut live: Vec<u32> = all.filter(|&t| animation.is_live(t)).collect();
    fastrand::Rng::with_seed(seed).shuffle(&mut live);
    live
}

/// Returns a tree whose nodes are split by `split`.
pub(crate) fn split_tree(
    triangles: usize,
    leaves: &[u32],
    split: LeafSplit,
    seed: u64,
) -> Topology {
    let mut rng = fastrand::Rng::with_seed(seed);
    topology_from_splits(triangles, leaves, |depth, leaves| {
        split.left(leaves, depth, &mut rng)
    })
}

/// Returns a tree over `leaves`, left to right, for a scene of `triangles` triangles.
///
/// `split` takes a node's depth and its number of leaves, and returns the number of leaves of its left child.
///
/// # Panics
/// If `split` leaves a child without leaves, or if the tree exceeds the maximum depth.
fn topology_from_splits(
    triangles: usize,
    leaves: &[u32],
    mut split: impl FnMut(u32, usize) -> usize,
) -> Topology {
    let (mut left_leaves, mut waiting) = (Vec::new(), vec![(leaves.len(), 0)]);
    while let Some((count, depth)) = waiting.pop() {
        if count > 1 {
            let left = split(depth, count);
            left_leaves.push(left as u32);
            waiting.extend([(count - left, depth + 1), (left, depth + 1)]);
        }
    }
    let tree = BinaryTree::new(leaves.to_vec(), left_leaves);
    Topology::new(Arc::new(tree), triangles)
}

/// Returns a tree over `leaves`, left to right: a chain of `chain` leaves above a balanced tree of all others.
pub fn uneven_tree(triangles: usize, leaves: &[u32], chain: u32) -> Topology {
    let split = |depth: u32, count: usize| if depth < chain { 1 } else { count / 2 };
    topology_from_splits(triangles, leaves, split)
}

/// Returns trees that do not belong to this scene, each with the reason.
pub(crate) fn foreign(animation: &Animation, seed: u64) -> Vec<(&'static str, Topology)> {
    let count = animation.triangle_count();
    let live = live(animation, seed);
    let of = |count, leaves: &[u32]| split_tree(count, leaves, LeafSplit::Random, seed);
    let fewer = live.split_last().map_or(&[][..], |(_, rest)| rest);
    let with = |more: u32| [fewer, &[more]].concat();
    let never = (0..count as u32).find(|&t| !animation.is_live(t));
    let mut all = vec![("a scene with one triangle more", of(count + 1, &live))];
    if !live.is_empty() {
        all.push(("one live triangle without a leaf", of(count, fewer)));
        let beyond = of(count + 1, &with(count as u32));
        all.push(("a leaf of a triangle that does not exist", beyond));
    }
    if live.len() != 1 {
        all.push(("a tree of one leaf", of(count.max(1), &[0])));
    }
    if let Some(never) = never {
        let more = of(count, &[&live[..], &[never]].concat());
        all.push(("a leaf of a triangle that is never active", more));
    }
    if let Some(never) = never.filter(|_| !live.is_empty()) {
        let instead = of(count, &with(never));
        all.push(("a never active triangle instead of a live one", instead));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trees_of_every_split_are_valid_and_deep() {
        for n in [0, 1, 2, 3, 40, 65, 66, 300] {
            let leaves: Vec<u32> = (0..n).collect();
            for split in LeafSplit::ALL {
                let tree = split_tree(n as usize + 2, &leaves, split, 7);
                assert_eq!(tree.binary().order(), leaves);
                if n > 65 && split != LeafSplit::Random {
                    assert_eq!(tree.binary().depth(0), MAX_DEPTH, "{split:?}");
                }
            }
        }
    }
}
