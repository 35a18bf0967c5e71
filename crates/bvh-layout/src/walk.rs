//! A streaming preorder walk over a binary tree's inner nodes, which can start at any node.

use bvh_build::{BinaryTree, MAX_DEPTH};

/// An inner node that is not yet visited.
#[derive(Clone, Copy, Debug, Default)]
struct PendingNode {
    first_leaf: u32,
    leaves: u32,
    depth: u32,
}

/// An inner node as passed to the visitor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InnerNode {
    pub(crate) depth: u32,
    /// First leaf of the left child.
    pub(crate) left: u32,
    /// First leaf of the right child.
    pub(crate) right: u32,
    /// Bit 0: the left child is a leaf; bit 1: the right child is.
    pub(crate) leaf_children: u8,
}

/// Stack size. A power of two, so that masked indices need no bounds check. Above `MAX_DEPTH`, since at most one node
/// per depth is pending.
const STACK: usize = 128;

/// Stack of pending inner nodes, the next one on top. In [`Walk::run`], no branch depends on the tree's shape.
#[derive(Debug)]
pub(crate) struct Walk {
    stack: [PendingNode; STACK],
    waiting: usize,
}

impl Walk {
    /// Creates a walk that starts at inner node `start`, counted in preorder.
    pub(crate) fn starting_at(tree: &BinaryTree, start: usize) -> Self {
        let mut walk = Self {
            stack: [PendingNode::default(); STACK],
            waiting: 0,
        };
        let leaves = tree.leaf_count() as u32;
        walk.push(PendingNode {
            leaves,
            ..PendingNode::default()
        });
        let mut at = 0;
        while at < start {
            let node = walk.pop();
            let left = tree.left_leaves()[at];
            let [left_child, right_child] = node.children(left);
            walk.push(right_child);
            if at + (left as usize) <= start {
                at += left as usize;
            } else {
                walk.push(left_child);
                at += 1;
            }
        }
        walk
    }

    /// Visits the next inner nodes, one for each entry of `left_leaves`. Panics if the tree is deeper than
    /// [`MAX_DEPTH`].
    #[inline(always)]
    pub(crate) fn run(mut self, left_leaves: &[u32], mut visit: impl FnMut(InnerNode)) {
        for &left in left_leaves {
            let node = self.pop();
            assert!(node.depth < MAX_DEPTH, "a leaf lies deeper than MAX_DEPTH");
            let [left_child, right_child] = node.children(left);
            self.push(right_child);
            self.push(left_child);
            visit(InnerNode {
                depth: node.depth,
                left: left_child.first_leaf,
                right: right_child.first_leaf,
                leaf_children: u8::from(left_child.leaves == 1)
                    | u8::from(right_child.leaves == 1) << 1,
            });
        }
    }

    /// Pushes an inner node. A leaf is written too, without a branch, but the next push overwrites it.
    #[inline(always)]
    fn push(&mut self, node: PendingNode) {
        self.stack[self.waiting % STACK] = node;
        self.waiting += usize::from(node.leaves > 1);
    }

    #[inline(always)]
    fn pop(&mut self) -> PendingNode {
        self.waiting = self.waiting.wrapping_sub(1);
        self.stack[self.waiting % STACK]
    }
}

impl PendingNode {
    #[inline(always)]
    fn children(self, left_leaves: u32) -> [Self; 2] {
        let depth = self.depth + 1;
        [
            Self {
                leaves: left_leaves,
                depth,
                ..self
            },
            Self {
                first_leaf: self.first_leaf + left_leaves,
                leaves: self.leaves - left_leaves,
                depth,
            },
        ]
    }
}
