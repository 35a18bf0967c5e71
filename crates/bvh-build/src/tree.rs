//! A binary tree in depth-first order, without boxes: 8 bytes a triangle.

use crate::{BuildError, Cancel};

/// A binary tree with one triangle per leaf.
///
/// A subtree of `k` leaves is `k - 1` consecutive inner nodes in preorder and `k` consecutive leaves. So one number an
/// inner node says it all: how many leaves its left child holds. For the inner node `i` with `k` leaves from leaf `s`,
/// of which `l = left_leaves[i]` lie to the left: the left child has leaves `s..s + l` and, if `l > 1`, is inner node
/// `i + 1`; the right child has leaves `s + l..s + k` and, if `k - l > 1`, is inner node `i + l`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BinaryTree {
    pub(crate) left_leaves: Vec<u32>,
    pub(crate) order: Vec<u32>,
}

/// A node of a [`BinaryTree`], by where its parts lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Subtree {
    /// Preorder index of the inner node; meaningless for a leaf.
    pub inner: u32,
    /// Its first leaf.
    pub first_leaf: u32,
    /// Its leaves; 1 for a leaf.
    pub leaves: u32,
}

impl Subtree {
    /// Both children of an inner node of the tree with these numbers of leaves to the left.
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

/// The part of a [`BinaryTree`] that a subtree fills: its inner nodes and its leaves, of which there is one more.
pub(crate) struct SubtreeSlot<'a> {
    pub(crate) left_leaves: &'a mut [u32],
    pub(crate) order: &'a mut [u32],
}

impl SubtreeSlot<'_> {
    /// Writes a root that has so many leaves to its left; gives the parts of its children.
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
    /// Makes room for so many leaves; what is in it does not matter.
    pub(crate) fn slot(&mut self, leaves: usize) -> SubtreeSlot<'_> {
        self.order.resize(leaves, 0);
        self.left_leaves.resize(leaves.saturating_sub(1), 0);
        SubtreeSlot {
            left_leaves: &mut self.left_leaves,
            order: &mut self.order,
        }
    }

    /// A tree by its parts: see [`BinaryTree::order`] and [`BinaryTree::left_leaves`].
    ///
    /// # Panics
    /// If there are not one fewer inner nodes than leaves.
    #[must_use]
    pub fn new(order: Vec<u32>, left_leaves: Vec<u32>) -> Self {
        assert_eq!(order.len().saturating_sub(1), left_leaves.len());
        Self { left_leaves, order }
    }

    /// Has itself filled, unless that is cancelled; empties itself if that fails.
    pub(crate) fn fill<T>(
        &mut self,
        cancel: &Cancel,
        build: impl FnOnce(&mut Self) -> Result<T, BuildError>,
    ) -> Result<T, BuildError> {
        let built = match cancel.is_cancelled() {
            true => Err(BuildError::Cancelled),
            false => build(self),
        };
        if built.is_err() {
            self.order.clear();
            self.left_leaves.clear();
        }
        built
    }

    /// Leaves, which is triangles in the tree.
    pub fn leaf_count(&self) -> usize {
        self.order.len()
    }

    /// The triangle of each leaf, left to right.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// For each inner node in preorder, the leaves below its left child.
    pub fn left_leaves(&self) -> &[u32] {
        &self.left_leaves
    }

    /// The whole tree; `None` when it holds no triangle.
    pub fn root(&self) -> Option<Subtree> {
        let leaves = self.order.len() as u32;
        (leaves > 0).then_some(Subtree {
            inner: 0,
            first_leaf: 0,
            leaves,
        })
    }

    /// The triangles below a node, left to right.
    pub(crate) fn triangles(&self, node: Subtree) -> &[u32] {
        &self.order[node.first_leaf as usize..][..node.leaves as usize]
    }

    /// See [`Subtree::children`].
    #[inline]
    pub fn children(&self, node: Subtree) -> [Subtree; 2] {
        node.children(&self.left_leaves)
    }
}
