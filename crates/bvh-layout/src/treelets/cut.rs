//! Partitions a tree: selects subtrees that fit a treelet, and packs neighbouring subtrees into one treelet.

use super::Treelets;
use bvh_build::{BinaryTree, Subtree};
use std::ops::Range;

/// One level of treelets.
#[derive(Debug)]
pub(super) struct Cut {
    /// The subtrees that are kept whole, left to right.
    pub(super) roots: Vec<Subtree>,
    /// Range of roots of each treelet.
    pub(super) treelets: Vec<Range<usize>>,
    /// The tree above, whose leaves are the roots: the number of roots below the left child of each inner
    /// node, in preorder.
    pub(super) above: Vec<u32>,
    /// Index in the whole tree of each inner node of `above`.
    pub(super) whole_tree_indices: Vec<u32>,
}

/// Maximum number of triangles of a tree that is cut into the largest subtrees that fit. A device has enough workgroups
/// to refit all its treelets at once, and fewer roots save levels.
const SMALL: usize = 1 << 17;
/// Maximum number of triangles of a subtree in larger trees. Treelets are then 90 % full on average. With the largest
/// subtrees that fit, they are 70 % full. On an H200 at 1.6M triangles, a limit of 64 instead of 256 saves 17 of 146
/// us of preprocessing and refit, 128 saves 12, and 48 saves 14 to 16.
const QUARTER: usize = Treelets::LEAVES / 4;

impl Cut {
    /// Returns all levels, the level of the triangles first.
    ///
    /// The roots of a level are the leaves of the next one, so the bounds below limit the number of levels.
    ///
    /// With subtrees of at most 256 leaves, a level of `n` leaves has at most `n / 4 + 1` roots. The nodes above the
    /// roots have more than 256 leaves. The lowest such nodes are fewer than a 256th of the leaves, and each has at most
    /// 63 ancestors. So the nodes above the roots are fewer than 64 / 256 of the leaves. There is one root more than
    /// nodes above the roots.
    ///
    /// With subtrees of at most 64 leaves, a level has at most half as many roots as leaves. Call a node *low* if it
    /// has 65 leaves or more and its children have fewer. Let there be `m` low nodes. Each is at least 7 levels high,
    /// so it has at most 57 ancestors. Fewer than `m` ancestors have low nodes on both sides. Each of the other
    /// `a <= 57 m` ancestors has one side without low nodes. This side is a single root and has at least one leaf. So
    /// there are at most `2 m + a` roots for `65 m + a` leaves.
    pub(super) fn all(tree: &BinaryTree) -> Vec<Self> {
        let most = match tree.leaf_count() {
            0..=SMALL => Treelets::LEAVES,
            _ => QUARTER,
        };
        let mut levels = vec![Self::new(tree.left_leaves(), most, None)];
        while let Some(last) = levels.last()
            && !last.above.is_empty()
        {
            let next = Self::new(
                &last.above,
                Treelets::LEAVES,
                Some(&last.whole_tree_indices),
            );
            levels.push(next);
        }
        // From the top down: roots share a treelet only if they are leaves of the same treelet above.
        let mut starts = Vec::new();
        for level in levels.iter_mut().rev() {
            level.treelets = pack(&level.roots, &starts);
            let treelets = level.treelets.iter();
            starts = treelets.map(|t| level.leaves(t).start).collect();
        }
        levels
    }

    /// Cuts a tree into the largest subtrees of at most `most` leaves. `whole_tree_indices` has the index in the whole
    /// tree of each inner node of this tree; `None` if the indices are equal. Does not fill `treelets`.
    fn new(left_leaves: &[u32], most: usize, whole_tree_indices: Option<&[u32]>) -> Self {
        let (mut roots, mut above, mut indices_above) = (Vec::new(), Vec::new(), Vec::new());
        let root = Subtree {
            inner: 0,
            first_leaf: 0,
            leaves: left_leaves.len() as u32 + 1,
        };
        let mut waiting = vec![(root, None)];
        while let Some((node, right_child_of)) = waiting.pop() {
            if let Some(parent) = right_child_of {
                // Until its left subtree is done, the parent's entry holds the number of roots before the parent.
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
            let whole_tree_index = |indices: &[u32]| indices[node.inner as usize];
            indices_above.push(whole_tree_indices.map_or(node.inner, whole_tree_index));
        }
        Self {
            treelets: Vec::new(),
            roots,
            above,
            whole_tree_indices: indices_above,
        }
    }

    /// Returns the range of leaves below the roots of a treelet.
    pub(super) fn leaves(&self, treelet: &Range<usize>) -> Range<usize> {
        let (first, last) = (self.roots[treelet.start], self.roots[treelet.end - 1]);
        first.first_leaf as usize..(last.first_leaf + last.leaves) as usize
    }
}

/// Packs as many neighbouring roots as fit into each treelet. A treelet begins at each of `starts`, which ascend.
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
