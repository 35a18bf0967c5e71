//! The tree in its wide form, for traversals in which each invocation of a subgroup tests one child.

use super::fill::Places;
use super::{Treelets, WideTree};
use bvh_build::{BinaryTree, Subtree};
use rayon::prelude::*;
use std::sync::atomic::Ordering;

/// Minimum number of wide nodes per task.
const RUN: usize = 16;

/// A binary tree, and the places of its nodes in treelets.
struct PlacedTree<'a> {
    left_leaves: &'a [u32],
    treelets: &'a Treelets,
    places: &'a Places,
}

/// A child of a wide node: the binary subtree, and the row of its box.
#[derive(Clone, Copy)]
struct Lane {
    node: Subtree,
    row: u32,
}

impl Lane {
    fn is_block(&self) -> bool {
        self.node.leaves <= WideTree::LANES as u32
    }

    fn block(&self) -> u32 {
        WideTree::BLOCK | target(self.node.first_leaf, self.node.leaves)
    }
}

impl PlacedTree<'_> {
    /// Returns both children of an inner node, with the rows of their boxes.
    fn open(&self, node: Subtree) -> [Lane; 2] {
        let place = self.places[node.inner as usize].load(Ordering::Relaxed);
        let row = self.treelets.treelet(place as usize >> 8).inner_row + 4 * (place & 255);
        let [left, right] = node.children(self.left_leaves);
        [(left, row), (right, row + 2)].map(|(node, row)| Lane { node, row })
    }

    /// Returns the subtrees of a wide node. The largest subtree is opened first.
    fn open_wide(&self, node: Subtree) -> Vec<Lane> {
        let mut lanes = Vec::with_capacity(WideTree::LANES);
        lanes.extend(self.open(node));
        while lanes.len() < WideTree::LANES {
            let large = lanes.iter().enumerate();
            let large = large.filter(|(_, lane)| !lane.is_block());
            let Some((at, lane)) = large.max_by_key(|(_, lane)| lane.node.leaves) else {
                break;
            };
            let [left, right] = self.open(lane.node);
            lanes[at] = left;
            lanes.push(right);
        }
        lanes
    }
}

/// Lanes under construction, level by level.
#[derive(Default)]
struct LaneList {
    rows: Vec<u32>,
    targets: Vec<u32>,
}

impl LaneList {
    /// Appends a node's lanes. Returns the node's target word. Adds the children that are nodes, each with the index of
    /// its lane, to `next`.
    fn add_node(&mut self, lanes: &[Lane], next: &mut Vec<(Subtree, usize)>) -> u32 {
        let first = self.targets.len();
        for lane in lanes {
            self.rows.push(lane.row);
            if lane.is_block() {
                self.targets.push(lane.block());
            } else {
                next.push((lane.node, self.targets.len()));
                self.targets.push(0);
            }
        }
        target(first as u32, lanes.len() as u32)
    }

    fn into_tree(mut self, root: u32) -> WideTree {
        let lanes = self.targets.len();
        self.rows.append(&mut self.targets);
        WideTree {
            words: self.rows,
            lanes,
            root,
        }
    }
}

impl WideTree {
    /// Creates the wide form of a tree, in the rayon pool that the caller installed. Returns `None` if it is too deep.
    pub(super) fn of(tree: &BinaryTree, treelets: &Treelets, places: &Places) -> Option<Self> {
        let node = tree.root()?;
        let tree = PlacedTree {
            left_leaves: tree.left_leaves(),
            treelets,
            places,
        };
        let mut lanes = LaneList::default();
        // Rows 0 and 1 hold the box of the whole tree.
        let all = Lane { node, row: 0 };
        if all.is_block() {
            lanes.add_node(&[all], &mut Vec::new());
            return Some(lanes.into_tree(target(0, 1)));
        }
        let mut level = Vec::new();
        let root = lanes.add_node(&tree.open_wide(node), &mut level);
        for _ in 1..Self::MOST_LEVELS {
            let opened = level.par_iter().with_min_len(RUN);
            let opened: Vec<_> = opened.map(|&(node, _)| tree.open_wide(node)).collect();
            let mut next = Vec::new();
            for (&(_, lane), children) in level.iter().zip(&opened) {
                lanes.targets[lane] = lanes.add_node(children, &mut next);
            }
            level = next;
        }
        level.is_empty().then(|| lanes.into_tree(root))
    }
}

/// Encodes a range of lanes or of triangles as a target word.
fn target(first: u32, count: u32) -> u32 {
    first << WideTree::FIRST_AT | count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::treelets::rows_of;
    use crate::tests::{chain, random_tree, shapes};

    /// Appends the triangles below a target. Returns its number of levels of nodes.
    fn below(wide: &WideTree, target: u32, triangles: &mut Vec<u32>) -> usize {
        let (first, count) = ((target & !WideTree::BLOCK) >> 6, target & 63);
        assert!((1..=32).contains(&count));
        if target & WideTree::BLOCK != 0 {
            triangles.extend(first..first + count);
            return 0;
        }
        let targets = &wide.words[wide.lanes + first as usize..][..count as usize];
        let levels = targets.iter().map(|&target| below(wide, target, triangles));
        1 + levels.max().unwrap_or(0)
    }

    #[test]
    fn lanes_cover_each_triangle_once() {
        let others = [random_tree(9000, 5), chain(40)];
        for tree in shapes().into_iter().chain(others) {
            let treelets = Treelets::of(&tree);
            let Some(wide) = &treelets.wide else {
                assert_eq!(treelets.leaf_count, 0);
                continue;
            };
            let mut found = Vec::new();
            assert!(below(wide, wide.root, &mut found) <= WideTree::MOST_LEVELS);
            found.sort_unstable();
            assert!(found.into_iter().eq(0..treelets.leaf_count));
            let mut boxes = rows_of(&treelets);
            let (rows, targets) = wide.words.split_at(wide.lanes);
            for (row, &target) in rows.iter().zip(targets) {
                let mut found = Vec::new();
                below(wide, target, &mut found);
                found.sort_unstable();
                let triangles = found.iter().map(|&at| tree.order()[at as usize]);
                let of_box = boxes.remove(row).expect("a row that is not another lane's");
                assert!(triangles.eq(of_box.order), "row {row}");
            }
        }
    }

    #[test]
    fn large_trees_have_no_wide_tree() {
        let most = WideTree::MOST_TRIANGLES;
        let of = |n| Treelets::of(&random_tree(n, 1)).wide.is_some();
        assert!(of(1) && of(most) && !of(most + 1) && !of(0));
    }
}
