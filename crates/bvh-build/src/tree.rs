//! A binary tree in depth-first order, without boxes: 8 bytes per triangle.

use crate::cancel::{BuildError, Cancel};

/// A binary tree with one triangle per leaf.
///
/// A subtree of `k` leaves is `k - 1` consecutive inner nodes in preorder and `k` consecutive leaves. So one number per
/// inner node defines the tree: the number of leaves of its left child. Let inner node `i` have leaves `s..s + k`, and
/// let `l = left_leaves[i]`. The left child has leaves `s..s + l` and, if `l > 1`, is inner node `i + 1`. The right
/// child has leaves `s + l..s + k` and, if `k - l > 1`, is inner node `i + l`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BinaryTree {
    pub(crate) left_leaves: Vec<u32>,
    pub(crate) order: Vec<u32>,
}

/// A node of a [`BinaryTree`], with the position of its subtree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Subtree {
    /// Preorder index of the inner node; meaningless for a leaf.
    pub inner: u32,
    /// Index of the first leaf.
    pub first_leaf: u32,
    /// Number of leaves; 1 for a leaf.
    pub leaves: u32,
}

impl Subtree {
    /// Returns both children of an inner node. `left_leaves` is [`BinaryTree::left_leaves`] of its tree.
    ///
    /// # Panics
    /// On a leaf.
    #[inline]
    pub fn children(self, left_leaves: &[u32]) -> [Self; 2] {
        assert!(self.leaves > 1, "a leaf has no children");
        let left = left_leaves[self.inner as usize];
        [
            Self {
                inner: self.inner + 1,
                leaves: left,
                ..self
            },
            Self {
                inner: self.inner + left,
                first_leaf: self.first_leaf + left,
                leaves: self.leaves - left,
            },
        ]
    }
}

/// The part of a [`BinaryTree`] that one subtree is written to. `order` has one element more than `left_leaves`.
pub(crate) struct SubtreeSlot<'a> {
    pub(crate) left_leaves: &'a mut [u32],
    pub(crate) order: &'a mut [u32],
}

impl SubtreeSlot<'_> {
    /// Writes a root with `left` leaves on its left side. Returns the parts of its children.
    #[inline]
    pub(crate) fn split(self, left: usize) -> [Self; 2] {
        self.left_leaves[0] = left as u32;
        let (inner_a, inner_b) = self.left_leaves[1..].split_at_mut(left - 1);
        let (order_a, order_b) = self.order.split_at_mut(left);
        [
            Self {
                left_leaves: inner_a,
                order: order_a,
            },
            Self {
                left_leaves: inner_b,
                order: order_b,
            },
        ]
    }
}

impl BinaryTree {
    /// Resizes the tree to `leaves` leaves, whose content is unspecified, and returns the part for the whole tree.
    pub(crate) fn slot(&mut self, leaves: usize) -> SubtreeSlot<'_> {
        self.order.resize(leaves, 0);
        self.left_leaves.resize(leaves.saturating_sub(1), 0);
        SubtreeSlot {
            left_leaves: &mut self.left_leaves,
            order: &mut self.order,
        }
    }

    /// Creates a tree from its parts: see [`BinaryTree::order`] and [`BinaryTree::left_leaves`].
    ///
    /// # Panics
    /// If the number of inner nodes is not the number of leaves less one.
    #[must_use]
    pub fn new(order: Vec<u32>, left_leaves: Vec<u32>) -> Self {
        assert_eq!(order.len().saturating_sub(1), left_leaves.len());
        Self { left_leaves, order }
    }

    /// Fills the tree by `build`, unless the build is cancelled. Empties the tree on failure.
    pub(crate) fn fill<T>(
        &mut self,
        cancel: &Cancel,
        build: impl FnOnce(&mut Self) -> Result<T, BuildError>,
    ) -> Result<T, BuildError> {
        let built = if cancel.is_cancelled() {
            Err(BuildError::Cancelled)
        } else {
            build(self)
        };
        if built.is_err() {
            self.order.clear();
            self.left_leaves.clear();
        }
        built
    }

    /// Returns the number of leaves, which is the number of triangles in the tree.
    pub fn leaf_count(&self) -> usize {
        self.order.len()
    }

    /// Returns the triangle index of each leaf, left to right.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Returns, for each inner node in preorder, the number of leaves of its left child.
    pub fn left_leaves(&self) -> &[u32] {
        &self.left_leaves
    }

    /// Returns the depth of the deepest leaf, where the root has depth 0. Returns `least` if no leaf is deeper. A higher
    /// `least` takes less time, because subtrees that cannot be deeper are skipped.
    pub fn depth(&self, least: u32) -> u32 {
        let (mut deepest, mut waiting) = (least, Vec::from_iter(self.root().map(|root| (root, 0))));
        while let Some((node, depth)) = waiting.pop() {
            // A leaf below `node` is at most `leaves - 1` levels deeper.
            if depth + node.leaves - 1 <= deepest {
                continue;
            }
            if node.leaves == 1 {
                deepest = depth;
            } else {
                waiting.extend(self.children(node).map(|child| (child, depth + 1)));
            }
        }
        deepest
    }

    /// Returns the root; `None` for an empty tree.
    pub fn root(&self) -> Option<Subtree> {
        let leaves = self.order.len() as u32;
        (leaves > 0).then_some(Subtree {
            inner: 0,
            first_leaf: 0,
            leaves,
        })
    }

    /// Returns the triangles below a node, left to right.
    pub(crate) fn triangles(&self, node: Subtree) -> &[u32] {
        &self.order[node.first_leaf as usize..][..node.leaves as usize]
    }

    /// Returns both children of an inner node. Panics on a leaf.
    #[inline]
    pub fn children(&self, node: Subtree) -> [Subtree; 2] {
        node.children(&self.left_leaves)
    }
}
